//! Deflection of pre-sliding elements along a recording: the twin of the firmware's Maxwell-slip elements in f64; host.

use crate::friction_model::Bent;
use crate::samples::Samples;

/// Deflection of the elements of these stiffnesses (1/rad or 1/m) after each sample. Every run begins at rest: nobody
/// recorded what was before.
pub fn bent(samples: &Samples, stiffness: &[f64]) -> Vec<Bent> {
    let mut elements = Bent::default();
    let period = samples.period();
    let step = |i: usize| {
        let begins = i == 0 || samples.run[i] != samples.run[i - 1];
        if begins {
            elements = Bent::default();
        }
        let time = if begins { period } else { samples.time[i] - samples.time[i - 1] };
        for (element, stiffness) in elements.iter_mut().zip(stiffness) {
            *element = drag(*element, stiffness * samples.velocity[i] * time);
        }
        elements
    };
    (0..samples.len()).map(step).collect()
}

/// An element after a way, in parts of its distance; at rest where the way is not known.
fn drag(bent: f64, way: f64) -> f64 {
    if way.is_finite() { (bent + way).clamp(-1.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_bend_to_their_end_and_back_and_each_run_begins_at_rest() {
        let samples = Samples {
            time: vec![0.0, 0.1, 0.2, 0.3, 0.0, 0.1],
            velocity: vec![1.0, 1.0, 1.0, -1.0, 1.0, 0.0],
            run: vec![0, 0, 0, 0, 1, 1],
            ..Samples::default()
        };
        let bent: Vec<f64> = bent(&samples, &[4.0]).into_iter().map(|elements| elements[0]).collect();
        let want = [0.4, 0.8, 1.0, 0.6, 0.4, 0.4];
        assert!(bent.iter().zip(want).all(|(found, want)| (found - want).abs() < 1e-12), "{bent:?}");
    }
}
