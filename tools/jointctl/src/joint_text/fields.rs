//! Meaning of each key of `joint.toml`, with its unit and range; host.
//!
//! The ranges are those of `Configuration` in the firmware, which is what checks them; a test holds both together.

/// One key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// Table that it stands in; empty at the top.
    pub table: &'static str,
    /// Key.
    pub key: &'static str,
    /// Meaning, with what else limits it.
    pub meaning: &'static str,
    /// Unit; empty for a ratio, a number of things or a choice.
    pub unit: &'static str,
    /// Lowest and highest value where these are fixed numbers; of each entry, where there are two.
    pub range: Option<(f32, f32)>,
}

impl Field {
    /// The comment above the key.
    #[must_use]
    pub fn comment(&self) -> String {
        let range = self.range.map(|(low, high)| format!("{low} to {high}"));
        let unit = (!self.unit.is_empty()).then(|| self.unit.to_owned());
        let limits: Vec<String> = unit.into_iter().chain(range).collect();
        match limits.is_empty() {
            true => self.meaning.to_owned(),
            false => format!("{} [{}]", self.meaning, limits.join(", ")),
        }
    }
}

const fn field(
    table: &'static str,
    key: &'static str,
    unit: &'static str,
    range: Option<(f32, f32)>,
    meaning: &'static str,
) -> Field {
    Field { table, key, meaning, unit, range }
}

/// All keys.
pub const FIELDS: [Field; 68] = [
    field("", "node_id", "", None, "Node on the CAN bus, 1 to 127; 255 where none is assigned yet"),
    field("", "oscillator_trim", "", Some((54.0, 74.0)), "Trim of the board's oscillator, steps of some 0.3 %"),
    field("motor", "resistance", "Ohm", Some((1e-3, 100.0)), "Resistance of a phase at 25 °C"),
    field("motor", "inductance_d", "H", Some((1e-6, 0.1)), "Inductance along the magnet's flux"),
    field("motor", "inductance_q", "H", Some((1e-6, 0.1)), "Inductance across the magnet's flux"),
    field("motor", "torque_constant", "Nm/A", Some((1e-3, 5.0)), "Torque at the rotor by q current"),
    field("motor", "current_limit", "A", Some((0.1, 200.0)), "Largest current; at most the board's"),
    field(
        "motor",
        "loss_current",
        "A",
        None,
        "Largest d current that burns braking energy which the supply does not take; 0 (none) to the current limit",
    ),
    field(
        "motor",
        "field_weakening_current",
        "A",
        None,
        "Largest d current against the magnet's flux; 0 (none) to the current limit and flux linkage over inductance",
    ),
    field("motor", "encoder_latency", "s", Some((0.0, 1e-3)), "Age of an encoder sample when it is used"),
    field(
        "motor",
        "encoder_counts",
        "",
        Some((16.0, 65_535.0)),
        "Counts a turn of an incremental encoder, four times its lines",
    ),
    field("motor.alignment", "pole_pairs", "", Some((1.0, 64.0)), "Electrical turns in a mechanical one"),
    field("motor.alignment", "direction", "", None, "The encoder counts \"forward\" with the field, or in \"reverse\""),
    field(
        "motor.alignment",
        "electrical_zero",
        "turns",
        None,
        "Electrical angle where the d axis lies on phase A, 0 to below 1",
    ),
    field(
        "gear",
        "ratio",
        "",
        None,
        "Rotor revolutions per revolution of the joint, 1 to 500; negative where it turns backwards",
    ),
    field(
        "gear",
        "zero",
        "rad",
        Some((-1000.0, 1000.0)),
        "Joint's position where the encoder's first sample reads zero",
    ),
    field("limits", "torque", "Nm", Some((0.01, 2000.0)), "Largest torque at the joint"),
    field("limits", "velocity", "rad/s", Some((0.1, 200.0)), "Largest velocity; a fault 20 % above it"),
    field("limits", "position", "rad", Some((-1000.0, 1000.0)), "Lowest and highest position"),
    field(
        "limits",
        "position_margin",
        "rad",
        Some((1e-3, 10.0)),
        "Distance beyond the position limits that is a fault",
    ),
    field(
        "limits",
        "damping",
        "Nm s/rad",
        None,
        "Torque fades with it towards the limits, and the joint brakes with it; 5 times the torque limit over the velocity limit to 1e6",
    ),
    field(
        "limits",
        "over_current",
        "A",
        None,
        "Phase current that switches the bridge off; 1.05 times the current limit to the board's",
    ),
    field("limits", "bus_voltage", "V", Some((5.0, 100.0)), "Lowest and highest supply; at most the board's"),
    field(
        "limits",
        "regeneration_band",
        "V",
        None,
        "Span below the highest supply over which braking current fades; 0.1 to highest less lowest",
    ),
    field(
        "limits",
        "chopper_voltage",
        "V",
        None,
        "Supply at which a brake chopper conducts; 0 (none), or 1 V above the lowest supply to where the regeneration band begins",
    ),
    field(
        "limits",
        "chopper_share",
        "",
        Some((1e-3, 1.0)),
        "Largest part of the time in which it may conduct, over 10 s: power times resistance over chopper_voltage squared",
    ),
    field(
        "limits",
        "bridge_temperature",
        "°C",
        Some((40.0, 150.0)),
        "Highest temperature of the bridge, at most the board's; derated over the last 20 K",
    ),
    field(
        "limits",
        "winding_temperature",
        "°C",
        Some((60.0, 200.0)),
        "Highest temperature of the winding; derated over the last 20 K",
    ),
    field(
        "limits",
        "command_deadline",
        "s",
        Some((1e-3, 10.0)),
        "Time without a command after which the joint brakes; at most the board's",
    ),
    field(
        "gains",
        "current_bandwidth",
        "Hz",
        None,
        "Bandwidth of the current loop; 10 to an eighteenth of the control rate",
    ),
    field(
        "gains",
        "observer_bandwidth",
        "Hz",
        None,
        "Bandwidth of the tracking observer; 1 to a tenth of the control rate",
    ),
    field(
        "gains",
        "voltage_fraction",
        "",
        Some((0.1, 1.154_700_5)),
        "Longest voltage vector over the longest one that fits at any angle; 1.1547 uses the whole hexagon",
    ),
    field("gains", "stiffness", "Nm/rad", Some((0.0, 1e5)), "Stiffness of the position mode"),
    field("gains", "damping", "Nm s/rad", Some((0.0, 1e4)), "Damping of position and velocity mode"),
    field(
        "gains",
        "integral",
        "Nm/rad",
        Some((0.0, 1e6)),
        "Integral of the velocity error; a tenth of it in position mode",
    ),
    field("gains", "acceleration", "rad/s^2", Some((0.1, 1e5)), "Acceleration of ramps"),
    field(
        "gains",
        "quick_stop_deceleration",
        "rad/s^2",
        Some((0.1, 1e5)),
        "Deceleration of quick stop and fault reaction",
    ),
    field("gains", "braking_time", "s", Some((0.01, 10.0)), "Longest time of braking before the bridge switches off"),
    field(
        "stops",
        "quick_stop",
        "",
        None,
        "605Ah: 0 off at once, 1 along the ramp of the modes, 2 along its own; 5, 6 the same, then it holds",
    ),
    field("stops", "shutdown", "", None, "605Bh: 0 off at once, 1 along the ramp of the modes"),
    field("stops", "disable_operation", "", None, "605Ch: 0 off at once, 1 along the ramp of the modes"),
    field("stops", "halt", "", None, "605Dh: 1 along the ramp of the modes, 2 of the quick stop; then it holds"),
    field(
        "stops",
        "fault_reaction",
        "",
        None,
        "605Eh, where a fault permits braking: 0 off at once, 1 along the ramp of the modes, 2 of the quick stop",
    ),
    field("stops", "late_command", "", None, "6007h: a command that is late is 1 a fault, 3 a quick stop"),
    field("stops", "brake_release", "s", Some((0.0, 5.0)), "Time in which the holding brake opens"),
    field("stops", "brake_apply", "s", Some((0.0, 5.0)), "Time in which the holding brake closes"),
    field(
        "compensation",
        "request",
        "",
        None,
        "\"off\", \"physical\", \"physical-and-network\" or \"network-in-shadow\"",
    ),
    field("compensation", "gain", "", Some((0.0, 1.0)), "Share of the estimated friction that is added"),
    field("compensation", "clamp", "Nm", None, "Largest compensation torque; 0 to the torque limit"),
    field("compensation", "slew", "Nm/s", Some((0.5, 32e3)), "Largest change of the compensation torque"),
    field(
        "compensation",
        "velocity_source",
        "",
        None,
        "Friction is computed for the \"reference\" velocity or the \"measured\" one",
    ),
    field(
        "compensation",
        "standstill_velocity",
        "rad/s",
        Some((1e-4, 10.0)),
        "Velocity below which compensation fades out",
    ),
    field(
        "compensation",
        "uncertainty",
        "",
        Some((0.0, 1.0)),
        "By how much friction may be less than gain times the model; what the energy guard may take",
    ),
    field(
        "compensation",
        "adaptation",
        "",
        None,
        "Adaptation in service: \"off\", \"shadow\" (without effect) or \"on\"",
    ),
    field(
        "load",
        "request",
        "",
        None,
        "Torques of the load that the joint adds by itself: \"off\", \"acceleration\", \"gravity\" or \"both\"",
    ),
    field(
        "load",
        "inertia",
        "kg m^2",
        Some((0.0, 1000.0)),
        "Inertia about the joint without payload, rotor times the gear ratio squared included",
    ),
    field("load", "gravity", "Nm", Some((0.0, 2000.0)), "Largest gravity torque without payload, with the lever level"),
    field("load", "hanging", "rad", Some((-1000.0, 1000.0)), "Position in which the lever hangs straight down"),
    field("load", "payload_mass", "kg", Some((0.0, 1000.0)), "Payload"),
    field("load", "payload_arm", "m", Some((0.0, 10.0)), "Distance of the payload's centre of mass from the axis"),
    field(
        "load",
        "uncertainty",
        "",
        Some((0.0, 0.9)),
        "Part of true inertia and gravity by which those of this section may be wrong",
    ),
    field(
        "load",
        "collision_threshold",
        "Nm",
        Some((0.0, 2000.0)),
        "External torque beyond its uncertainty that is a collision",
    ),
    field(
        "load",
        "collision_reaction",
        "",
        None,
        "Reaction to a collision: \"off\" (it counts), \"warning\" (EMCY), \"quick-stop\", \"hold\" or \"yield\"",
    ),
    field("thermal", "winding_capacity", "J/K", None, "Heat capacity of the winding; to 10000"),
    field("thermal", "housing_capacity", "J/K", None, "Heat capacity of the housing; to 100000"),
    field("thermal", "winding_to_housing", "K/W", Some((0.01, 100.0)), "Thermal resistance from winding to housing"),
    field("thermal", "housing_to_ambient", "K/W", Some((0.01, 100.0)), "Thermal resistance from housing to ambient"),
    field("thermal", "ambient", "°C", Some((-40.0, 85.0)), "Temperature of the surroundings"),
];
