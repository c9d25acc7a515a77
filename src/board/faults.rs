//! Panic, HardFault, NMI and unexpected interrupts: bridge off first, then the reason into RAM that survives, then
//! reset.
//!
//! None of this needs anything to be initialised: a fault may come before the first line of the program. On boards with
//! TIM1 a lock-up of the core (a fault within these handlers) clears the timer's outputs in hardware; elsewhere the
//! watchdog ends it.

use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr::{addr_of, addr_of_mut};
use core::sync::atomic::{AtomicU8, AtomicU32, Ordering};
use cortex_m::peripheral::SCB;
use embassy_stm32::pac;
use friction_compensation::parameters::ecc::{self, Decision, Storage};
use joint_firmware::objects::STORES;
use joint_firmware::reset_record::LastReset;
use joint_firmware::reset_record::{Cause, Record, WORDS};

/// The region PANIC of the board's memory: the startup code does not touch it.
#[unsafe(link_section = ".panic")]
static mut RECORD: MaybeUninit<[u32; WORDS]> = MaybeUninit::uninit();

/// Number of records that may still be written to flash: kept over a reset of the chip, which is how a master resets
/// the node.
#[unsafe(link_section = ".panic")]
static mut STORES_LEFT: MaybeUninit<u32> = MaybeUninit::uninit();

/// Configurable fault status register (ARM DDI 0403, B3.2.15).
const CFSR: *const u32 = 0xe000_ed28 as *const u32;

/// Tells the number of stores from memory that nothing has written.
const STORES_CHECK: u32 = 0x5354_4F00;

/// Words of the parameter slots that read with a double error: torn by a loss of power while they were written.
static TORN_WORDS: AtomicU32 = AtomicU32::new(0);

/// Causes of the chip's reset, [`LastReset::causes`](joint_firmware::reset_record::LastReset::causes).
static CAUSES: AtomicU8 = AtomicU8::new(0);

unsafe extern "C" {
    static __parameters_start: u8;
    static __parameters_end: u8;
    static _stack_start: u32;
    static _stack_end: u32;
}

fn words() -> [u32; WORDS] {
    // SAFETY: plain words, any value of which is valid; nothing but this module's functions uses them, and they do not
    // nest.
    unsafe { addr_of!(RECORD).cast::<[u32; WORDS]>().read_volatile() }
}

fn store(words: [u32; WORDS]) {
    // SAFETY: as in `words`.
    unsafe { addr_of_mut!(RECORD).cast::<[u32; WORDS]>().write_volatile(words) };
}

/// Keeps the record, counted up from the one before, and resets.
fn reset_with(record: Record) -> ! {
    store(record.after(Record::decode(&words()).as_ref()).encode());
    cortex_m::asm::dsb();
    SCB::sys_reset()
}

/// Logs why the program started and, where it stopped by itself, why; once, at start.
///
/// The record is kept until [`forget`], so that stops in a row are counted.
pub fn report() {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    let causes = (flags.0 >> 25) as u8;
    CAUSES.store(causes, Ordering::Relaxed);
    defmt::info!("start: reset by {=u8:#010b}, bits as in object 2301h:1", causes);
    if causes & LastReset::POWER != 0 {
        // Without power the record is noise, and where parity is checked reading it would be an error.
        store([0; WORDS]);
        keep_stores_left(STORES);
        return;
    }
    let Some(record) = Record::decode(&words()) else { return };
    if record.repeats == 0 {
        // The run before this one got over it.
        store([0; WORDS]);
        return;
    }
    let cause = match record.cause {
        Cause::Panic => defmt::intern!("panic"),
        Cause::HardFault => defmt::intern!("hard fault"),
        Cause::NonMaskable => defmt::intern!("non-maskable interrupt"),
        Cause::Unexpected => defmt::intern!("interrupt without a handler"),
    };
    defmt::error!(
        "stopped by {} at {:#010x}, {} in a row; detail and place are in object 2301h",
        cause,
        record.address,
        record.repeats
    );
}

/// Number of records that may be written: as before the reset, or as after power-up where a debugger has put another
/// program in the place of one that kept nothing. After [`report`].
pub fn stores_left() -> u8 {
    // SAFETY: a plain word, any value of which is valid; written by `keep_stores_left` alone, in the same context.
    let kept = unsafe { addr_of!(STORES_LEFT).cast::<u32>().read_volatile() };
    let left = kept ^ STORES_CHECK;
    if left < u32::from(STORES) { left as u8 } else { STORES }
}

/// Keeps it.
pub fn keep_stores_left(left: u8) {
    // SAFETY: as above.
    unsafe { addr_of_mut!(STORES_LEFT).cast::<u32>().write_volatile(u32::from(left) ^ STORES_CHECK) };
}

/// Last reset, as [`report`] has logged it.
#[inline(never)]
pub fn last_reset() -> LastReset {
    LastReset { causes: CAUSES.load(Ordering::Relaxed), stop: Record::decode(&words()) }
}

/// Starts the program anew, as a master asked for: bridge off first. Nothing is kept, as nothing went wrong.
pub fn restart() -> ! {
    super::bridge_off();
    store([0; WORDS]);
    cortex_m::asm::dsb();
    SCB::sys_reset()
}

/// Gets over the last stop: the program has run long enough since. It is there to be read up to the next start.
pub fn forget() {
    if let Some(record) = Record::decode(&words()) {
        store(record.forgotten().encode());
    }
}

/// Parameter words that were found torn since the start.
pub fn torn_words() -> u32 {
    TORN_WORDS.load(Ordering::Relaxed)
}

/// Inlined into what all panics end in: where the compiler sees the whole program, it finds that nobody reads their
/// messages, and leaves out what would format them, 1.7 KB.
#[panic_handler]
#[allow(
    unused_attributes,
    reason = "said to be ignored, because the handler is called from another crate; with fat optimisation it is not"
)]
#[inline(always)]
fn panic(info: &PanicInfo) -> ! {
    super::bridge_off();
    cortex_m::interrupt::disable();
    let record = match info.location() {
        Some(location) => Record::new(Cause::Panic, 0, location.line()).at(location.file()),
        None => Record::new(Cause::Panic, 0, 0),
    };
    reset_with(record)
}

/// Entry of a HardFault: hands the stacked registers over, and a fresh stack where the old one has overflowed.
#[unsafe(no_mangle)]
#[unsafe(naked)]
unsafe extern "C" fn HardFault() -> ! {
    core::arch::naked_asm!(
        "mov r0, sp",
        "ldr r1, ={lowest}",
        "cmp r0, r1",
        "bhs 2f",
        "ldr r1, ={highest}",
        "mov sp, r1",
        "movs r0, #0",
        "2:",
        "b {handler}",
        lowest = sym _stack_end,
        highest = sym _stack_start,
        handler = sym hard_fault,
    )
}

/// `frame`: r0 to r3, r12, lr, pc, xpsr as stacked by the core, or null.
extern "C" fn hard_fault(frame: *const u32) -> ! {
    super::bridge_off();
    cortex_m::interrupt::disable();
    // SAFETY: a frame above the stack's end lies in the stack; the program uses no other stack.
    let address = if frame.is_null() { 0 } else { unsafe { frame.add(6).read_volatile() } };
    // SAFETY: a register of the core that can always be read.
    let status = unsafe { CFSR.read_volatile() };
    reset_with(Record::new(Cause::HardFault, address, status))
}

/// Flash ECC, clock security or SRAM parity.
///
/// Reading a parameter word that a loss of power tore gives a double ECC error and so this interrupt. That is no reason
/// to stop: the bridge goes off until the next control step, the flag is cleared, and the reader of the double word
/// finds [`torn_words`] risen. What is that and what is fatal: [`ecc`]. The gate driver stays enabled: the slots are
/// read after it was configured, and disabled it would be of no use until the next start, which reads the same torn
/// word.
#[unsafe(no_mangle)]
extern "C" fn NonMaskableInt() {
    super::let_go();
    let status = pac::FLASH.eccr().read().0;
    let storage = Storage {
        flash: super::FLASH_START,
        bank: super::FLASH_BANK,
        parameters: addr_of!(__parameters_start) as u32..addr_of!(__parameters_end) as u32,
    };
    let address = match ecc::decide(status, &storage) {
        Decision::Resume { clear, .. } => {
            pac::FLASH.eccr().write(|w| w.0 = clear);
            TORN_WORDS.fetch_add(1, Ordering::Relaxed);
            return;
        }
        Decision::Fatal { address } => address,
    };
    super::bridge_off();
    cortex_m::interrupt::disable();
    reset_with(Record::new(Cause::NonMaskable, address, status))
}

/// Any interrupt that nobody handles.
#[unsafe(no_mangle)]
extern "C" fn DefaultHandler() -> ! {
    super::bridge_off();
    cortex_m::interrupt::disable();
    let number = SCB::vect_active();
    let number = match number {
        cortex_m::peripheral::scb::VectActive::ThreadMode => 0,
        cortex_m::peripheral::scb::VectActive::Exception(exception) => exception.irqn() as u32,
        cortex_m::peripheral::scb::VectActive::Interrupt { irqn } => u32::from(irqn) + 16,
    };
    reset_with(Record::new(Cause::Unexpected, 0, number))
}
