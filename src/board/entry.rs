//! First code of the program: priorities, clocks, the two executors; thread mode.

use crate::tasks;
use defmt_rtt as _;
use embassy_executor::{Executor, InterruptExecutor};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::{Peripherals, pac};
use static_cell::StaticCell;

/// Runs the tasks that must not wait for the slow ones. Its interrupt is one that the boards do not use otherwise:
/// clock recovery for USB.
static MEDIUM: InterruptExecutor = InterruptExecutor::new();

#[interrupt]
unsafe fn CRS() {
    // SAFETY: called from the interrupt that the executor was started with, and from nowhere else.
    unsafe { MEDIUM.on_interrupt() }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    super::memory::load_control_code();
    super::bridge_off();
    lower_all_priorities();
    let peripherals = start_chip();
    static SLOW: StaticCell<Executor> = StaticCell::new();
    SLOW.init(Executor::new()).run(|slow| {
        interrupt::CRS.set_priority(Priority::P8);
        tasks::start(slow, || MEDIUM.start(interrupt::CRS), peripherals);
    })
}

/// The regulator's range 1 in normal mode, PWR_CR5 bit 8 (RM0440, 6.4.23: R1MODE): enough for 150 MHz. Cleared, it is
/// in boost mode.
const R1MODE: u32 = 1 << 8;

/// embassy's set-up at the 16 MHz that the chip starts with, then the board's clocks.
///
/// Between them the regulator is switched to boost mode, which 170 MHz need (RM0440, 6.1.5). embassy's own switch has
/// no effect: stm32-metapac 21 has R1MODE at bit 0. Before the first step it would be lost, because that resets PWR.
fn start_chip() -> Peripherals {
    let mut configuration = super::chip_configuration();
    configuration.rcc.hsi48 = None;
    let mut peripherals = embassy_stm32::init(configuration);
    pac::PWR.cr5().modify(|w| w.0 &= !R1MODE);
    super::start_clocks(&mut peripherals);
    peripherals
}

/// Every interrupt starts at the highest priority, which is the control interrupt's alone: a driver that enables one
/// before it is given another would break the critical sections.
fn lower_all_priorities() {
    // SAFETY: no interrupt is enabled yet; all registers of the NVIC's priorities exist, or read as zero and ignore
    // writes.
    let core = unsafe { cortex_m::Peripherals::steal() };
    for priority in &core.NVIC.ipr {
        // SAFETY: as above.
        unsafe { priority.write(Priority::P6 as u8) };
    }
}
