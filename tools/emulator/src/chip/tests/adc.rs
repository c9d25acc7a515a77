//! ADC and OPAMP: RM0440, chapters 21 and 25.

use super::super::variant;
use super::*;

const ADC1: u32 = 0x5000_0000;
const ADC2: u32 = 0x5000_0100;
const COMMON: u32 = 0x5000_0300;
const OPAMP: u32 = 0x4001_0300;
const TIM2: u32 = 0x4000_0000;

const ADVREGEN: u32 = 1 << 28;

fn bench() -> Bench {
    let mut bench = Bench::fast();
    bench.set(RCC + 0x58, 1 << 28 | 1);
    bench.set(RCC + 0x60, 1);
    bench.set(RCC + 0x4c, 0x7f | 1 << 13);
    bench.set(COMMON + 0x08, 3 << 16);
    bench
}

/// 21.4.6 to 21.4.9, as the firmware does it.
fn enable(bench: &mut Bench, adc: u32) {
    bench.set(adc + 0x08, 0);
    bench.set(adc + 0x08, ADVREGEN);
    bench.pass_us(20);
    bench.set(adc + 0x08, ADVREGEN | 1 << 31);
    bench.until(adc + 0x08, 1 << 31, 0);
    bench.pass(64);
    bench.set(adc, 1);
    bench.set(adc + 0x08, ADVREGEN | 1);
    bench.until(adc, 1, 1);
}

/// Channels with 12.5 clocks each, on the rising edge of TIM2_TRGO.
fn arm(bench: &mut Bench, adc: u32, channels: &[u32]) {
    bench.set(adc + 0x14, 0x1249_2492);
    bench.set(adc + 0x18, 0x0249_2492);
    let ranks: u32 = channels.iter().zip(0..).map(|(channel, rank)| channel << (9 + 6 * rank)).sum();
    bench.set(adc + 0x4c, ranks | 1 << 7 | 2 << 2 | (channels.len() as u32 - 1));
    bench.set(adc, 0x60);
    bench.set(adc + 0x08, ADVREGEN | 1 | 1 << 3);
}

/// TIM2's OC4REF rises one count before a top of 1000, centre-aligned: as the firmware of the moteus r4.
fn trigger(bench: &mut Bench) -> u64 {
    bench.set(TIM2, 2 << 5);
    bench.set(TIM2 + 0x2c, 1_000);
    bench.set(TIM2 + 0x1c, 0x7000);
    bench.set(TIM2 + 0x40, 999);
    bench.set(TIM2 + 0x04, 7 << 4);
    bench.set(TIM2, 1 | 2 << 5);
    bench.now + 999
}

#[test]
fn a_sequence_starts_with_the_trigger_and_holds_its_samples_at_known_instants() {
    let mut bench = bench();
    enable(&mut bench, ADC2);
    bench.set(ADC2 + 0x04, 1 << 6);
    arm(&mut bench, ADC2, &[17, 5]);
    bench.board().volts.extend([(Pin::new('A', 4), 1.65), (Pin::new('C', 4), 3.3)]);
    let edge = trigger(&mut bench);
    bench.pass(1_300);
    assert!(bench.line(18), "ADC1_2");
    assert_eq!(bench.get(ADC2 + 0x80), 2_048);
    assert_eq!(bench.get(ADC2 + 0x84), 4_095, "the highest code");
    let at = |cycle: u64| bench.chip.instant(cycle);
    // The latency of 13 cycles, 12.5 clocks of 4 cycles, then every 25 clocks.
    let expected = [(at(edge + 13 + 50), Pin::new('A', 4)), (at(edge + 13 + 100 + 50), Pin::new('C', 4))];
    assert_eq!(bench.chip.wiring().sampled, expected);
    bench.set(ADC2, 0x60);
    assert!(!bench.line(18));
}

#[test]
fn a_source_of_10_kohm_takes_longer_than_12_5_clocks_to_charge_the_capacitor() {
    // SMPR of all channels: 12.5 clocks as in `arm`, 47.5 clocks.
    let coded = |sampling: Option<u32>| {
        let mut bench = bench();
        enable(&mut bench, ADC2);
        bench.board().resistance = 10e3;
        bench.board().volts.insert(Pin::new('A', 4), 1.65);
        arm(&mut bench, ADC2, &[17]);
        if let Some(sampling) = sampling {
            bench.set(ADC2 + 0x08, ADVREGEN | 1 | 1 << 5);
            bench.set(ADC2 + 0x18, sampling << 21);
            bench.set(ADC2 + 0x08, ADVREGEN | 1 | 1 << 3);
        }
        trigger(&mut bench);
        bench.pass(1_900);
        bench.get(ADC2 + 0x80)
    };
    // 12.5 clocks are 5.35 time constants of 55 ns.
    assert_eq!(coded(None), 2_038);
    assert_eq!(coded(Some(3)), 2_047);
}

#[test]
fn the_end_of_a_sequence_comes_25_clocks_a_conversion_after_the_trigger() {
    let mut bench = bench();
    enable(&mut bench, ADC2);
    bench.set(ADC2 + 0x04, 1 << 6);
    arm(&mut bench, ADC2, &[17, 5]);
    let edge = trigger(&mut bench);
    bench.pass(edge - bench.now + 13 + 199);
    assert!(!bench.line(18));
    bench.pass(1);
    assert!(bench.line(18));
}

#[test]
fn both_converters_start_from_the_same_edge_once_a_period() {
    let mut bench = bench();
    for adc in [ADC1, ADC2] {
        enable(&mut bench, adc);
        arm(&mut bench, adc, &[1]);
    }
    trigger(&mut bench);
    bench.pass(20_000 + 500);
    let sampled = &bench.chip.wiring().sampled;
    assert_eq!(sampled.len(), 2 * 10, "one rising edge a period of 2000 cycles");
    assert!(sampled.chunks(2).all(|pair| pair[0].0 == pair[1].0));
}

#[test]
fn calibration_takes_116_clocks() {
    let mut bench = bench();
    bench.set(ADC1 + 0x08, 0);
    bench.set(ADC1 + 0x08, ADVREGEN);
    bench.pass_us(20);
    bench.set(ADC1 + 0x08, ADVREGEN | 1 << 31);
    let cycles = bench.until(ADC1 + 0x08, 1 << 31, 0);
    assert!(cycles.abs_diff(116 * 4) <= 2, "{cycles}");
}

#[test]
fn steps_out_of_order_stop_the_run() {
    let mut bench = bench();
    assert!(bench.refused(ADC1 + 0x08, 1 << 31).contains("a calibration without the regulator"), "deep power-down");
    bench.set(ADC1 + 0x08, 0);
    bench.set(ADC1 + 0x08, ADVREGEN);
    bench.pass_us(19);
    assert!(bench.refused(ADC1 + 0x08, ADVREGEN | 1 << 31).contains("20 µs"));
    bench.pass_us(2);
    bench.set(ADC1 + 0x08, ADVREGEN | 1 << 31);
    bench.until(ADC1 + 0x08, 1 << 31, 0);
    assert!(bench.refused(ADC1 + 0x08, ADVREGEN | 1).contains("less than four clocks after a calibration"));
    bench.pass(16);
    bench.set(ADC1 + 0x08, ADVREGEN | 1);
    assert!(bench.refused(ADC1 + 0x08, ADVREGEN | 9).contains("before the converter is ready"));
    assert!(bench.refused(COMMON + 0x08, 1 << 16).contains("while a converter is on"));
}

#[test]
fn a_sequence_of_what_cannot_be_measured_stops_the_run() {
    let mut bench = bench();
    enable(&mut bench, ADC1);
    let mut armed = |sequence: u32| {
        bench.set(ADC1 + 0x4c, sequence);
        bench.refused(ADC1 + 0x08, ADVREGEN | 9)
    };
    let trigger = 1 << 7 | 2 << 2;
    assert!(armed(trigger | 16 << 9).starts_with("ADC1_JSQR: channel 16"), "the temperature sensor");
    assert!(armed(trigger | 13 << 9).contains("amplifier 1 is off"));
    assert!(armed(1 << 7 | 3 << 2 | 1 << 9).contains("a trigger other than"));
    assert!(armed(1 << 9).contains("a trigger other than"), "by software");
    bench.set(0x4800_0000, 0xabff_fffc);
    bench.set(ADC1 + 0x4c, trigger | 1 << 9);
    assert!(bench.refused(ADC1 + 0x08, ADVREGEN | 9).contains("PA0 is not in analog mode"));
}

#[test]
fn an_amplifier_with_bias_gives_its_gain_to_the_converter() {
    let mut bench = bench();
    // Gain 16 with VINM0, into the converter.
    bench.set(OPAMP, 1 | 2 << 5 | 1 << 7 | 1 << 8 | 0b01011 << 14);
    enable(&mut bench, ADC1);
    arm(&mut bench, ADC1, &[13]);
    bench.board().volts.extend([(Pin::new('A', 1), 0.1), (Pin::new('A', 3), 0.01)]);
    trigger(&mut bench);
    bench.pass(2_000);
    let expected = (16.0 * 0.1 - 15.0 * 0.01) / 3.3 * 4096.0;
    assert_eq!(bench.get(ADC1 + 0x80), expected as u32);
    bench.board().volts.insert(Pin::new('A', 1), 1.0);
    bench.pass(2_000);
    assert_eq!(bench.get(ADC1 + 0x80), 4_095, "and no more than the supply");
}

#[test]
fn a_follower_gives_its_input() {
    let mut bench = bench();
    bench.set(OPAMP + 0x04, 1 | 3 << 5 | 1 << 8);
    enable(&mut bench, ADC2);
    arm(&mut bench, ADC2, &[16]);
    bench.board().volts.insert(Pin::new('A', 7), 0.825);
    trigger(&mut bench);
    bench.pass(2_000);
    assert_eq!(bench.get(ADC2 + 0x80), 1_024);
}

#[test]
fn other_configurations_of_an_amplifier_are_refused() {
    let mut bench = bench();
    assert!(bench.refused(OPAMP, 1 | 1 << 8).starts_with("OPAMP_OPAMP1_CSR"), "standalone");
    assert!(bench.refused(OPAMP, 1 | 2 << 5).contains("running amplifier"), "output at the pin");
    assert!(bench.refused(OPAMP, 1 | 2 << 5 | 1 << 8 | 0b10011 << 14).contains("running amplifier"), "filter");
    assert!(bench.unread(OPAMP + 0x0c).contains("OPAMP: register at 0x00c"), "OPAMP4");
}

#[test]
fn three_converters_of_the_larger_chip_answer_one_trigger() {
    let mut bench = Bench::new(&variant::STM32G474CE);
    bench.speed_up();
    bench.set(RCC + 0x58, 1 << 28 | 1);
    bench.set(RCC + 0x4c, 0x7f | 3 << 13);
    bench.set(COMMON + 0x08, 3 << 16);
    bench.set(0x5000_0708, 3 << 16);
    for (adc, channel) in [(ADC1, 12), (0x5000_0400, 12), (0x5000_0600, 2)] {
        enable(&mut bench, adc);
        arm(&mut bench, adc, &[channel]);
    }
    trigger(&mut bench);
    bench.pass(1_500);
    let pins: Vec<_> = bench.chip.wiring().sampled.iter().map(|(_, pin)| *pin).collect();
    assert_eq!(pins, [Pin::new('B', 1), Pin::new('B', 0), Pin::new('A', 9)]);
}
