//! The image: quantised parameters, limits, certificate and golden vectors.

use super::{FitError, Learned, Options, coverage};
use crate::dataset::description::EffortUnit;
use crate::friction_model::{FrictionModel as FloatModel, Term};
use crate::identify::Identified;
use crate::quantize::{self, full_scale::to_unsigned_q16, golden_vectors};
use crate::samples::Samples;
use friction_compensation::friction::regime::MAX_SETS;
use friction_compensation::friction::state::{SIGNALS, Signal};
use friction_compensation::friction::{FrictionParameters, ParameterSet};
use friction_compensation::parameters::certificate::{Certificate, Limits, certify, prove};
use friction_compensation::parameters::image::{Effort, Image, MAX_LENGTH, Target};

/// Golden vectors of an image; fewer where they do not fit.
const GOLDEN: usize = 6;
/// The image may give this many times the largest effort of the training data.
const OUTPUT_LIMIT: f64 = 3.0;
/// Slopes may be this much above what is proved of the image: room for a later retraining within the same limits.
const SLOPE_ROOM: f64 = 1.5;
/// Trained speeds up to which a model without network counts: its terms either have an end or grow with the speed, as
/// friction does. A network knows nothing beyond what it was trained on.
const REACH: f64 = 2.0;
/// Least part of a friction that its slope over temperature may leave at the warm end of the box, widened by the
/// margin.
const LEAST_WARM: f64 = 0.1;
/// A loop gain through the measured torque that no image may exceed.
const TORQUE_GAIN_LIMIT: f64 = 0.5;

/// Contents of an image beside its parameters.
pub struct Context<'a> {
    /// Unit of the effort.
    pub effort: EffortUnit,
    /// Hash of the data set.
    pub sha256: &'a [u8; 32],
    /// Choices of the fit.
    pub options: &'a Options,
}

/// An image with its proof, and the model that it holds.
pub struct Built {
    /// The image.
    pub image: Image,
    /// Bounds that are proved of it.
    pub certificate: Certificate,
    /// The model, without network where the certificate refuses it.
    pub learned: Learned,
}

/// Quantises and certifies the learned model; a network that the certificate refuses is left out, with the reason.
/// Without one the model counts up to [`REACH`] times the trained speed, and without one of the temperature as far into
/// heat; where that is refused, or would take the network, to what was trained.
pub fn build_image(
    samples: &Samples,
    physical: &Identified,
    learned: &Learned,
    context: &Context,
) -> Result<Built, FitError> {
    let trained = || build_to(1.0, samples, physical, learned, context);
    match build_to(REACH, samples, physical, learned, context) {
        Err(FitError::Refused(_) | FitError::Quantize(_)) => trained(),
        Ok(far) if learned.has_network() && !far.learned.has_network() => {
            let near = trained()?;
            Ok(if near.learned.has_network() { near } else { far })
        }
        built => built,
    }
}

/// [`build_image`] for a model that counts up to `reach` times what was trained.
fn build_to(
    reach: f64,
    samples: &Samples,
    physical: &Identified,
    learned: &Learned,
    context: &Context,
) -> Result<Built, FitError> {
    let limit = output_limit(largest_effort(samples), context.options.torque_limit)?;
    let mut learned = learned.clone();
    let mut parameters = match quantized(samples, physical, &learned, context.options, reach) {
        Err(FitError::Quantize(error)) if learned.has_network() => {
            let reason = format!("an image cannot hold it: {error}");
            learned = learned.rejected(samples, physical, reason);
            quantized(samples, physical, &learned, context.options, reach)?
        }
        other => other?,
    };
    let mut proved = prove(&parameters);
    let refusal = match &proved {
        Err(refusal) => Some(refusal.to_string()),
        Ok(proved) if proved.output > limit => {
            let [bound, limit] = [proved.output, limit].map(|bits| f64::from(bits) / 65536.0);
            Some(format!("friction can reach {bound:.3}, limit {limit:.3} {}", context.effort.symbol()))
        }
        Ok(_) => None,
    };
    if let Some(refusal) = refusal.filter(|_| learned.has_network()) {
        learned = learned.rejected(samples, physical, format!("the certificate refuses it: {refusal}"));
        parameters = quantized(samples, physical, &learned, context.options, reach)?;
        proved = prove(&parameters);
    }
    let proved = proved.map_err(FitError::Refused)?;
    let limits = limits(&proved, limit);
    let certificate = certify(&parameters, &limits).map_err(FitError::Refused)?;
    Ok(Built { image: image(parameters, limits, context)?, certificate, learned })
}

fn limits(proved: &Certificate, output: u32) -> Limits {
    let slope = proved.velocity_slope_high.max(-proved.velocity_slope_low) as f64 * SLOPE_ROOM;
    Limits {
        output,
        torque_gain: (TORQUE_GAIN_LIMIT * 65536.0) as u32,
        velocity_slope: slope.ceil().clamp(256.0, f64::from(u32::MAX)) as u32,
    }
}

/// The image with as many golden vectors as fit.
fn image(parameters: FrictionParameters, limits: Limits, context: &Context) -> Result<Image, FitError> {
    let effort = match context.effort {
        EffortUnit::NewtonMetre => Effort::NewtonMetre,
        EffortUnit::Newton => Effort::Newton,
        EffortUnit::Ampere => Effort::Ampere,
        EffortUnit::Volt => Effort::Volt,
    };
    let mut data_hash = [0; 16];
    data_hash.copy_from_slice(&context.sha256[..16]);
    let golden = golden_vectors(&parameters, GOLDEN);
    let image = Image {
        version: context.options.version,
        target: Target::default(),
        created: context.options.created,
        effort,
        data_hash,
        friction: parameters,
        limits,
        golden: heapless::Vec::from_slice(&golden).unwrap_or_default(),
    };
    image.encode(&mut [0; MAX_LENGTH])?;
    Ok(image)
}

/// Limit of the image's output, Q16.16: at most the joint's torque limit, rounded down.
fn output_limit(largest_effort: f64, torque_limit: Option<f64>) -> Result<u32, FitError> {
    let limit = to_unsigned_q16("limit of the output", OUTPUT_LIMIT * largest_effort)?;
    Ok(torque_limit.map_or(limit, |torque| limit.min((torque * 65_536.0) as u32)))
}

fn largest_effort(samples: &Samples) -> f64 {
    coverage::used(samples).fold(0.0, |most, i| most.max(samples.effort[i].abs()))
}

/// True where what the model knows of one sign of the signal holds for the other: of the velocity without an
/// asymmetric viscous term, of the load where its magnitude alone counts.
fn alike_both_ways(signal: usize, friction: &FloatModel) -> bool {
    let unless = |term| !friction.terms.contains(term);
    signal == Signal::Velocity as usize && unless(Term::ViscousAsymmetry)
        || signal == Signal::TheoreticalTorque as usize && unless(Term::Load)
}

/// The range as wide on either side of zero as on the wider one, where it has both.
fn both_ways((low, high): (f64, f64)) -> (f64, f64) {
    let widest = high.max(-low);
    if low < 0.0 && high > 0.0 { (-widest, widest) } else { (low, high) }
}

/// The range with each end that lies beyond zero `reach` times as far away from it.
fn reaching(reach: f64, (low, high): (f64, f64)) -> (f64, f64) {
    (low.min(reach * low), high.max(reach * high))
}

/// The range of temperatures with its warm end `reach` times as far away from the cold one, where heat lowers friction:
/// friction beyond the trained range is less than within. It ends where the slope leaves little of a friction.
fn warmer(reach: f64, (low, high): (f64, f64), margin: f64, friction: &FloatModel) -> (f64, f64) {
    let factors = [
        (Term::ViscousTemperature, friction.viscous_temperature),
        (Term::CoulombTemperature, friction.coulomb_temperature),
    ];
    let factors = factors.into_iter().filter(|(term, _)| friction.terms.contains(*term)).map(|(_, factor)| factor);
    let (least, most) = factors.fold((0.0, 0.0), |(least, most): (f64, f64), k| (least.min(k), most.max(k)));
    if most > 0.0 || friction.terms.contains(Term::Temperature) {
        return (low, high);
    }
    // The physical model is clamped one margin beyond the box.
    let little = friction.reference_temperature + (LEAST_WARM - 1.0) / least;
    let end = (little + 0.5 * margin * low) / (1.0 + 0.5 * margin);
    (low, high.max((low + reach * (high - low)).min(end)))
}

fn quantized(
    samples: &Samples,
    physical: &Identified,
    learned: &Learned,
    options: &Options,
    reach: f64,
) -> Result<FrictionParameters, FitError> {
    const VELOCITY: usize = Signal::Velocity as usize;
    const TEMPERATURE: usize = Signal::Temperature as usize;
    let depends = quantize::physical::depends_on(&physical.friction);
    let range = |column: &[f64]| coverage::ends(coverage::used(samples).map(|i| column[i]).collect());
    let columns: [&[f64]; SIGNALS] = [
        &samples.position,
        &samples.velocity,
        &samples.load,
        &samples.effort,
        &samples.temperature,
        &samples.acceleration,
    ];
    let limits = std::array::from_fn(|i| {
        let network = learned.input_box.as_ref().is_some_and(|input_box| i < 5 && input_box.active()[i]);
        (depends[i] || network).then(|| {
            let ends = range(columns[i]);
            let ends = if !network && alike_both_ways(i, &physical.friction) { both_ways(ends) } else { ends };
            match i {
                TEMPERATURE if !network => warmer(reach, ends, options.margin, &physical.friction),
                VELOCITY if !learned.has_network() => reaching(reach, ends),
                _ => ends,
            }
        })
    });
    let domain = quantize::domain(&limits, options.margin, physical.friction.reference_temperature)?;
    let common = quantize::common::quantize(&physical.friction)?;
    let mut sets = [ParameterSet::default(); MAX_SETS];
    for (place, (friction, network)) in sets.iter_mut().zip(&learned.float.sets) {
        *place = ParameterSet {
            physical: quantize::physical::quantize(friction, &domain)?,
            network: network.as_ref().map(quantize::network::quantize).transpose()?,
        };
    }
    Ok(FrictionParameters { domain, selector: learned.selector, common, sets })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction_model::Terms;
    use crate::identify::synthetic::{RIGID, drive, friction, motion, rigid};
    use crate::network::{InputBox, Network};
    use crate::page::NetworkOutcome;
    use crate::presets::Preset;
    use crate::rigid::RigidParameters;

    #[test]
    fn an_image_may_give_three_times_the_largest_effort_and_never_more_than_the_joint() {
        let limit = |effort, torque| output_limit(effort, torque).unwrap();
        assert_eq!(limit(1.0, None), 3 << 16);
        assert_eq!(limit(1.0, Some(2.0)), 2 << 16);
        assert_eq!(limit(1.0, Some(4.0)), 3 << 16);
        // The joint rounds its own limit down: the nearest number would be one more than it takes.
        assert_eq!(limit(1.0, Some(2.0 - 0.25 / 65_536.0)), (2 << 16) - 1);
        assert!(output_limit(f64::NAN, Some(2.0)).is_err());
    }

    #[test]
    fn what_is_known_of_one_direction_counts_for_the_other_where_both_were_seen() {
        assert_eq!(both_ways((-0.5, 0.3)), (-0.5, 0.5));
        assert_eq!(both_ways((-0.3, 0.5)), (-0.5, 0.5));
        assert_eq!(both_ways((0.0, 0.5)), (0.0, 0.5));
        assert_eq!(both_ways((-0.5, 0.0)), (-0.5, 0.0));
    }

    #[test]
    fn a_range_reaches_away_from_zero_and_never_past_its_near_end() {
        assert_eq!(reaching(2.0, (-0.5, 0.3)), (-1.0, 0.6));
        assert_eq!(reaching(2.0, (0.1, 0.3)), (0.1, 0.6));
        assert_eq!(reaching(2.0, (-0.3, -0.1)), (-0.6, -0.1));
        assert_eq!(reaching(1.0, (-0.5, 0.3)), (-0.5, 0.3));
    }

    #[test]
    fn temperatures_reach_as_far_again_where_heat_lowers_friction_and_a_tenth_of_it_is_left() {
        let at = |viscous, coulomb, terms: &[Term]| {
            let terms = Terms::of(terms);
            let model = FloatModel {
                terms,
                viscous_temperature: viscous,
                coulomb_temperature: coulomb,
                reference_temperature: 30.0,
                ..FloatModel::default()
            };
            warmer(2.0, (20.0, 40.0), 0.5, &model)
        };
        let both = [Term::ViscousTemperature, Term::CoulombTemperature];
        assert_eq!(at(-0.01, -0.005, &both), (20.0, 60.0));
        // The clamped end is a quarter of the box above its warm end: 70 °C, 40 K above the reference.
        assert_eq!(at(-0.9 / 40.0, 0.0, &both), (20.0, 60.0));
        let (_, steeper) = at(-0.9 / 39.0, 0.0, &both);
        assert!(steeper < 60.0 && (steeper + 0.25 * (steeper - 20.0) - 69.0).abs() < 1e-9, "{steeper}");
        assert_eq!(at(-0.09, 0.0, &both), (20.0, 40.0), "the trained range stays, however steep");
        assert_eq!(at(-0.01, 0.001, &both), (20.0, 40.0), "friction that rises is no reason");
        assert_eq!(at(-0.01, 0.001, &both[..1]), (20.0, 60.0), "nor a term that is not there");
        assert_eq!(at(-0.01, -0.01, &[Term::ViscousTemperature, Term::Temperature]), (20.0, 40.0));
        assert_eq!(warmer(1.0, (20.0, 40.0), 0.5, &FloatModel::default()), (20.0, 40.0));
    }

    /// A joint whose friction falls with heat, learned between 20 and 40 °C, with a network of position and velocity,
    /// and of the temperature or not.
    fn with_network(of_temperature: bool) -> (Samples, Identified, Learned) {
        let terms = [Term::Viscous, Term::Coulomb, Term::ViscousTemperature, Term::CoulombTemperature];
        let mut samples = motion(6_000);
        let friction = friction(Terms::of(&terms));
        drive(&mut samples, &rigid(), &friction, 0.0, 1);
        samples.load = vec![0.0; samples.len()];
        let physical = Identified {
            preset: Preset::CoulombViscous,
            rigid_model: RIGID,
            rigid: RigidParameters::default(),
            theoretical: RigidParameters::default(),
            friction,
            parameters: vec![],
            train_rmse: 0.0,
            folds: vec![],
            notes: vec![],
        };
        let used = [true, true, false, false, of_temperature];
        let input_box = InputBox::new([-1.5, -1.0, 0.0, 0.0, 20.0], [1.5, 1.0, 0.0, 0.0, 40.0], used).expect("a box");
        // The last number is the bias of the output: friction is 0.2 Nm more with the network.
        let mut parameters = vec![0.0; 96];
        parameters[95] = 1.0;
        let network = Network::new(&[5, 5, 5], input_box, 0.2, parameters).expect("a network");
        let mut learned = Learned::physical(&samples, &physical, NetworkOutcome::Kept);
        learned.float.sets[0].1 = Some(network);
        learned.input_box = Some(input_box);
        (samples, physical, learned)
    }

    /// Warm end of an image's temperatures, K above the reference.
    fn warm_end(built: &Built) -> f64 {
        f64::from(built.image.friction.domain.ranges[Signal::Temperature as usize].high) / 65_536.0
    }

    #[test]
    fn an_image_with_a_network_reaches_into_heat_where_the_network_does_not_know_it_and_as_far_as_it_is_certified() {
        let built = |of_temperature: bool, torque_limit: Option<f64>, reach: Option<f64>| {
            let (samples, physical, learned) = with_network(of_temperature);
            let options = Options { torque_limit, ..Options::default() };
            let context = Context { effort: EffortUnit::NewtonMetre, sha256: &[0; 32], options: &options };
            match reach {
                Some(reach) => build_to(reach, &samples, &physical, &learned, &context).expect("an image"),
                None => build_image(&samples, &physical, &learned, &context).expect("an image"),
            }
        };
        let (far, near) = (built(false, None, None), built(false, None, Some(1.0)));
        let knowing = built(true, None, None);
        assert!([&far, &near, &knowing].iter().all(|built| built.learned.has_network()));
        assert_eq!(warm_end(&knowing), warm_end(&near));
        assert!((warm_end(&far) - warm_end(&near) - 20.0).abs() < 0.2, "{} {}", warm_end(&far), warm_end(&near));
        // The margin of the wider box is wider on its cold side, where friction is greater.
        let [most, least] = [&far, &near].map(|built| f64::from(built.certificate.output) / 65_536.0);
        assert!(most > least + 0.01, "{most} {least}");
        let between = built(false, Some(0.5 * (most + least)), None);
        assert_eq!((between.learned.has_network(), warm_end(&between)), (true, warm_end(&near)));
        let below = built(false, Some(0.99 * least), None);
        assert!(!below.learned.has_network());
    }

    #[test]
    fn a_term_that_tells_directions_apart_keeps_each_to_its_own() {
        let of = |term| FloatModel { terms: Terms::of(&[Term::Viscous, term]), ..FloatModel::default() };
        let alike = |signal: Signal, term| alike_both_ways(signal as usize, &of(term));
        assert!(alike(Signal::Velocity, Term::Coulomb) && !alike(Signal::Velocity, Term::ViscousAsymmetry));
        assert!(alike(Signal::TheoreticalTorque, Term::CoulombLoad) && !alike(Signal::TheoreticalTorque, Term::Load));
        assert!(!alike(Signal::Position, Term::Harmonics) && !alike(Signal::Acceleration, Term::Hysteresis));
    }
}
