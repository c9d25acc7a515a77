//! Stack that a linked Thumb program can take from one function on: the frames of its functions along the deepest path
//! of calls.
//!
//! A frame is everything that a function's instructions take from the stack pointer, all of them together: where two of
//! them never run in one call, more than it takes. A branch out of a function is a tail call, before which the compiler
//! gives the frame back. What calls through a register may reach is said by whoever asks, where it is no constant of
//! the function; a call that nobody knows of, recursion and a stack pointer that is computed are errors. What ends the
//! program is not followed: a panic has the bridge off with its first instruction and resets, and if the stack does not
//! even bear that, the fault resets.

use super::registers::Registers;
use super::{Flow, Program, narrow, wide_flow};
use std::collections::BTreeMap;

/// The deepest path from a function on.
#[derive(Clone, Debug, Default)]
pub struct Depth {
    /// Bytes.
    pub bytes: u32,
    /// Functions on the way, with their frames.
    pub path: Vec<(String, u32)>,
}

impl Depth {
    /// Bytes of the frames up to the first function whose name has `part` in it, that one's among them.
    pub fn bytes_down_to(&self, part: &str) -> u32 {
        let until = self.path.iter().position(|(name, _)| name.contains(part)).map_or(self.path.len(), |at| at + 1);
        self.path.iter().take(until).map(|(_, frame)| frame).sum()
    }
}

/// Effect of a function on the stack.
#[derive(Clone, Debug, Default)]
struct Body {
    frame: u32,
    /// Destinations of calls, and whether its frame is still there then.
    calls: Vec<(u32, bool)>,
    /// Call through a register, and whether its frame is still there then.
    through_register: Option<bool>,
}

/// Frames of a program, with what is known of its calls through registers.
pub struct Stack<'a> {
    program: &'a Program,
    /// Names of what a function may call through registers, by its name; none where that is not known.
    targets: &'a dyn Fn(&str) -> Option<Vec<String>>,
    /// None while a function is being looked at: recursion comes back to it then.
    depths: BTreeMap<u32, Option<Depth>>,
    /// Defects, in words.
    pub unclear: Vec<String>,
}

impl<'a> Stack<'a> {
    /// Initial state: nothing looked at yet.
    pub fn new(program: &'a Program, targets: &'a dyn Fn(&str) -> Option<Vec<String>>) -> Self {
        Self { program, targets, depths: BTreeMap::new(), unclear: Vec::new() }
    }

    /// The deepest path from a function on, by its name.
    pub fn of(&mut self, name: &str) -> Depth {
        match self.program.address(name) {
            Some(address) => self.at(address),
            None => {
                self.unclear.push(format!("{name} is not linked"));
                Depth::default()
            }
        }
    }

    /// The deepest path from the only function on whose name has `part` in it.
    pub fn of_containing(&mut self, part: &str) -> Depth {
        match self.program.named(|name| name.contains(part)).as_slice() {
            [name] => self.of(name),
            names => {
                self.unclear.push(format!("{part} is {} functions", names.len()));
                Depth::default()
            }
        }
    }

    /// The deepest path from an address on.
    pub fn at(&mut self, address: u32) -> Depth {
        let Some((start, size, name)) = self.program.containing(address) else {
            self.unclear.push(format!("{address:#010x} is in no function"));
            return Depth::default();
        };
        match self.depths.get(&start) {
            Some(Some(depth)) => return depth.clone(),
            Some(None) => {
                self.unclear.push(format!("{name} comes back to itself"));
                return Depth::default();
            }
            None => {}
        }
        if ["rust_begin_unwind", "9panicking", "panic_already", "6faults10reset_with"]
            .iter()
            .any(|end| name.contains(end))
        {
            return Depth::default();
        }
        self.depths.insert(start, None);
        let name = name.to_owned();
        let body = self.body(start, size, &name);
        let mut calls = body.calls;
        if let Some(framed) = body.through_register {
            match (self.targets)(&name) {
                None => self.unclear.push(format!("{name} calls through a register")),
                Some(targets) => {
                    for target in targets {
                        match self.program.address(&target) {
                            Some(address) => calls.push((address, framed)),
                            None => self.unclear.push(format!("{name} calls {target}, which is not linked")),
                        }
                    }
                }
            }
        }
        let mut deepest = Depth { bytes: body.frame, path: vec![(name.clone(), body.frame)] };
        calls.sort_unstable();
        calls.dedup();
        for (target, framed) in calls {
            let below = self.at(target);
            let own = if framed { body.frame } else { 0 };
            if own + below.bytes > deepest.bytes {
                let path = std::iter::once((name.clone(), own)).chain(below.path).collect();
                deepest = Depth { bytes: own + below.bytes, path };
            }
        }
        self.depths.insert(start, Some(deepest.clone()));
        deepest
    }

    fn body(&mut self, start: u32, size: u32, name: &str) -> Body {
        let (mut body, mut at) = (Body::default(), start);
        let mut registers = Registers::default();
        while at < start + size {
            if !self.program.is_code(at) {
                at += 2;
                continue;
            }
            let Some(first) = self.program.half(at) else { break };
            let wide = first >> 11 >= 0b11101;
            let second = if wide { self.program.half(at + 2).unwrap_or(0) } else { 0 };
            let (taken, computed) = if wide { wide_frame(first, second) } else { narrow_frame(first) };
            body.frame += taken;
            if computed {
                self.unclear.push(format!("{name}: the stack pointer is computed at {at:#010x}"));
            }
            let flow = if wide { wide_flow(first, second, at) } else { narrow(first, at) };
            match flow {
                Flow::To(target) if (start..start + size).contains(&target) => {}
                Flow::To(target) => body.calls.push((target, wide && second & 0xd000 == 0xd000)),
                Flow::Unknown => {
                    let framed = first & 0xff80 == 0x4780;
                    if registers.called(first).is_some_and(|target| self.program.containing(target).is_some()) {
                        let targets = registers.loaded(first);
                        let targets = targets.filter(|target| self.program.containing(*target).is_some());
                        body.calls.extend(targets.map(|target| (target, framed)));
                    } else {
                        body.through_register = Some(framed || body.through_register.unwrap_or(false));
                    }
                }
                Flow::Next | Flow::Trap => {}
            }
            let word = |address| Some(self.program.half(address)? | self.program.half(address + 2)? << 16);
            registers.follow(first, second, at, word);
            at += if wide { 4 } else { 2 };
        }
        body
    }
}

/// Bytes that an instruction takes from the stack, and whether it sets the stack pointer to what only the running
/// program knows.
fn narrow_frame(word: u32) -> (u32, bool) {
    match word {
        // push
        _ if word & 0xfe00 == 0xb400 => (4 * (word & 0x1ff).count_ones(), false),
        // sub sp, #
        _ if word & 0xff80 == 0xb080 => (4 * (word & 0x7f), false),
        // mov sp, r7 and mov sp, r4 give frames back, or align one that is taken already: at most 7 bytes more, which
        // an exception's frame has room for.
        _ => (0, false),
    }
}

/// Counterpart of [`narrow_frame`].
fn wide_frame(first: u32, second: u32) -> (u32, bool) {
    match first {
        // stmdb sp!
        0xe92d => (4 * second.count_ones(), false),
        // str r, [sp, #-x]! and strd
        0xf84d if second & 0x0f00 == 0x0d00 => (second & 0xff, false),
        0xe96d => (4 * (second & 0xff), false),
        // vpush
        _ if first & 0xffbf == 0xed2d => (4 * (second & 0xff), false),
        // sub.w sp, sp, #
        _ if first & 0xfbef == 0xf1ad && second & 0x8f00 == 0x0d00 => (modified(first, second), false),
        // subw sp, sp, #
        _ if first & 0xfbff == 0xf2ad && second & 0x8f00 == 0x0d00 => {
            ((first >> 10 & 1) << 11 | (second >> 12 & 7) << 8 | second & 0xff, false)
        }
        // sub.w sp, sp, r
        0xebad if second & 0x0f00 == 0x0d00 => (0, true),
        _ => (0, false),
    }
}

/// A constant of the Thumb instruction set (ARM DDI 0403, A5.3.2).
fn modified(first: u32, second: u32) -> u32 {
    let (selector, byte) = ((first >> 10 & 1) << 11 | (second >> 12 & 7) << 8 | second & 0xff, second & 0xff);
    match selector >> 8 {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        3 => byte * 0x0101_0101,
        _ => (0x80 | byte & 0x7f).rotate_right(selector >> 7),
    }
}
