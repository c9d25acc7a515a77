//! Prints how long the default log of the reference joint takes: `cargo bench -p plant`.

use plant::excitation::Excitation;
use plant::record::USUAL_SAMPLE_PERIOD;
use plant::{JointParameters, record};
use std::time::Instant;

fn main() {
    let parameters = JointParameters::reference();
    let excitation = Excitation::for_joint(&parameters, 1).expect("the reference joint is valid");
    for seed in 0..5 {
        let start = Instant::now();
        let recording = record(&parameters, &excitation, seed, USUAL_SAMPLE_PERIOD).expect("all in range");
        let seconds = start.elapsed().as_secs_f64();
        println!("{} rows of {:.1} s in {seconds:.3} s", recording.log.len(), excitation.duration());
    }
}
