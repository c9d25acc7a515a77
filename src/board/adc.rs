//! Injected conversions: set up at start, read in the control interrupt.
//!
//! All converters run on the same clock, the bus clock divided by four (42.5 MHz), start from the same trigger, and
//! sample the currents for the same time: conversions that run at the same time but not in step disturb each other
//! (ES0430 2.7.11). RM0440, 21.4.

use super::StartError;
use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::adc::vals::{Adcaldif, Exten, SampleTime};
use embassy_stm32::pac::adccommon::AdcCommon;
use embassy_stm32::pac::adccommon::vals::Ckmode;

/// Largest code, 12 bits.
pub const FULL_SCALE: f32 = 4095.0;

/// One injected sequence.
pub struct Sequence<'a> {
    /// The converter.
    pub adc: Adc,
    /// Its channels in order, at most four, each with its sampling time.
    pub channels: &'a [(u8, SampleTime)],
    /// Number of the trigger (RM0440, tables 166 and 167).
    pub trigger: u8,
    /// `true` if the end of the sequence is the control interrupt.
    pub interrupt: bool,
}

/// Chooses the common clock of a group of converters; before any of them is enabled.
pub fn choose_clock(common: AdcCommon) {
    common.ccr().modify(|w| w.set_ckmode(Ckmode::SYNC_DIV4));
}

/// Waits until `done`, for 10 ms at most.
fn wait(done: impl Fn() -> bool) -> Result<(), StartError> {
    for _ in 0..1_000 {
        if done() {
            return Ok(());
        }
        cortex_m::asm::delay(1_700);
    }
    Err(StartError::Converter)
}

impl Sequence<'_> {
    /// Powers, calibrates and enables the converter, and arms the sequence. RM0440, 21.4.6 to 21.4.9.
    pub fn arm(&self) -> Result<(), StartError> {
        let adc = self.adc;
        adc.cr().modify(|w| w.set_deeppwd(false));
        adc.cr().modify(|w| w.set_advregen(true));
        // The regulator takes 20 µs.
        cortex_m::asm::delay(20 * 170);
        adc.cr().modify(|w| w.set_adcaldif(Adcaldif::SINGLE_ENDED));
        adc.cr().modify(|w| w.set_adcal(true));
        wait(|| !adc.cr().read().adcal())?;
        // Four converter clocks between the end of the calibration and the enabling.
        cortex_m::asm::delay(64);
        adc.isr().write(|w| w.set_adrdy(true));
        adc.cr().modify(|w| w.set_aden(true));
        wait(|| adc.isr().read().adrdy())?;
        for &(channel, time) in self.channels {
            match channel {
                0..=9 => adc.smpr().modify(|w| w.set_smp(channel.into(), time)),
                _ => adc.smpr2().modify(|w| w.set_smp(usize::from(channel.min(18)) - 10, time)),
            }
        }
        // Without the queue: the sequence stays armed as written.
        adc.cfgr().modify(|w| w.set_jqdis(true));
        adc.jsqr().write(|w| {
            w.set_jl(self.channels.len() as u8 - 1);
            w.set_jextsel(self.trigger);
            w.set_jexten(Exten::RISING_EDGE);
            for (rank, &(channel, _)) in (0..4).zip(self.channels) {
                w.set_jsq(rank, channel);
            }
        });
        adc.isr().write(|w| w.set_jeos(true));
        adc.ier().modify(|w| w.set_jeosie(self.interrupt));
        adc.cr().modify(|w| w.set_jadstart(true));
        Ok(())
    }
}

/// Code of a rank of the last sequence; `RANK` from 0 to 3.
#[inline(always)]
pub fn code<const RANK: usize>(adc: Adc) -> u16 {
    adc.jdr(RANK).read().jdata()
}

/// Returns `true` if a sequence has ended since [`acknowledge`].
#[inline(always)]
pub fn ended(adc: Adc) -> bool {
    adc.isr().read().jeos()
}

/// Takes the end of the sequence.
#[inline(always)]
pub fn acknowledge(adc: Adc) {
    adc.isr().write(|w| {
        w.set_jeos(true);
        w.set_jeoc(true);
    });
}
