//! FDCAN1 at 1 Mbit/s with classic frames: the receive interrupt, and the queues between it and the task below.
//!
//! Work that has to be quick happens in the interrupt, second in priority to the control interrupt alone: NMT, SYNC,
//! RPDOs, and the synchronous TPDOs. For the task it leaves what is addressed to this node's SDO server, and LSS.
//!
//! embassy's driver sets the controller up: clock, pins, bit timing, message RAM, filters. Its interrupt handler is not
//! used, because frames would wait in its channel until a task runs; this one reads the controller's FIFO itself, in
//! order. What is sent waits in a [`TransmitQueue`]; the controller's three buffers are a FIFO, not a queue: segments
//! of one SDO block have one identifier, and a queue would send those by place.
//!
//! Filters are masks: embassy 0.6.0 has the bounds of its range filter swapped.

use super::control;
use super::shared::Publisher;
use canopen_node::{Buffers, Frame, PDOS, Receiver, Route, TransmitQueue, bit_timing};
use core::cell::{Cell, RefCell, UnsafeCell};
use core::mem::MaybeUninit;
use core::num::{NonZeroU8, NonZeroU16};
use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::peripheral::NVIC;
use critical_section::Mutex;
use embassy_stm32::can::config::{GlobalFilter, NominalBitTiming, NonMatchingFilter, TxBufferMode};
use embassy_stm32::can::filter::{Action, FilterType, StandardFilter, StandardFilterSlot};
use embassy_stm32::can::{CanConfigurator, IT0InterruptHandler, IT1InterruptHandler, RxPin, TxPin};
use embassy_stm32::interrupt::typelevel::{Binding, FDCAN1_IT0, FDCAN1_IT1};
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::pac::can::regs::Txbar;
use embassy_stm32::peripherals::FDCAN1;
use embassy_stm32::{Peri, interrupt, pac};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embassy_time::Instant;
use joint_firmware::joint::Demand;
use joint_firmware::joint::configuration::CollisionReaction;
use joint_firmware::joint::configuration::LOADS;
use joint_firmware::objects::{JointImage, Observed};

/// The bus's timing ([`bit_timing`]) as the driver takes it. Said here, because embassy would compute it while the
/// program runs, from ten quanta at most, and bring the text of an error that cannot happen.
const BIT_TIMING: NominalBitTiming = NominalBitTiming {
    prescaler: NonZeroU16::MIN,
    seg1: NonZeroU8::new(bit_timing::BUS.before_sample()).unwrap(),
    seg2: NonZeroU8::new(bit_timing::BUS.phase2).unwrap(),
    sync_jump_width: NonZeroU8::new(bit_timing::BUS.jump_width).unwrap(),
};
/// Segments of a downloaded block.
pub const BLOCK: u8 = 24;
/// Frames that wait for the task: a block, the request behind it, and LSS.
const TO_TASK: usize = BLOCK as usize + 4;
/// Frames that wait for the controller, beside the three that it holds.
const TO_BUS: usize = 16;
/// Places of these that the task leaves to what the receive interrupt sends: the TPDOs.
const RESERVED: usize = PDOS;
/// Elements of a receive FIFO, and of the transmit FIFO (RM0440, message RAM).
const FIFO: u8 = 3;
/// Ranges of identifiers with which nobody addresses a joint, as value and mask: answers of SDO servers and LSS slaves.
/// PDOs may not have them (CiA 301, restricted CAN-IDs).
const IGNORED: [(u16, u16); 2] = [(0x580, 0x780), (0x7E4, 0x7FF)];

/// Feedforward of the load, bits of Nm: the task's, for the receive interrupt.
static LOAD: AtomicU32 = AtomicU32::new(0);

/// Reaction to a collision, by its number, that the receive interrupt has not seen yet: the task's. Zero is none.
static COLLISION: AtomicU32 = AtomicU32::new(0);

/// State that the receive interrupt owns.
struct Bus {
    shared: &'static canopen_node::Shared,
    receiver: Receiver<'static>,
    image: JointImage<'static>,
    demand: Publisher<Demand>,
    feedforward: f32,
}

struct Owned(UnsafeCell<MaybeUninit<Bus>>);
// SAFETY: written once before the interrupt is enabled, afterwards used by that interrupt alone.
unsafe impl Sync for Owned {}
static BUS: Owned = Owned(UnsafeCell::new(MaybeUninit::uninit()));

static RECEIVED: Channel<CriticalSectionRawMutex, Frame, TO_TASK> = Channel::new();
static SENDING: Mutex<RefCell<TransmitQueue<TO_BUS>>> = Mutex::new(RefCell::new(TransmitQueue::new()));
/// Observation of the joint for the slower tasks.
static OBSERVED: Mutex<Cell<Option<Observed>>> = Mutex::new(Cell::new(None));

/// Frames that were not taken, since the start.
struct Drops {
    controller: AtomicU32,
    task: AtomicU32,
}
static DROPS: Drops = Drops { controller: AtomicU32::new(0), task: AtomicU32::new(0) };

/// Frames that found no room, since the start; each wraps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub struct Dropped {
    /// Frames dropped in the controller: the interrupt came too late.
    pub controller: u32,
    /// Frames dropped on the way to the task.
    pub task: u32,
    /// Frames dropped on the way to the bus.
    pub bus: u32,
    /// TPDOs and heartbeats that newer ones replaced on the way to the bus.
    pub overwritten: u32,
}

/// Fault confinement state of the controller (ISO 11898-1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum Condition {
    /// All is well, or nearly.
    Active,
    /// Many errors: it may not disturb others any more.
    Passive,
    /// Too many errors: it takes no part.
    Off,
}

/// Says that the interrupts are handled. The first by this module; the second is never raised, as everything is on line
/// 0.
#[derive(Clone, Copy)]
struct Handled;
// SAFETY: the handler below serves the interrupt.
unsafe impl Binding<FDCAN1_IT0, IT0InterruptHandler<FDCAN1>> for Handled {}
// SAFETY: no interrupt source is routed to line 1, and it is masked before the controller starts.
unsafe impl Binding<FDCAN1_IT1, IT1InterruptHandler<FDCAN1>> for Handled {}

/// The controller with its pins, stopped.
pub fn configure(
    can: Peri<'static, FDCAN1>,
    receive: Peri<'static, impl RxPin<FDCAN1>>,
    transmit: Peri<'static, impl TxPin<FDCAN1>>,
) -> CanConfigurator<'static> {
    let mut controller = CanConfigurator::new(can, receive, transmit, Handled);
    interrupt::FDCAN1_IT0.disable();
    interrupt::FDCAN1_IT1.disable();
    let filter = GlobalFilter {
        handle_standard_frames: NonMatchingFilter::IntoRxFifo0,
        handle_extended_frames: NonMatchingFilter::Reject,
        reject_remote_standard_frames: true,
        reject_remote_extended_frames: true,
    };
    let config = controller
        .config()
        .set_nominal_bit_timing(BIT_TIMING)
        .set_global_filter(filter)
        .set_tx_buffer_mode(TxBufferMode::Fifo)
        .set_automatic_bus_off_recovery(false);
    controller.set_config(config);
    for ((filter, mask), slot) in IGNORED.into_iter().zip(0u8..) {
        let filter = StandardFilter { filter: FilterType::BitMask { filter, mask }, action: Action::Reject };
        controller.properties().set_standard_filter(StandardFilterSlot::from(slot), filter);
    }
    controller
}

/// Takes part in the bus from now on. Called once.
pub fn start(
    controller: CanConfigurator<'static>,
    shared: &'static canopen_node::Shared,
    image: JointImage<'static>,
    demand: Publisher<Demand>,
) {
    let bus = Bus { shared, receiver: Receiver::new(shared), image, demand, feedforward: 0.0 };
    // SAFETY: the interrupt is masked, and this runs once: there is one publisher of demands.
    unsafe { (*BUS.0.get()).write(bus) };
    // Dropped, the driver would reset the controller.
    core::mem::forget(controller.into_normal_mode());
    pac::FDCAN1.ie().modify(|w| w.set_rfle(0, true));
    interrupt::FDCAN1_IT0.set_priority(Priority::P4);
    // SAFETY: the handler's state is complete.
    unsafe { interrupt::FDCAN1_IT0.enable() };
}

/// Has the interrupt run: a transition of the task's, or a set-point that came by SDO, reaches the joint.
pub fn attend() {
    NVIC::pend(pac::Interrupt::FDCAN1_IT0);
}

/// Has the joint's commands carry this feedforward of the load from now on, Nm.
pub fn bear(load: f32) {
    if LOADS && LOAD.load(Ordering::Relaxed) != load.to_bits() {
        LOAD.store(load.to_bits(), Ordering::Relaxed);
        attend();
    }
}

/// Has the joint react to a collision.
pub fn collide(reaction: CollisionReaction) {
    if LOADS {
        COLLISION.store(reaction as u32, Ordering::Relaxed);
        attend();
    }
}

/// Sets what TPDOs carry of the joint from now on; the control step's part is taken from its own report.
pub fn observe(observed: &Observed) {
    critical_section::with(|section| OBSERVED.borrow(section).set(Some(*observed)));
}

/// Observation given to [`observe`], with the newest control step.
pub fn observed() -> Option<Observed> {
    let mut observed = critical_section::with(|section| OBSERVED.borrow(section).get())?;
    if let Some(report) = control::report() {
        (observed.telemetry, observed.latched) = (report.telemetry, report.latched);
    }
    Some(observed)
}

/// The next frame for the task.
pub async fn next() -> Frame {
    RECEIVED.receive().await
}

/// Sends a frame of the node `shared`; where the queue is full it is dropped and counted.
pub fn send(frame: Frame, shared: &canopen_node::Shared) {
    let now = now();
    critical_section::with(|section| {
        let mut sending = SENDING.borrow_ref_mut(section);
        // The queue counts what it drops.
        let _ = sending.push(frame, shared.is_renewable(&frame), now);
        transmit(&mut sending, now);
    });
}

/// Returns `true` if [`send`] has room for another frame of the task's.
pub fn has_room() -> bool {
    critical_section::with(|section| SENDING.borrow_ref(section).room() > RESERVED)
}

/// Time as the node counts it, µs; wraps.
pub fn now() -> u32 {
    Instant::now().as_micros() as u32
}

/// Frames dropped so far.
pub fn dropped() -> Dropped {
    let [controller, task] = [&DROPS.controller, &DROPS.task].map(|count| count.load(Ordering::Relaxed));
    let (bus, overwritten) = critical_section::with(|section| {
        let sending = SENDING.borrow_ref(section);
        (sending.dropped(), sending.overwritten())
    });
    Dropped { controller, task, bus, overwritten }
}

/// Fault confinement state of the controller.
pub fn condition() -> Condition {
    let status = pac::FDCAN1.psr().read();
    match (status.bo(), status.ep()) {
        (true, _) => Condition::Off,
        (false, true) => Condition::Passive,
        (false, false) => Condition::Active,
    }
}

/// Begins to return from bus-off: the controller takes part again once it has seen the bus idle for 129 times 11 bits.
pub fn recover() {
    pac::FDCAN1.cccr().modify(|w| w.set_init(false));
}

fn count(counter: &AtomicU32) {
    counter.store(counter.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
}

/// First word of the message RAM, and words from there to the first element of receive FIFO 0 and of the transmit FIFO;
/// an element has 18 words (RM0440, message RAM).
const RECEIVE: usize = 0xB0 / 4;
const TRANSMIT: usize = 0x278 / 4;
const ELEMENT: usize = 18;
/// Identifier in the first word of an element, number of bytes in the second.
const ID: u32 = 18;
const LENGTH: u32 = 16;

fn element(first: usize, number: u8) -> *mut u32 {
    let ram: *mut u32 = pac::FDCANRAM1.as_ptr().cast();
    // In the message RAM for every number of an element, which is a field of two bits.
    ram.wrapping_add(first + ELEMENT * usize::from(number % FIFO))
}

/// The oldest received frame; none where there is none.
fn receive() -> Option<Frame> {
    let can = pac::FDCAN1;
    let status = can.rxfs(0).read();
    if status.ffl() == 0 {
        return None;
    }
    let place = element(RECEIVE, status.fgi());
    // SAFETY: four words of an element of the message RAM, which is the reader's until it is acknowledged.
    let [identifier, length, low, high] = unsafe {
        [
            place.read_volatile(),
            place.wrapping_add(1).read_volatile(),
            place.wrapping_add(2).read_volatile(),
            place.wrapping_add(3).read_volatile(),
        ]
    };
    can.rxfa(0).write(|w| w.set_fai(status.fgi()));
    let data = (u64::from(low) | u64::from(high) << 32).to_le_bytes();
    // A classic frame's length code may be more than 8 and means 8 then.
    let length = ((length >> LENGTH & 0xF) as usize).min(data.len());
    Frame::new((identifier >> ID & 0x7FF) as u16, data.get(..length)?)
}

/// Hands frames to the controller as long as it takes them.
fn transmit(sending: &mut TransmitQueue<TO_BUS>, now: u32) {
    let can = pac::FDCAN1;
    let all = usize::from(FIFO);
    // One turn for each buffer: each turn takes one of them.
    for _ in 0..all {
        let occupied = can.txbrp().read().0.count_ones() as usize;
        let Some(frame) = sending.pop(now, Buffers { all, occupied }).filter(|_| occupied < all) else { break };
        let number = can.txfqs().read().tfqpi();
        let place = element(TRANSMIT, number);
        let mut data = [0; 8];
        data.iter_mut().zip(frame.data()).for_each(|(place, byte)| *place = *byte);
        let data = u64::from_le_bytes(data);
        let words =
            [u32::from(frame.id()) << ID, (frame.data().len() as u32) << LENGTH, data as u32, (data >> 32) as u32];
        for (word, offset) in words.into_iter().zip(0..) {
            // SAFETY: four words of an element of the message RAM, which is the writer's until it is requested.
            unsafe { place.wrapping_add(offset).write_volatile(word) };
        }
        can.txbar().write_value(Txbar(1 << number));
    }
}

impl Bus {
    fn take(&mut self, frame: &Frame) {
        // An observation of the joint is much to copy, and TPDOs alone need it.
        let now = now();
        self.image.at(now);
        if self.receiver.is_sync(frame, now)
            && let Some(mut observed) = observed()
        {
            observed.feedforward_torque = self.feedforward;
            self.image.observe(&observed);
        }
        let shared = self.shared;
        match self.receiver.receive(frame, now, &mut self.image, |frame| send(frame, shared)) {
            Route::Server if RECEIVED.try_send(*frame).is_err() => count(&DROPS.task),
            Route::Server | Route::Done => {}
        }
    }
}

/// Line 0 of the controller: frames received, a frame sent, bus-off.
#[unsafe(no_mangle)]
extern "C" fn FDCAN1_IT0() {
    let can = pac::FDCAN1;
    let flags = can.ir().read();
    // Flags clear where a one is written. Frames that arrive from here on raise the interrupt again.
    can.ir().write_value(flags);
    // SAFETY: enabled only after `start` has written it; this handler does not nest.
    let bus = unsafe { (*BUS.0.get()).assume_init_mut() };
    if flags.rfl(0) {
        count(&DROPS.controller);
    }
    // A full FIFO, and as many that arrive meanwhile.
    for _ in 0..2 * FIFO {
        let Some(frame) = receive() else { break };
        bus.take(&frame);
    }
    let now = now();
    bus.image.at(now);
    bus.image.follow(bus.shared.state());
    if LOADS {
        let collision = COLLISION.load(Ordering::Relaxed);
        if collision != 0 {
            // The task does not interrupt this handler.
            COLLISION.store(0, Ordering::Relaxed);
            bus.image.collide(CollisionReaction::at(collision).unwrap_or_default());
        }
    }
    let mut demand = bus.image.demand();
    if LOADS {
        demand.command.bear(f32::from_bits(LOAD.load(Ordering::Relaxed)));
    }
    bus.feedforward = demand.command.torque;
    bus.demand.publish(&demand);
    // The joint knows: the rest can wait.
    bus.image.leave_copies();
    critical_section::with(|section| transmit(&mut SENDING.borrow_ref_mut(section), now));
}
