//! Region of instructions that are translated together: those that are reached from an address by branches whose
//! targets are known.

use super::{Action, Instruction, Source, Word};
use crate::cpu::operation::{Flow, behind};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::ops::Range;

/// Bytes of memory that there have to be.
pub(super) const LEAST: u32 = 1024;

/// Instructions of a region, at most.
const LARGEST: usize = 256;

/// Number of instructions that are translated again where another function begins.
const SMALL: usize = 48;

/// State of the core that is known before an instruction: where it is, whether the instruction before loaded or stored
/// one register, IT state.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub(super) struct Place {
    pub address: u32,
    pub single: bool,
    pub it: u8,
}

impl Place {
    /// Destination of a branch.
    pub fn at(address: u32) -> Self {
        Self { address, single: false, it: 0 }
    }
}

/// The instructions, where blocks of them begin, and what else there is to know of them. What is translated depends on
/// nothing else.
#[derive(Clone, PartialEq, Eq, Hash)]
pub(super) struct Region {
    pub entry: u32,
    /// Bytes of memory that answers at once.
    pub memory: u32,
    /// Addresses at which a store may change code.
    pub changeable: Range<u32>,
    instructions: BTreeMap<u32, Instruction>,
    leaders: BTreeSet<u32>,
}

impl Region {
    /// Region from an address on.
    pub fn explore(source: &dyn Source, entry: u32) -> Self {
        let mut region = Self {
            entry,
            memory: source.memory(),
            changeable: source.changeable(),
            instructions: BTreeMap::new(),
            leaders: BTreeSet::from([entry]),
        };
        let mut next = VecDeque::from([(entry, 0)]);
        while let Some((address, it)) = next.pop_front() {
            if region.instructions.contains_key(&address) || region.instructions.len() >= LARGEST {
                continue;
            }
            // The code that begins there is translated already; a jump to it costs as much as some instructions.
            if region.instructions.len() >= SMALL && source.is_translated(address) {
                continue;
            }
            let Some(instruction) = source.instruction(address) else { continue };
            let Instruction { action, operands, timing, .. } = instruction;
            // The target of a branch that is not translated is unknown.
            if action == Action::Other && timing.flow != Flow::On {
                continue;
            }
            region.instructions.insert(address, instruction);
            let follows = address.wrapping_add(timing.length.into());
            let it_follows = match timing.flow {
                Flow::Block => operands.x,
                _ => behind(it),
            };
            if let Action::Branch | Action::BranchIf | Action::BranchIfZero | Action::Call = action {
                region.leaders.insert(operands.immediate);
                next.push_back((operands.immediate, 0));
            }
            let ends = matches!(action, Action::Branch | Action::Call | Action::BranchToRegister { .. })
                || matches!(action, Action::Several { load: true }) && operands.immediate >> 15 != 0;
            if !ends || it != 0 {
                // The following instruction depends on whether it was executed; behind the next one it does not any
                // more.
                if it != 0 && timing.single {
                    region.leaders.insert(follows);
                    if let Some(second) = source.instruction(follows) {
                        region.leaders.insert(follows.wrapping_add(second.timing.length.into()));
                    }
                }
                if matches!(action, Action::BranchIf | Action::BranchIfZero) {
                    region.leaders.insert(follows);
                }
                next.push_front((follows, it_follows));
            }
        }
        region
    }

    /// Returns `true` if an address is part of it.
    pub fn holds(&self, address: u32) -> bool {
        self.instructions.contains_key(&address)
    }

    /// Addresses of its instructions, and of words that are taken to be constants, each with the one behind it.
    pub fn covers(&self) -> impl Iterator<Item = Range<u32>> {
        self.instructions.iter().flat_map(|(address, instruction)| {
            let constant = match instruction.word {
                Word::Constant { address, .. } => Some(address..address.wrapping_add(4)),
                _ => None,
            };
            std::iter::once(*address..address.wrapping_add(instruction.timing.length.into())).chain(constant)
        })
    }

    /// The instructions of the block at a place, each with its address: up to where another begins, or one that is not
    /// translated.
    pub fn block(&self, begin: u32) -> Vec<(u32, Instruction)> {
        let mut block = Vec::new();
        let mut address = begin;
        while let Some(instruction) = self.instructions.get(&address)
            && (address == begin || !self.leaders.contains(&address))
        {
            block.push((address, *instruction));
            address = address.wrapping_add(instruction.timing.length.into());
        }
        block
    }
}
