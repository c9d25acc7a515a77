//! Conversion of what was found into the joint's settings, and what a joint that nobody has commissioned gets beside
//! them.

use super::bench::{Bench, Stopped};
use super::{Found, Plan};
use joint_firmware::default_configuration::B_G431B_ESC1;
use joint_firmware::objects::settings::Setting;
use std::f64::consts::TAU;

/// The bridge switches off at this multiple of the current limit.
pub(super) const OVER_CURRENT: f64 = 1.5;
/// Speed that the rotor is permitted while the field turns it, rad/s: into line it swings.
pub(super) const ROTOR_SPEED: f64 = 150.0;
/// Part of the supply that the back-EMF may take at the velocity limit.
const BACK_EMF: f64 = 0.35;
/// Largest velocity limit of a configuration, rad/s.
const FASTEST: f64 = 200.0;
/// Part of the torque limit with which a new joint answers an error of one turn of the rotor per second, how fast it
/// integrates it, 1/s, and how fast it answers an error of its position, 1/s. Its inertia is not known: these are soft,
/// and to be tuned.
const DAMPING: f64 = 0.05;
const INTEGRATION: f64 = 20.0;
const STIFFNESS: f64 = 10.0;
/// Limit damping, parts of torque limit over velocity limit: a little more than the least that is permitted, 5.
const LIMIT_DAMPING: f64 = 5.05;
/// Bandwidths of a new joint's current loop and observer, Hz.
const CURRENT_BANDWIDTH: f64 = 500.0;
const OBSERVER_BANDWIDTH: f64 = 200.0;

/// Compensation that a new joint permits an image, which none uses before it is requested: share of the estimate, part
/// of the torque limit, torque limits per second within what the joint takes, and the part of the velocity limit below
/// which it fades out.
const COMPENSATION_GAIN: f64 = 0.98;
const CLAMP: f64 = 0.5;
const SLEW: f64 = 50.0;
const STANDSTILL: f64 = 0.01;

/// Returns `true` if motor and torque constant are the placeholders of a board's program.
pub(super) fn is_new<B: Bench>(bench: &mut B) -> Result<bool, Stopped> {
    // The same placeholders on every board.
    let mut placeholder = B_G431B_ESC1.joint;
    placeholder.motor.current_limit = 0.0;
    for setting in [Setting::InductanceD, Setting::InductanceQ, Setting::TorqueConstant] {
        let own = f64::from(f32::from_bits(setting.get(&placeholder)));
        if (bench.setting(setting)? / own - 1.0).abs() > 1e-6 {
            return Ok(false);
        }
    }
    Ok(true)
}

/// The torque constant that the joint gets: the user's; a new joint without one, the one by back-EMF; otherwise none,
/// the joint keeps its own.
pub(super) fn torque_constant(plan: &Plan, found: &Found) -> Option<f64> {
    let measured = || found.alignment.torque_constant().value.clamp(0.001, 5.0);
    plan.torque_constant.or_else(|| torque_constant_is_measured(plan, found.new).then(measured))
}

/// True for the one by back-EMF; `new`: the joint had none.
pub(super) fn torque_constant_is_measured(plan: &Plan, new: bool) -> bool {
    new && plan.torque_constant.is_none()
}

/// Settings of motor and encoder, and on a new joint limits and gains by them.
pub(super) fn of(plan: &Plan, found: &Found, gear: f64, fastest: f64) -> Vec<(Setting, f64)> {
    let alignment = &found.alignment;
    let mut settings = vec![
        (Setting::Resistance, found.resistance.at_25().value),
        (Setting::InductanceD, found.inductance.d.value),
        (Setting::InductanceQ, found.inductance.q.value),
        (Setting::PolePairs, f64::from(alignment.pole_pairs)),
        (Setting::Direction, f64::from(u8::from(alignment.reversed))),
        (Setting::ElectricalZero, alignment.zero.value),
        (Setting::CurrentLimit, found.current_limit),
        (Setting::OverCurrent, found.over_current),
        (Setting::GearRatio, gear),
    ];
    let constant = torque_constant(plan, found);
    settings.extend(constant.map(|constant| (Setting::TorqueConstant, constant)));
    let Some(constant) = constant.filter(|_| found.new) else {
        settings.push((Setting::VelocityLimit, fastest));
        return settings;
    };
    let ratio = gear.abs();
    let torque = (constant * found.current_limit * ratio).clamp(0.01, 2000.0);
    // w psi = 2/3 K_t times the rotor's speed.
    let by_emf = BACK_EMF * found.checked.condition.supply / (constant / 1.5) / ratio;
    let damping = (DAMPING * torque * ratio / TAU).min(1e4);
    let velocity = by_emf.clamp(0.1, FASTEST);
    settings.extend([
        (Setting::TorqueLimit, torque),
        (Setting::VelocityLimit, velocity),
        (Setting::LimitDamping, (LIMIT_DAMPING * torque / velocity).min(1e6)),
        (Setting::Damping, damping),
        (Setting::Integral, (INTEGRATION * damping).min(1e6)),
        (Setting::Stiffness, (STIFFNESS * damping).min(1e5)),
        (Setting::CurrentBandwidth, CURRENT_BANDWIDTH),
        (Setting::ObserverBandwidth, OBSERVER_BANDWIDTH),
        (Setting::CompensationGain, COMPENSATION_GAIN),
        (Setting::Clamp, CLAMP * torque),
        (Setting::Slew, (SLEW * torque).clamp(0.5, 32e3)),
        (Setting::StandstillVelocity, (STANDSTILL * velocity).clamp(1e-4, 10.0)),
    ]);
    settings
}
