//! DRV8353S gate driver on its bus: configuration with read-back, fault status, clearing; thread mode and the interrupt
//! executor, never the control interrupt. What the registers mean: [`drv8353`].

use embassy_stm32::gpio::Output;
use embassy_stm32::mode::Blocking;
use embassy_stm32::spi::Spi;
use embassy_stm32::spi::mode::Master;
use joint_firmware::hardware::Setup;
use joint_firmware::hardware::drv8353::{self, AMPLIFIERS, CALIBRATE, CLEAR_FAULTS, CONTROL, MOTEUS_R4_11, SILENCE};

/// Number and content of the registers that are written.
const REGISTERS: [(u16, u16); 6] = MOTEUS_R4_11.registers();

/// The driver on its bus.
pub struct Drv8353 {
    /// Mode 1, 1 MHz: at 2 MHz the vendor saw errors.
    pub spi: Spi<'static, Blocking, Master>,
    /// Chip select, low while a frame runs.
    pub select: Output<'static>,
}

impl Drv8353 {
    /// Answer to a word; silence where the bus itself fails.
    fn frame(&mut self, word: u16) -> u16 {
        let mut words = [word];
        self.select.set_low();
        let result = self.spi.blocking_transfer_in_place(&mut words);
        self.select.set_high();
        // At least 400 ns between frames.
        cortex_m::asm::delay(170);
        result.map_or(SILENCE, |()| words[0] & SILENCE)
    }

    fn write(&mut self, register: u16, content: u16) {
        self.frame(register << 11 | content);
    }

    fn read(&mut self, register: u16) -> u16 {
        self.frame(1 << 15 | register << 11)
    }

    /// Both fault status words.
    pub fn status(&mut self) -> [u16; 2] {
        [0, 1].map(|register| self.read(register))
    }

    /// Clears faults; what is still wrong comes back.
    pub fn clear(&mut self) {
        let (_, control) = REGISTERS[0];
        self.write(CONTROL, control | CLEAR_FAULTS);
    }

    /// Checks that the registers hold what they were configured with.
    ///
    /// # Errors
    /// The driver is silent, or one does not.
    pub fn verify(&mut self) -> Result<(), Setup> {
        // Of these four none is all zeros or all ones, in whatever state a driver is that answers.
        let answers = [2, 3, 4, 5].map(|register| self.read(register));
        if answers.iter().all(|answer| matches!(*answer, 0 | SILENCE)) {
            return Err(Setup::NoAnswer);
        }
        match REGISTERS.iter().all(|(register, content)| self.read(*register) == *content) {
            true => Ok(()),
            false => Err(Setup::NotConfigured),
        }
    }

    /// Writes every register, lets the amplifiers find their zero, reads every register back. The driver must have been
    /// enabled for 1 ms, and the bridge be off.
    ///
    /// # Errors
    /// Those of [`Drv8353::verify`].
    pub fn configure(&mut self) -> Result<(), Setup> {
        for (register, content) in REGISTERS {
            self.write(register, content);
        }
        let (_, amplifiers) = REGISTERS[usize::from(AMPLIFIERS - drv8353::CONTROL)];
        self.write(AMPLIFIERS, amplifiers | CALIBRATE);
        // 100 µs are enough (SLVSDY6); twice as much, as the vendor waits.
        cortex_m::asm::delay(200 * 170);
        self.write(AMPLIFIERS, amplifiers);
        self.verify()
    }
}
