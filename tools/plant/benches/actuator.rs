//! Prints what a period of the virtual actuator costs, driven, coasting and with a broken lead: `cargo bench -p plant
//! --bench actuator`.

use plant::actuator::{Fault, Phase};
use plant::{Actuator, ActuatorParameters};
use std::time::Instant;

const PERIODS: u32 = 400_000;

fn main() {
    let open = Some(Fault::PhaseOpen(Phase::A));
    for (name, rate, switching, fault) in [
        ("driven", 20e3, true, None),
        ("driven", 40e3, true, None),
        ("bridge off, coasting", 20e3, false, None),
        ("driven with an open phase", 20e3, true, open),
    ] {
        let mut actuator = Actuator::new(ActuatorParameters::reference(), 25.0, 1).expect("the reference is valid");
        fault.into_iter().for_each(|fault| actuator.inject(fault).expect("no number to be out of range"));
        let mut seen = 0_u64;
        let start = Instant::now();
        for n in 0..PERIODS {
            let sample = actuator.measure();
            seen = seen.wrapping_add(u64::from(sample.encoder));
            let phase = 5e-4 * f64::from(n);
            let duties = [0.0, 2.1, 4.2].map(|shift: f64| 0.5 + 0.05 * (phase + shift).sin());
            actuator.advance(switching, duties, 8.0, 1.0 / rate);
        }
        let seconds = start.elapsed().as_secs_f64();
        let period = 1e9 * seconds / f64::from(PERIODS);
        let factor = f64::from(PERIODS) / rate / seconds;
        println!("{name} at {:.0} kHz: {period:.0} ns a period, {factor:.0} x real time ({seen:x})", rate / 1e3);
    }
}
