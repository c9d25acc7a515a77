//! docs/lagrangian-networks.md: its text, and the claims that the figures are held to.

use super::{BEYOND, CHOICE_SEEDS, DECAYED, FROM_LINKS, Known, OF_LINKS, Results, Row, Tried};
use comparison::lagrangian::{Activation, Inputs};

/// Names of the coefficients, with their units.
const COEFFICIENTS: [&str; 4] = ["f_v, A s/rad", "f_c+, A", "f_c-, A", "I_a, kg m^2"];
/// Most that DeLaN + NSCF may leave, mean over the seeds, over what weighted least squares do: with the gains known,
/// and with the URDF.
const MOST: [f64; 2] = [2.0, 1.1];
/// Most that rotor inertias of DeLaN + NSCF begun from the URDF may differ from those of least squares, part.
const ROTORS: f64 = 0.6;
/// Longest time of all trainings but the candidates', s.
const LONGEST: f64 = 600.0;

/// The page, to standard output.
pub fn write(results: &Results) {
    let Results { samples: [train, validation, test], weights: [weights, from_links], seconds, choosing, .. } = results;
    println!("# Lagrangian networks\n");
    println!(
        "Written by `cargo bench -p comparison --bench lagrangian`. Deep Lagrangian Networks with nonsymmetric Coulomb friction (002) beside\n\
         least squares, on the UR10e of [robot.md](robot.md): the same recordings, filter and samples, {train} to learn from, {validation} for early\n\
         stopping ({} for least squares), and {test} of another motion to be judged on. 002 has two UR5e, 400 s of motion to learn from and 60 s\n\
         to be judged on; here it is 90 s and 50 s.\n",
        train + validation
    );
    println!("## Method\n");
    println!(
        "- Mass matrix M = L L^T + offset (002 eq. 10) and potential energy by a network each; efforts by Euler-Lagrange (eq. 4).\n  \
         No kinematics are known.\n\
         - Linear layers of each joint: DeLaN has viscous and symmetric Coulomb friction, as in table I; DeLaN + NSCF has f_v, f_c+, f_c- and\n  \
         rotor inertia I_a (section III-A), Coulomb friction by tanh(100 v). {weights} weights in all.\n\
         - Efforts are currents: torques over the drive gains in `tools/jointctl/robots/ur10e.toml`, for networks and least squares alike.\n\
         - Adam with weight decay, squared errors of each joint over its effort's mean square; the weights of the epoch that is best on\n  \
         validation samples of the training motions.\n\
         - IDIM-LS: base parameters by least squares with viscous friction, Coulomb friction and offset, which span the same as f_v, f_c+\n  \
         and f_c-; ordinary, or weighted by the noise of each joint.\n\
         - Ours, not the paper's: biases do not decay, and a rotor inertia that is negative is taken to 0 after each step.\n\
         - {FROM_LINKS}: ours, for a user who has what least squares need, too. M = U U^T with an upper triangular U, whose row i\n  \
         depends on the positions after the i-th alone, as in every serial chain. Before the recording it learns from {} random states and\n  \
         efforts of the URDF's links, up to {BEYOND} rad beyond the recording's positions, without friction and rotors; from the recording the\n  \
         networks' outputs and the linear layers alone, and the outputs decay to what they were. {from_links} weights.\n",
        OF_LINKS[0],
    );
    choice(results);
    println!("## Errors on another motion\n");
    println!(
        "Mean square error of each joint's current, A^2 (002, table I), and the mean over the joints. Training: part of the 90 s, from the begin.\n"
    );
    println!("| training | model | 1 | 2 | 3 | 4 | 5 | 6 | mean |\n|---|---|---|---|---|---|---|---|---|");
    for Row { share, model, errors } in &results.rows {
        let cells: Vec<String> = errors.iter().map(|error| format!("{error:.5}")).collect();
        println!("| {share} % | {model} | {} | {:.5} |", cells.join(" | "), errors.mean());
    }
    let [gains, links] = [0, 1].map(|known| {
        let (low, high) = extremes(&results.seeds[known]);
        format!(
            "{low:.4} to {high:.4} | {:.2} | {:.4} | {:.2} |",
            behind(results, known),
            results.averaged[known].mean(),
            averaged(results, known)
        )
    });
    println!(
        "\nDeLaN + NSCF on all of the training motions with {} seeds; the table above has the first.\n",
        results.seeds[0].len()
    );
    println!(
        "| known | A^2, each seed | over weighted IDIM-LS, mean | A^2, mean of the models | over weighted IDIM-LS |\n|---|---|---|---|---|"
    );
    println!("| gains | {gains}\n| URDF | {links}\n");
    println!(
        "The mean of several models' efforts is that of one model as well, whose M, potential and coefficients are the means of theirs. The program\n\
         fails where the mean over the seeds is above {} and {}. In 002 it is 1.09 and 1.30 (sums over table I, without and with the vibration-free\n\
         table). Without kinematics 90 s are few. Where all weights are learned, from the URDF on as well, networks take friction that depends\n\
         on load for a potential, and a potential of many hidden units does so by its outputs alone\n\
         ([0145](decisions/0145-a-lagrangian-network-can-begin-from-the-urdf.md)). Directions of Coulomb friction differ little on this robot, so that NSCF gains nothing. With 20 and\n\
         40 % of the training motions the decay, which weighs more there, keeps the gravity of joint 2 near the URDF's.\n",
        MOST[0], MOST[1]
    );
    println!("## Friction and rotors\n");
    println!(
        "Coefficients after all of the training motions: weighted IDIM-LS / DeLaN + NSCF, and the difference in % / begun from the URDF,\n\
         likewise.\n"
    );
    println!("| joint | {} |\n|---|---|---|---|---|", COEFFICIENTS.join(" | "));
    for (j, (expected, alone)) in results.least_squares.iter().enumerate() {
        let cell = |k: usize| {
            let known = k != 3 || *alone;
            let found = results.learned.each_ref().map(|joints| {
                let found = joints[j][k];
                let difference = 100.0 * (found / expected[k] - 1.0);
                if known { format!("{found:.3}, {difference:+.0}") } else { format!("{found:.3}") }
            });
            let expected = if known { format!("{:.3}", expected[k]) } else { "-".to_owned() };
            format!("{expected} / {}", found.join(" / "))
        };
        println!("| {} | {} |", j + 1, [0, 1, 2, 3].map(cell).join(" | "));
    }
    println!(
        "\nRotor inertias without a value of least squares are no base parameters by themselves: torques show their sum with inertias of the\n\
         links, as for joints 1 and 2 in 002. Networks cannot tell I_a from a constant on the diagonal of M(q) either: where they begin at random\n\
         it is in M. Begun from the URDF, whose links have no rotors, it is in I_a.\n"
    );
    println!("Trainings took {seconds:.0} s on two cores, those of the candidates {choosing:.0} s.");
}

/// Candidates and the one that was taken.
fn choice(results: &Results) {
    println!("## Choice of the networks\n");
    println!(
        "Mean square error over the joints, A^2, where DeLaN + NSCF learns from one of the two training motions and is judged on the other, both\n\
         ways, means over {CHOICE_SEEDS} seeds. Of each knowledge the least sum is taken; the motion of the next section is used for no choice.\n\
         Weight decay is stated for {DECAYED} samples, and is less in proportion where there are more: they outweigh what was known before.\n\
         In hindsight, and used for no choice: what each begun from the URDF leaves of the next section's motion over what weighted IDIM-LS do,\n\
         after all of the training motions; one seed.\n"
    );
    println!(
        "| known | inputs | hidden layers | weight decay: inertia, potential | 50 s to 40 s | 40 s to 50 s | | in hindsight |\n|---|---|---|---|---|---|---|---|"
    );
    for (at, Tried { candidate, decay, errors, in_hindsight }) in results.choice.iter().enumerate() {
        let known = match candidate.known {
            Known::Gains => "gains",
            Known::Links => "URDF",
        };
        let inputs = match candidate.inputs {
            Inputs::Angles => "angles",
            Inputs::SinesAndCosines => "sines and cosines",
        };
        let layers = candidate.hidden.map(|layers| {
            let named = |(width, activation): &(usize, Activation)| format!("{width} {activation:?}").to_lowercase();
            layers.iter().map(named).collect::<Vec<_>>().join(", ")
        });
        let hidden = if layers[0] == layers[1] { layers[0].clone() } else { layers.join("; potential ") };
        let taken = if results.chosen.contains(&at) { "taken" } else { "" };
        let [first, second] = errors;
        let [inertia, potential] = decay;
        let told = in_hindsight.map_or(String::new(), |error| format!("{:.2}", error / weighted(results)));
        println!(
            "| {known} | {inputs} | {hidden} | {inertia}, {potential} | {first:.4} | {second:.4} | {taken} | {told} |"
        );
    }
    println!();
}

/// Mean square error of weighted least squares on all of the training motions.
fn weighted(results: &Results) -> f64 {
    let row = results.rows.iter().find(|row| row.share == 100 && row.model == "IDIM-LS, weighted");
    row.map_or(f64::NAN, |row| row.errors.mean())
}

/// Mean square error of DeLaN + NSCF with what is known, mean over the seeds, over that of weighted least squares.
fn behind(results: &Results, known: usize) -> f64 {
    let seeds = &results.seeds[known];
    seeds.iter().sum::<f64>() / seeds.len() as f64 / weighted(results)
}

/// The same of the mean of the models.
fn averaged(results: &Results, known: usize) -> f64 {
    results.averaged[known].mean() / weighted(results)
}

fn extremes(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(*value), high.max(*value)))
}

/// The page's claims.
///
/// # Panics
/// One does not hold.
pub fn check(results: &Results) {
    assert!(results.seconds <= LONGEST, "{} s", results.seconds);
    for (known, most) in MOST.iter().enumerate() {
        let behind = behind(results, known);
        assert!(behind <= *most, "{behind}");
    }
    for (j, (expected, _)) in results.least_squares.iter().enumerate().filter(|(_, (_, alone))| *alone) {
        let found = results.learned[Known::Links as usize][j][3] / expected[3];
        assert!((found - 1.0).abs() <= ROTORS, "joint {}: {found}", j + 1);
    }
}
