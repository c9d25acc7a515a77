//! The control interrupt: measure, one control step, set the bridge; the highest priority, every PWM period.
//!
//! It runs from CCM SRAM, uses no critical section, no log and no waker, and nothing else of the program touches its state
//! after [`start`]. What tasks have to know, or to tell it, goes through the atomics below.

use super::pwm::Timing;
use super::{Sensors, adc};
use crate::tasks::Joint;
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use cortex_m::peripheral::{DWT, NVIC};
use embassy_stm32::pac::Interrupt;
use joint_firmware::joint::{Bridge, BridgeState};

/// Everything that the control interrupt owns.
struct Control {
    sensors: Sensors,
    joint: Joint,
    /// The step before had not ended when this one should have begun.
    overrun: bool,
}

struct Owned(UnsafeCell<MaybeUninit<Control>>);
// SAFETY: written once before the interrupt is enabled, afterwards used by that interrupt alone.
unsafe impl Sync for Owned {}
static CONTROL: Owned = Owned(UnsafeCell::new(MaybeUninit::uninit()));

static STEPS: AtomicU32 = AtomicU32::new(0);
static LAST: AtomicU32 = AtomicU32::new(0);
static LONGEST: AtomicU32 = AtomicU32::new(0);
static LATE: AtomicU32 = AtomicU32::new(0);
static OVERRUNS: AtomicU32 = AtomicU32::new(0);
static SWITCHING: AtomicBool = AtomicBool::new(false);
static BRIDGE_FAULT: AtomicBool = AtomicBool::new(false);
/// Somebody wants the bridge off until the next reset.
static STOPPED: AtomicBool = AtomicBool::new(false);
static BRIDGE_TEMPERATURE: AtomicU32 = AtomicU32::new(f32::NAN.to_bits());
static WINDING_TEMPERATURE: AtomicU32 = AtomicU32::new(f32::NAN.to_bits());

/// What is known of the control steps since the start; a copy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub struct Statistics {
    /// Control steps; wraps.
    pub steps: u32,
    /// Core cycles of the last step, from the entry of the handler to its end.
    pub last_cycles: u32,
    /// Core cycles of the longest step.
    pub longest_cycles: u32,
    /// Steps whose duties took effect half a period late.
    pub late: u32,
    /// Steps that had not ended when the next one should have begun: a step is missing after each.
    pub overruns: u32,
    /// Whether the bridge switches.
    pub switching: bool,
    /// Whether the gate driver reports a fault.
    pub bridge_fault: bool,
    /// Whether [`stop`] was called.
    pub stopped: bool,
}

/// Statistics now.
pub fn statistics() -> Statistics {
    Statistics {
        steps: STEPS.load(Ordering::Relaxed),
        last_cycles: LAST.load(Ordering::Relaxed),
        longest_cycles: LONGEST.load(Ordering::Relaxed),
        late: LATE.load(Ordering::Relaxed),
        overruns: OVERRUNS.load(Ordering::Relaxed),
        switching: SWITCHING.load(Ordering::Relaxed),
        bridge_fault: BRIDGE_FAULT.load(Ordering::Relaxed),
        stopped: STOPPED.load(Ordering::Relaxed),
    }
}

/// Switches the bridge off from the next control step on, until the next reset. The joint sees a fault of the bridge.
pub fn stop() {
    STOPPED.store(true, Ordering::Relaxed);
}

/// Temperatures for the next control steps, °C; NaN where there is none.
pub fn set_temperatures(bridge: f32, winding: f32) {
    BRIDGE_TEMPERATURE.store(bridge.to_bits(), Ordering::Relaxed);
    WINDING_TEMPERATURE.store(winding.to_bits(), Ordering::Relaxed);
}

/// Hands sensors and joint to the control interrupt and enables it. Once: a second call would take the state from under it,
/// so it does nothing.
pub fn start(sensors: Sensors, joint: Joint) {
    static STARTED: AtomicBool = AtomicBool::new(false);
    if STARTED.swap(true, Ordering::AcqRel) {
        return;
    }
    // SAFETY: the interrupt is not enabled yet and this runs once.
    unsafe { (*CONTROL.0.get()).write(Control { sensors, joint, overrun: false }) };
    // SAFETY: thread mode at start; nothing else uses these registers of the core.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
    // SAFETY: the handler's state is complete, and `main` has loaded its code.
    unsafe {
        core.NVIC.set_priority(Interrupt::ADC1_2, 0);
        NVIC::unmask(Interrupt::ADC1_2);
    }
    super::start_pwm();
}

/// End of the injected sequence of the converter that has the interrupt.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".ccm.control")]
extern "C" fn ADC1_2() {
    let begin = DWT::cycle_count();
    adc::acknowledge(super::CONTROL_ADC);
    // SAFETY: enabled only after `start` has written it; this handler does not nest.
    let control = unsafe { (*CONTROL.0.get()).assume_init_mut() };
    let stopped = STOPPED.load(Ordering::Relaxed);

    let mut measurements = control.sensors.measure();
    BRIDGE_FAULT.store(measurements.bridge_fault, Ordering::Relaxed);
    measurements.bridge_fault |= stopped;
    measurements.overrun = control.overrun;
    measurements.bridge_temperature = f32::from_bits(BRIDGE_TEMPERATURE.load(Ordering::Relaxed));
    measurements.winding_temperature = f32::from_bits(WINDING_TEMPERATURE.load(Ordering::Relaxed));

    let wanted = control.joint.control_step(&measurements);
    let bridge = if stopped { Bridge::OFF } else { wanted };
    let timing = super::apply(&bridge);

    SWITCHING.store(bridge.state == BridgeState::Switching, Ordering::Relaxed);
    // Only this handler writes the counters, so load and store need no read-modify-write.
    let count = |counter: &AtomicU32, yes: bool| {
        counter.store(counter.load(Ordering::Relaxed).wrapping_add(yes.into()), Ordering::Relaxed);
    };
    count(&LATE, timing == Timing::Late);
    control.overrun = adc::ended(super::CONTROL_ADC);
    count(&OVERRUNS, control.overrun);
    count(&STEPS, true);
    let cycles = DWT::cycle_count().wrapping_sub(begin);
    LAST.store(cycles, Ordering::Relaxed);
    LONGEST.store(LONGEST.load(Ordering::Relaxed).max(cycles), Ordering::Relaxed);
}
