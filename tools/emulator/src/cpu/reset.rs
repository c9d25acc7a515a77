//! A core as it is made and as reset leaves it (ARM DDI 0403, B1.5.5).

use super::code::Code;
use super::cycle_counter::CycleCounter;
use super::interrupts::Interrupts;
use super::system::System;
use super::system_timer::SystemTimer;
use super::{Cpu, decode, float};
use crate::bus::{Bus, Refusal, Width};
use std::collections::BTreeMap;

impl<B: Bus> Cpu<B> {
    /// A core that has not been reset yet.
    pub fn new(bus: B) -> Self {
        let code = Code::new(&bus);
        Self {
            bus,
            r: [0; 16],
            pc: 0,
            other_stack: 0,
            s: [0; 32],
            floating: float::Status::default(),
            negative: false,
            zero: false,
            carry: false,
            overflow: false,
            saturated: false,
            greater: 0,
            it: 0,
            thumb: true,
            exception: 0,
            unprivileged: false,
            process_stack: false,
            floating_used: false,
            floating_ready: false,
            event: false,
            exclusive: false,
            sleep: None,
            now: 0,
            slept: 0,
            instructions: 0,
            single: false,
            fetched: 0,
            attention: 0,
            until: 0,
            end: None,
            trapped_address: 0,
            code,
            within: Default::default(),
            decode: decode::decode,
            stall: None,
            interrupts: Interrupts::new(),
            system: System::default(),
            timer: SystemTimer::default(),
            counter: CycleCounter::default(),
            activations: Vec::new(),
            times: BTreeMap::new(),
            watch: None,
        }
    }

    /// Resets the core and starts it by the vector table at `vectors` (B1.5.5), which VTOR then holds: 0 on an STM32,
    /// where the memory that it boots from appears at 0. General registers, which reset leaves open, are 0. Time,
    /// counts and what was decoded stay; the bus is the caller's to reset. Fails where nothing answers at the
    /// vectors.
    pub fn reset(&mut self, vectors: u32) -> Result<(), Refusal> {
        let stack = self.bus.read(self.now, vectors, Width::Word)?;
        let start = self.bus.read(self.now, vectors.wrapping_add(4), Width::Word)?;
        (self.r, self.s, self.other_stack) = ([0; 16], [0; 32], 0);
        (self.r[13], self.r[14], self.pc) = (stack & !3, u32::MAX, start & !1);
        self.floating = float::Status::default();
        (self.negative, self.zero, self.carry, self.overflow, self.saturated) = (false, false, false, false, false);
        (self.greater, self.it, self.thumb, self.exception) = (0, 0, start & 1 != 0, 0);
        (self.unprivileged, self.process_stack, self.floating_used) = (false, false, false);
        (self.event, self.exclusive, self.sleep, self.single) = (false, false, None, false);
        self.interrupts = Interrupts::new();
        self.system = System::default();
        self.system.vectors = vectors;
        self.timer = SystemTimer::default();
        self.counter = CycleCounter::default();
        self.activations.clear();
        self.prepare_floating_point();
        self.code.enter(self.pc);
        self.read_signals();
        // A reset that the bus has told of is this one.
        (self.end, self.attention) = (None, 0);
        Ok(())
    }
}
