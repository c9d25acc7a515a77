//! The control interrupt: measure, one control step, set the bridge; the highest priority, every PWM period.
//!
//! It runs from CCM SRAM, uses no critical section, no log and no waker, and nothing else of the program touches its
//! state after [`start`]. What tasks have to know, or to tell it, goes through the exchanges and atomics below.

use super::shared::{InUse, Newest, Offering, Publisher, Replaced, Subscriber};
use super::{Sensors, adc};
use core::cell::{RefCell, UnsafeCell};
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use cortex_m::peripheral::{DWT, NVIC};
use critical_section::Mutex;
use embassy_stm32::pac::Interrupt;
use joint_firmware::joint::adaptation::{ADAPTS, Factors};
use joint_firmware::joint::fault::Faults;
use joint_firmware::joint::history::History;
use joint_firmware::joint::state_machine::Controlword;
use joint_firmware::joint::{Active, Bridge, BridgeState, Command, Coupled, Demand, Joint, Outputs, Slow, Telemetry};
use joint_firmware::motor::open_loop::Window;
use joint_firmware::motor::phases::Phases;

/// State that the control interrupt owns.
struct Control {
    sensors: Sensors,
    joint: Joint,
    ends: Ends,
    /// The step before had not ended when this one should have begun.
    overrun: bool,
    /// Demand on the joint while it is held off.
    off: Demand,
}

/// Commands of the tasks to the joint; each of the two has one owner.
pub struct Commands {
    /// Set-points and the controlword: the newest counts, from the next control step on; a set-point in the next round
    /// of the motion loop.
    pub demand: Publisher<Demand>,
    /// Configuration and friction model, prepared: swapped between two control steps.
    pub active: Offering<Active>,
    /// The open loop's last window.
    pub window: Subscriber<Window>,
}

/// The control interrupt's ends of the exchanges.
pub struct Ends {
    active: InUse<Active>,
    demand: Subscriber<Demand>,
    report: Publisher<Report>,
    window: Publisher<Window>,
}

struct Owned(UnsafeCell<MaybeUninit<Control>>);
// SAFETY: written once before the interrupt is enabled, afterwards used by that interrupt alone.
unsafe impl Sync for Owned {}
static CONTROL: Owned = Owned(UnsafeCell::new(MaybeUninit::uninit()));

/// Single words that control interrupt and tasks exchange; in one place, so that the interrupt needs one address.
struct Words {
    steps: AtomicU32,
    last_cycles: AtomicU32,
    longest_cycles: AtomicU32,
    overruns: AtomicU32,
    switching: AtomicBool,
    /// `true` if somebody wants the bridge off until the next reset.
    stopped: AtomicBool,
    bridge_temperature: Real,
    winding_temperature: Real,
    /// [`Slow`]; until the thermal model has spoken no current is permitted.
    derating: Real,
    gear_temperature: Real,
    /// [`Factors`].
    factor: Real,
    viscous: Real,
    mean_square_current: Real,
    /// The mean square current is taken anew in the next control step.
    mean_square_wanted: AtomicBool,
    /// The joint stays off, whatever it is commanded.
    held_off: AtomicBool,
}

/// A number in an atomic word.
struct Real(AtomicU32);

impl Real {
    const fn new(value: f32) -> Self {
        Self(AtomicU32::new(value.to_bits()))
    }

    #[inline(always)]
    fn load(&self, ordering: Ordering) -> f32 {
        f32::from_bits(self.0.load(ordering))
    }

    #[inline(always)]
    fn store(&self, value: f32, ordering: Ordering) {
        self.0.store(value.to_bits(), ordering);
    }
}

static WORDS: Words = Words {
    steps: AtomicU32::new(0),
    last_cycles: AtomicU32::new(0),
    longest_cycles: AtomicU32::new(0),
    overruns: AtomicU32::new(0),
    switching: AtomicBool::new(false),
    stopped: AtomicBool::new(false),
    bridge_temperature: Real::new(f32::NAN),
    winding_temperature: Real::new(f32::NAN),
    derating: Real::new(0.0),
    gear_temperature: Real::new(25.0),
    factor: Real::new(Factors::IMAGE.factor),
    viscous: Real::new(Factors::IMAGE.viscous),
    mean_square_current: Real::new(0.0),
    mean_square_wanted: AtomicBool::new(false),
    held_off: AtomicBool::new(false),
};

static ACTIVE: Replaced<Active> = Replaced::new();
static DEMAND: Newest<Demand> = Newest::new(NOBODY);
/// Demand before anybody commands.
const NOBODY: Demand = Demand {
    controlword: Controlword::DISABLE_VOLTAGE,
    command: Command::NOTHING,
    sequence: 0,
    coupled: Coupled { velocity: 0.0, sequence: 0 },
};
static REPORT: Newest<Report> = Newest::new(Report::NOTHING);
static WINDOW: Newest<Window> = Newest::new(Window::NOTHING);
/// Tasks of both executors read it, one at a time.
static READER: Mutex<RefCell<Option<Subscriber<Report>>>> = Mutex::new(RefCell::new(None));

/// Findings and actions of the joint in a control step: in one of each round of the motion loop, and in each in which
/// the bridge is off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// The step.
    pub telemetry: Telemetry,
    /// Faults since the last acknowledgement.
    pub latched: Faults,
    /// Phase currents as measured, A, offsets included: what a person looks at when a board is new.
    pub phase_currents: Phases,
}

impl Report {
    /// Report before the first step.
    const NOTHING: Self =
        Self { telemetry: Telemetry::NOTHING, latched: Faults::NONE, phase_currents: Phases::uniform(0.0) };
}

/// Statistics of the control steps since the start; a copy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub struct Statistics {
    /// Control steps; wraps.
    pub steps: u32,
    /// Core cycles of the last step, from the entry of the handler to its end.
    pub last_cycles: u32,
    /// Core cycles of the longest step.
    pub longest_cycles: u32,
    /// Steps that had not ended when the next one should have begun: a step is missing after each.
    pub overruns: u32,
    /// `true` while the bridge switches.
    pub switching: bool,
    /// `true` once [`stop`] was called.
    pub stopped: bool,
}

/// Statistics now.
pub fn statistics() -> Statistics {
    Statistics {
        steps: WORDS.steps.load(Ordering::Relaxed),
        last_cycles: WORDS.last_cycles.load(Ordering::Relaxed),
        longest_cycles: WORDS.longest_cycles.load(Ordering::Relaxed),
        overruns: WORDS.overruns.load(Ordering::Relaxed),
        switching: WORDS.switching.load(Ordering::Relaxed),
        stopped: WORDS.stopped.load(Ordering::Relaxed),
    }
}

/// Returns `true` once the control interrupt has been started.
pub fn is_enabled() -> bool {
    NVIC::is_enabled(Interrupt::ADC1_2)
}

/// Switches the bridge off from the next control step on, until the next reset. The joint sees a fault of the bridge.
pub fn stop() {
    WORDS.stopped.store(true, Ordering::Relaxed);
}

/// Holds the joint off before flash is written where it holds the program, too: the joint is off, and stays so until
/// [`release`]. False where it is under current; then nothing may be written. For the task that writes, and before the
/// control interrupt starts.
///
/// Code that the control interrupt runs only while operation is enabled may lie in flash on such a board: with this it
/// never waits for a write.
pub fn hold_off() -> bool {
    if !super::SINGLE_BANK || WORDS.held_off.load(Ordering::Relaxed) {
        return true;
    }
    if WORDS.switching.load(Ordering::Relaxed) {
        return false;
    }
    WORDS.held_off.store(true, Ordering::Release);
    // If the joint was enabled in the last step, the next one disables it. Without control steps the watchdog ends
    // this.
    let (runs, before) = (is_enabled(), WORDS.steps.load(Ordering::Relaxed));
    while runs && WORDS.steps.load(Ordering::Acquire) == before {
        core::hint::spin_loop();
    }
    true
}

/// Ends the hold after the last write: the joint does again what it is commanded.
pub fn release() {
    WORDS.held_off.store(false, Ordering::Release);
}

/// Temperatures for the next control steps, °C; NaN where there is none.
pub fn set_temperatures(bridge: f32, winding: f32) {
    WORDS.bridge_temperature.store(bridge, Ordering::Relaxed);
    WORDS.winding_temperature.store(winding, Ordering::Relaxed);
}

/// Thermal model's result for the next control steps: part of the current that is permitted, and °C of the gear.
pub fn set_thermal(derating: f32, gear_temperature: f32) {
    WORDS.derating.store(derating, Ordering::Relaxed);
    WORDS.gear_temperature.store(gear_temperature, Ordering::Relaxed);
}

/// Adaptation's result for the next control steps. One of them may see the factor and not yet the viscous friction:
/// each is sound by itself.
pub fn set_factors(factors: &Factors) {
    WORDS.factor.store(factors.factor, Ordering::Relaxed);
    WORDS.viscous.store(factors.viscous, Ordering::Relaxed);
}

/// Mean square of the current between the two calls before this one, A²; for one task only.
pub fn mean_square_current() -> f32 {
    let taken = WORDS.mean_square_current.load(Ordering::Acquire);
    WORDS.mean_square_wanted.store(true, Ordering::Release);
    taken
}

/// The newest control step's report; none before the first.
pub fn report() -> Option<Report> {
    // A step takes some cycles.
    if WORDS.longest_cycles.load(Ordering::Acquire) == 0 {
        return None;
    }
    critical_section::with(|section| Some(*READER.borrow_ref_mut(section).as_mut()?.newest()))
}

/// Reads the steps before a fault; none while no fault is latched. A control step that is due meanwhile waits: the
/// bridge is off then.
pub fn history<R>(read: impl FnOnce(&History) -> R) -> Option<R> {
    report().filter(|report| !report.latched.is_empty())?;
    cortex_m::interrupt::free(|_| {
        // SAFETY: there was a control step, so it is written, and the interrupt that owns it cannot come between.
        let history = unsafe { (*CONTROL.0.get()).assume_init_ref() }.joint.history();
        history.is_frozen().then(|| read(history))
    })
}

/// Both ends of what tasks and control interrupt exchange; none from the second call on.
pub fn exchange() -> Option<(Commands, Ends)> {
    let (offering, active) = ACTIVE.split()?;
    let (publisher, demand) = DEMAND.split()?;
    let (report, reader) = REPORT.split()?;
    critical_section::with(|section| READER.replace(section, Some(reader)));
    let (window, windows) = WINDOW.split()?;
    let commands = Commands { demand: publisher, active: offering, window: windows };
    let ends = Ends { active, demand, report, window };
    Some((commands, ends))
}

/// Makes the joint, hands it and the sensors to the control interrupt and enables that. Until a configuration is
/// offered to [`Commands::active`] there is no control step, and the bridge stays off.
#[inline(never)]
pub fn start(sensors: Sensors, ends: Ends) {
    let control = Control { sensors, joint: Joint::new(), ends, overrun: false, off: NOBODY };
    // SAFETY: the interrupt is not enabled yet, and this runs once: there is one pair of ends.
    unsafe { (*CONTROL.0.get()).write(control) };
    // SAFETY: thread mode at start; nothing else uses these registers of the core.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
    for interrupt in [Interrupt::ADC1_2, super::PWM_INTERRUPT] {
        // SAFETY: the handlers' state is complete, and `main` has loaded their code.
        unsafe {
            core.NVIC.set_priority(interrupt, 0);
            NVIC::unmask(interrupt);
        }
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
    let stopped = WORDS.stopped.load(Ordering::Relaxed);

    let mut measurements = control.sensors.measure();
    measurements.bridge_fault |= stopped;
    measurements.overrun = control.overrun;
    measurements.bridge_temperature = WORDS.bridge_temperature.load(Ordering::Relaxed);
    measurements.winding_temperature = WORDS.winding_temperature.load(Ordering::Relaxed);
    let slow = Slow {
        derating: WORDS.derating.load(Ordering::Relaxed),
        gear_temperature: WORDS.gear_temperature.load(Ordering::Relaxed),
        factors: match ADAPTS {
            true => {
                Factors { factor: WORDS.factor.load(Ordering::Relaxed), viscous: WORDS.viscous.load(Ordering::Relaxed) }
            }
            false => Factors::IMAGE,
        },
    };

    let demand = control.ends.demand.newest();
    let held_off = super::SINGLE_BANK && WORDS.held_off.load(Ordering::Acquire);
    let demand = if held_off { &control.off } else { demand };
    let wanted = match control.ends.active.current() {
        Some(active) if super::is_started() => control.joint.control_step(active, demand, &slow, &measurements),
        _ => {
            control.joint.skip_step();
            Bridge::OFF
        }
    };
    super::ask_reset(control.joint.waits_for_driver());
    let bridge = if stopped { Bridge::OFF } else { wanted };
    super::apply(&bridge);
    super::set_outputs(if stopped { Outputs::OFF } else { control.joint.outputs() });

    if control.joint.is_to_be_told() {
        control.ends.report.publish_in_place(|report| {
            control.joint.report(&mut report.telemetry);
            report.latched = control.joint.latched_faults();
            report.phase_currents = measurements.phase_currents;
        });
    }
    if WORDS.mean_square_wanted.load(Ordering::Acquire) {
        WORDS.mean_square_wanted.store(false, Ordering::Relaxed);
        WORDS.mean_square_current.store(control.joint.take_mean_square_current(), Ordering::Release);
    }
    if control.joint.has_new_window() {
        publish_window(&control.joint, &mut control.ends);
    }
    control.sensors.complete();
    WORDS.switching.store(bridge.state == BridgeState::Switching, Ordering::Relaxed);
    // Only this handler writes the counters, so load and store need no read-modify-write.
    let count = |counter: &AtomicU32, yes: bool| {
        counter.store(counter.load(Ordering::Relaxed).wrapping_add(yes.into()), Ordering::Relaxed);
    };
    // The vector table lies in flash: a step that waits for a write comes late, and controls nothing.
    control.overrun = adc::ended(super::CONTROL_ADC) && !held_off;
    count(&WORDS.overruns, control.overrun);
    count(&WORDS.steps, true);
    let cycles = DWT::cycle_count().wrapping_sub(begin);
    WORDS.last_cycles.store(cycles, Ordering::Relaxed);
    WORDS.longest_cycles.store(WORDS.longest_cycles.load(Ordering::Relaxed).max(cycles), Ordering::Relaxed);
}

/// While the bridge switches: it may lie in flash, as the open loop itself does.
#[inline(never)]
#[unsafe(link_section = ".text.open_loop")]
fn publish_window(joint: &Joint, ends: &mut Ends) {
    ends.window.publish(joint.window());
}
