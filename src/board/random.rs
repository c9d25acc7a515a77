//! True random numbers, for challenges: the chip's generator (RM0440, chapter 26) on the 48 MHz oscillator; thread
//! mode.

use embassy_stm32::pac;
use friction_compensation::parameters::authentication::CHALLENGE;

/// Reads until a bit is set, at most: the oscillator takes 4 us, a word some 10 us.
const TRIES: u32 = 10_000;

/// Random bytes; none where the generator finds its noise or its clock wanting.
#[inline(never)]
pub fn bytes() -> Option<[u8; CHALLENGE]> {
    let (clocks, generator) = (pac::RCC, pac::RNG);
    clocks.crrcr().modify(|w| w.set_hsi48on(true));
    clocks.ahb2enr().modify(|w| w.set_rngen(true));
    generator.cr().modify(|w| w.set_rngen(true));
    let drawn = draw();
    // Flags of errors stay until they are cleared: the next one begins anew.
    generator.sr().write_value(Default::default());
    generator.cr().modify(|w| w.set_rngen(false));
    clocks.ahb2enr().modify(|w| w.set_rngen(false));
    clocks.crrcr().modify(|w| w.set_hsi48on(false));
    drawn
}

fn draw() -> Option<[u8; CHALLENGE]> {
    let mut bytes = [0; CHALLENGE];
    for place in bytes.chunks_exact_mut(4) {
        let ready = (0..TRIES).any(|_| pac::RNG.sr().read().drdy());
        let status = pac::RNG.sr().read();
        let word = pac::RNG.dr().read();
        // 0 stands for no number (26.7.3).
        if !ready || status.seis() || status.ceis() || word == 0 {
            return None;
        }
        place.iter_mut().zip(word.to_le_bytes()).for_each(|(place, byte)| *place = byte);
    }
    Some(bytes)
}
