//! State of the exceptions, pending, enabled and active, and the one that comes next: the NVIC and what the system
//! exceptions share with it.
//!
//! ARM DDI 0403, B1.5.2 to B1.5.4 (priorities), B3.4 (NVIC). Priorities have the four bits of an STM32G4 (RM0440,
//! 14.1).

/// Numbers of the exceptions; interrupt n is `EXTERNAL` + n.
pub(super) const NMI: u16 = 2;
pub(super) const HARD_FAULT: u16 = 3;
pub(super) const MEMORY_FAULT: u16 = 4;
pub(super) const BUS_FAULT: u16 = 5;
pub(super) const USAGE_FAULT: u16 = 6;
pub(super) const SUPERVISOR_CALL: u16 = 11;
pub(super) const PENDING_SERVICE: u16 = 14;
pub(super) const SYSTICK: u16 = 15;
pub(super) const EXTERNAL: u16 = 16;

/// Lower than every priority that can be set.
const THREAD: i16 = 256;
/// The bits of a priority that exist.
const IMPLEMENTED: u8 = 0xf0;

#[derive(Clone)]
pub(super) struct Interrupts {
    pub enabled: [u32; 4],
    pending: [u32; 4],
    active: [u32; 4],
    lines: [u32; 4],
    nmi_line: bool,
    priorities: [u8; 128],
    /// Priorities by number of the exception, as are the bits of the two below.
    system_priorities: [u8; 16],
    pub system_pending: u32,
    pub system_active: u32,
    /// AIRCR.PRIGROUP.
    group: u32,
    pub primask: bool,
    pub faultmask: bool,
    pub basepri: u8,
    /// The most urgent of what is pending and enabled, and its group priority; what `update` keeps.
    best: Option<(i16, u16)>,
    /// Priority of what runs.
    current: i16,
}

impl Interrupts {
    pub fn new() -> Self {
        Self {
            enabled: [0; 4],
            pending: [0; 4],
            active: [0; 4],
            lines: [0; 4],
            nmi_line: false,
            priorities: [0; 128],
            system_priorities: [0; 16],
            system_pending: 0,
            system_active: 0,
            group: 0,
            primask: false,
            faultmask: false,
            basepri: 0,
            best: None,
            current: THREAD,
        }
    }

    /// Priority that is set for an exception; smaller is more urgent.
    fn priority(&self, number: u16) -> i16 {
        match number {
            NMI => -2,
            HARD_FAULT => -1,
            0..EXTERNAL => i16::from(self.system_priorities[usize::from(number)]),
            _ => i16::from(self.priorities[usize::from(number - EXTERNAL) & 127]),
        }
    }

    /// The part of a priority that decides over preemption.
    fn preemption(&self, priority: i16) -> i16 {
        if priority < 0 { priority } else { priority & !((2i16 << self.group) - 1) }
    }

    /// Recomputes what follows from the rest; to be called after every change.
    pub fn update(&mut self) {
        let pending = std::array::from_fn(|word| self.enabled[word] & self.pending[word]);
        let best = self.most_urgent(self.system_pending, pending);
        self.best = best.map(|(priority, number)| (self.preemption(priority), number));
        self.current = self.priority_of_execution(true);
    }

    /// The most urgent of the exceptions whose bits are set, the lowest number of several, with its priority.
    fn most_urgent(&self, system: u32, external: [u32; 4]) -> Option<(i16, u16)> {
        let mut best: Option<(i16, u16)> = None;
        let mut look = |mut word: u32, base: u16| {
            while word != 0 {
                let number = base + word.trailing_zeros() as u16;
                word &= word - 1;
                let priority = self.priority(number);
                if best.is_none_or(|(most, _)| priority < most) {
                    best = Some((priority, number));
                }
            }
        };
        look(system, 0);
        if external != [0; 4] {
            (0..).zip(external).for_each(|(place, word)| look(word, EXTERNAL + 32 * place));
        }
        best
    }

    /// ExecutionPriority (B1.5.4). Of priorities in order, their parts that preempt are in order too.
    fn priority_of_execution(&self, with_primask: bool) -> i16 {
        let active = self.most_urgent(self.system_active, self.active);
        let mut least = active.map_or(THREAD, |(priority, _)| self.preemption(priority));
        if self.basepri != 0 {
            least = least.min(self.preemption(i16::from(self.basepri)));
        }
        if self.primask && with_primask {
            least = least.min(0);
        }
        if self.faultmask { least.min(-1) } else { least }
    }

    /// Priority of what runs.
    pub fn current(&self) -> i16 {
        self.current
    }

    /// The exception to take now, if any.
    #[inline(always)]
    pub fn takeable(&self) -> Option<u16> {
        let (priority, number) = self.best?;
        (priority < self.current).then_some(number)
    }

    /// Returns `true` if something wakes the core from WFI: what could be taken if PRIMASK were clear (B1.5.19).
    pub fn would_wake(&self) -> bool {
        self.best.is_some_and(|(priority, _)| priority < self.priority_of_execution(false))
    }

    /// Returns `true` if an exception of this number could be taken now.
    pub fn would_take(&self, number: u16) -> bool {
        self.preemption(self.priority(number)) < self.current
    }

    pub fn pend(&mut self, number: u16) {
        match number {
            0..EXTERNAL => self.system_pending |= 1 << number,
            _ => {
                let (word, bit) = place(number);
                self.pending[word] |= bit;
            }
        }
        self.update();
    }

    /// New levels of the lines; true where something became pending. A line pends its interrupt when it rises, and as
    /// long as it is high and the handler does not run (B3.4.1).
    pub fn set_lines(&mut self, lines: [u32; 4], nmi: bool) -> bool {
        if lines == self.lines && nmi == self.nmi_line && (lines == [0; 4] || !self.refresh_pending()) {
            return false;
        }
        let mut changed = nmi && !self.nmi_line;
        if changed {
            self.system_pending |= 1 << NMI;
        }
        for (word, &level) in lines.iter().enumerate() {
            let pending = self.pending[word] | level & !self.lines[word] | level & !self.active[word];
            changed |= pending != self.pending[word];
            self.pending[word] = pending;
        }
        (self.lines, self.nmi_line) = (lines, nmi);
        self.update();
        changed
    }

    /// Returns `true` if a line that is high is to pend its interrupt again.
    fn refresh_pending(&self) -> bool {
        (0..4).any(|word| self.lines[word] & !self.active[word] & !self.pending[word] != 0)
    }

    /// The handler of `number` begins.
    pub fn activate(&mut self, number: u16) {
        match number {
            0..EXTERNAL => {
                self.system_pending &= !(1 << number);
                self.system_active |= 1 << number;
            }
            _ => {
                let (word, bit) = place(number);
                self.pending[word] &= !bit;
                self.active[word] |= bit;
            }
        }
        self.update();
    }

    /// The handler of `number` has returned. A line that is still high pends its interrupt again.
    pub fn deactivate(&mut self, number: u16) {
        match number {
            0..EXTERNAL => self.system_active &= !(1 << number),
            _ => {
                let (word, bit) = place(number);
                self.active[word] &= !bit;
                self.pending[word] |= self.lines[word] & bit;
            }
        }
        if number != NMI {
            self.faultmask = false;
        }
        self.update();
    }

    pub fn is_active(&self, number: u16) -> bool {
        match number {
            0..EXTERNAL => self.system_active >> number & 1 != 0,
            _ => {
                let (word, bit) = place(number);
                self.active[word] & bit != 0
            }
        }
    }

    /// Number of handlers that have begun and not returned.
    pub fn active_count(&self) -> u32 {
        self.system_active.count_ones() + self.active.iter().map(|word| word.count_ones()).sum::<u32>()
    }

    /// The exception that comes next once priorities allow it (ICSR.VECTPENDING), and whether an interrupt is pending.
    pub fn next(&self) -> (u16, bool) {
        let external = (0..4).any(|word| self.enabled[word] & self.pending[word] != 0);
        (self.best.map_or(0, |(_, number)| number), external)
    }

    pub fn set_group(&mut self, group: u32) {
        self.group = group & 7;
        self.update();
    }

    pub fn group(&self) -> u32 {
        self.group
    }

    /// SHPR1 to SHPR3, four priorities a word.
    pub fn system_priority_word(&self, word: usize) -> u32 {
        word_of(&self.system_priorities, 4 * word + 4)
    }

    pub fn set_system_priority(&mut self, number: usize, priority: u8) {
        if let Some(place) = self.system_priorities.get_mut(number) {
            *place = priority & IMPLEMENTED;
        }
        self.update();
    }

    /// An NVIC register, by its offset from 0xe000_e000 (B3.4.3).
    pub fn read(&self, offset: u32) -> Option<u32> {
        let word = (offset / 4) as usize & 3;
        Some(match offset {
            0x100..0x110 | 0x180..0x190 => self.enabled[word],
            0x200..0x210 | 0x280..0x290 => self.pending[word],
            0x300..0x310 => self.active[word],
            // Of interrupts that the architecture has and this core has not.
            0x480..0x600 => 0,
            0x400..0x480 => word_of(&self.priorities, (offset - 0x400) as usize),
            _ => return None,
        })
    }

    /// Sets an NVIC register; false where there is none.
    pub fn write(&mut self, offset: u32, value: u32) -> bool {
        let word = (offset / 4) as usize & 3;
        match offset {
            0x100..0x110 => self.enabled[word] |= value,
            0x180..0x190 => self.enabled[word] &= !value,
            0x200..0x210 => self.pending[word] |= value,
            // A line that is high and whose handler does not run pends again at once.
            0x280..0x290 => self.pending[word] &= !value | self.lines[word] & !self.active[word],
            _ => return false,
        }
        self.update();
        true
    }

    /// Sets the priority of interrupt `interrupt`.
    pub fn set_priority(&mut self, interrupt: usize, priority: u8) {
        if let Some(place) = self.priorities.get_mut(interrupt) {
            *place = priority & IMPLEMENTED;
        }
        self.update();
    }
}

fn place(number: u16) -> (usize, u32) {
    let interrupt = number - EXTERNAL;
    (usize::from(interrupt / 32) & 3, 1 << (interrupt % 32))
}

fn word_of(bytes: &[u8], at: usize) -> u32 {
    (0..4).fold(0, |word, i| word | u32::from(bytes.get(at + i).copied().unwrap_or(0)) << (8 * i))
}
