//! Object 2108h: the open loop's last window, part by part, and what else commissioning asks of the board; task.

use super::field::OpenLoopField;
use crate::joint::configuration::BridgeConfiguration;
use crate::motor::open_loop::Window;

/// The value as its object carries it.
pub(super) fn get(window: &Window, bridge: &BridgeConfiguration, field: OpenLoopField) -> u64 {
    let real = match field {
        OpenLoopField::Number => return window.number.into(),
        OpenLoopField::Encoder => return window.encoder.into(),
        OpenLoopField::Field => return window.field.into(),
        OpenLoopField::Referenced => return window.referenced.into(),
        OpenLoopField::ControlRate => return (bridge.rate as u32).into(),
        OpenLoopField::EncoderKind => return bridge.counts_an_encoder.into(),
        OpenLoopField::CurrentAlong => window.current.d,
        OpenLoopField::CurrentAcross => window.current.q,
        OpenLoopField::VoltageAlong => window.voltage.d,
        OpenLoopField::VoltageAcross => window.voltage.q,
        OpenLoopField::InPhaseAlong => window.in_phase.d,
        OpenLoopField::QuadratureAlong => window.quadrature.d,
        OpenLoopField::InPhaseAcross => window.in_phase.q,
        OpenLoopField::QuadratureAcross => window.quadrature.q,
        OpenLoopField::AlternatingAlong => window.alternating.d,
        OpenLoopField::AlternatingAcross => window.alternating.q,
        OpenLoopField::BusVoltage => window.bus_voltage,
    };
    real.to_bits().into()
}
