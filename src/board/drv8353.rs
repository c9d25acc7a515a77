//! DRV8353S gate driver: configuration over SPI with read-back; at start, in thread mode.
//!
//! Source: TI SLVSDY6, "Register maps". Frames of 16 bits, mode 1: bit 15 reads, bits 14 to 11 are the register, bits 10 to 0 the
//! data. Values are those of the vendor's firmware for this revision of the board.

use super::StartError;
use embassy_stm32::gpio::Output;
use embassy_stm32::mode::Blocking;
use embassy_stm32::spi::Spi;
use embassy_stm32::spi::mode::Master;

/// Register and content.
const REGISTERS: [(u16, u16); 6] = [
    // Driver control: a fault switches all half bridges off, three PWM inputs.
    (2, 1 << 10 | 0b01 << 5),
    // High-side gates: unlocked; 50 mA source and 100 mA sink: more damages boards from r4.8 on.
    (3, 0b011 << 8),
    // Low-side gates: faults clear cycle by cycle, 1,000 ns drive time, 50 mA and 100 mA.
    (4, 1 << 10 | 0b01 << 8),
    // Over-current: retry after 8 ms, which latched mode does not use; 200 ns dead time; latched; 4 µs deglitch; 500 mV.
    (5, 0b10 << 8 | 0b10 << 4 | 0b1000),
    // Amplifiers: reference halved (both directions), gain 20, over-current at 500 mV.
    (6, 1 << 9 | 0b10 << 6 | 0b01),
    // Calibration as on the DRV8323.
    (7, 1),
];
/// Amplifier control, and its bits that short the amplifiers' inputs for calibration.
const AMPLIFIERS: (u16, u16) = (6, 0b111 << 2);

/// The driver on its bus.
pub struct Drv8353<'a> {
    /// Mode 1, 1 MHz: at 2 MHz the vendor saw errors.
    pub spi: Spi<'a, Blocking, Master>,
    /// Chip select, low while a frame runs.
    pub select: Output<'a>,
}

impl Drv8353<'_> {
    fn frame(&mut self, word: u16) -> Result<u16, StartError> {
        let mut words = [word];
        self.select.set_low();
        let result = self.spi.blocking_transfer_in_place(&mut words);
        self.select.set_high();
        // At least 400 ns between frames.
        cortex_m::asm::delay(170);
        result.map(|()| words[0] & 0x7ff).map_err(|_| StartError::GateDriverBus)
    }

    fn write(&mut self, register: u16, content: u16) -> Result<(), StartError> {
        self.frame(register << 11 | content).map(|_| ())
    }

    fn read(&mut self, register: u16) -> Result<u16, StartError> {
        self.frame(1 << 15 | register << 11)
    }

    /// Writes every register, reads every one back, and lets the amplifiers find their zero. The driver must be enabled for 1 ms.
    pub fn configure(&mut self) -> Result<(), StartError> {
        for (register, content) in REGISTERS {
            self.write(register, content)?;
        }
        let (amplifiers, calibrate) = AMPLIFIERS;
        let content = self.read(amplifiers)?;
        self.write(amplifiers, content | calibrate)?;
        // 100 µs are enough (SLVSDY6); twice as much, as the vendor waits.
        cortex_m::asm::delay(200 * 170);
        self.write(amplifiers, content)?;
        for (register, written) in REGISTERS {
            let read = self.read(register)?;
            if read != written {
                return Err(StartError::GateDriver { register, written, read });
            }
        }
        Ok(())
    }
}
