//! 2100h to 21FFh: the configuration. Limits that depend on other settings are the widest possible.

use super::*;
use crate::objects::field::{
    ConfigurationField as C, Field::Configuration as Control, Field::OpenLoop as W, Field::SetPoint as Set,
    Field::Setting as S, OpenLoopField as Window, SetPoint,
};
use crate::objects::settings::Setting;

room! {
    0x2100 "configuration" {
        1, "command", U8, WO, UNMAPPED, Control(C::Command); "", 1.0, within(1.0, 2.0);
            "1: check what is staged as a whole and take it, with the motor off; 2: forget it. What is taken is stored by 1010h"
        2, "result", U8, RO, UNMAPPED, Control(C::Result); "", 1.0, ANY;
            "Of the last command: 0 done, 1 a setting was refused, 2 the control step has not taken the configuration before"
        3, "refused setting", U32, RO, UNMAPPED, Control(C::RefusedSetting); "", 1.0, ANY;
            "The setting that was refused, 0 where none was: index of its object in bits 16 to 31, sub-index in bits 8 to 15, both 0 where it has none, number of its name in bits 0 to 7"
        4, "refused value", F32, RO, UNMAPPED, Control(C::RefusedValue); "", 1.0, ANY;
            "Value of that setting, in its unit"
        5, "lowest possible value", F32, RO, UNMAPPED, Control(C::Lowest); "", 1.0, ANY;
            "Least value that is possible with the other settings as they are"
        6, "highest possible value", F32, RO, UNMAPPED, Control(C::Highest); "", 1.0, ANY;
            "Greatest value that is possible with the other settings as they are"
        7, "changed", Bool, RO, UNMAPPED, Control(C::Changed); "", 1.0, ANY;
            "1 while what is staged differs from what is in use"
    }
    0x2101 "motor" {
        1, "resistance", F32, RW, UNMAPPED, S(Setting::Resistance); "Ω", 1.0, within(0.001, 100.0);
            "Resistance of a phase at 25 °C"
        2, "inductance d", F32, RW, UNMAPPED, S(Setting::InductanceD); "H", 1.0, within(1e-6, 0.1);
            "Inductance along the magnet's flux"
        3, "inductance q", F32, RW, UNMAPPED, S(Setting::InductanceQ); "H", 1.0, within(1e-6, 0.1);
            "Inductance across the magnet's flux"
        4, "torque constant", F32, RW, UNMAPPED, S(Setting::TorqueConstant); "Nm/A", 1.0, within(0.001, 5.0);
            "Torque at the rotor by q current"
        5, "current limit", F32, RW, UNMAPPED, S(Setting::CurrentLimit); "A", 1.0, within(0.1, 200.0);
            "Largest current; at most the board's, docs/boards.md"
        6, "pole pairs", U32, RW, UNMAPPED, S(Setting::PolePairs); "", 1.0, within(1.0, 64.0);
            "Electrical turns in a turn of the rotor"
        7, "encoder reversed", U8, RW, UNMAPPED, S(Setting::Direction); "", 1.0, within(0.0, 1.0);
            "1 where the encoder counts down while the field turns forward"
        8, "electrical zero", U32, RW, UNMAPPED, S(Setting::ElectricalZero); "turns", 1.0 / 4_294_967_296.0, ANY;
            "Electrical angle of the encoder where the d axis lies on phase A"
        9, "encoder latency", F32, RW, UNMAPPED, S(Setting::EncoderLatency); "s", 1.0, within(0.0, 1e-3);
            "Age of an encoder sample when the control step sees it"
        10, "encoder counts", U32, RW, UNMAPPED, S(Setting::EncoderCounts); "", 1.0, within(16.0, 65_535.0);
            "Counts a turn of an incremental encoder, four times its lines; stored by 1010h, it acts from the next start on"
        11, "encoder kind", U8, RO, UNMAPPED, W(Window::EncoderKind); "", 1.0, ANY;
            "0 absolute, 1 incremental with an index, which it has to meet after each start"
        12, "loss current", F32, RW, UNMAPPED, S(Setting::LossCurrent); "A", 1.0, within(0.0, 200.0);
            "Largest d current that turns braking energy which the supply does not take into heat of the winding; 0: none; at most the current limit"
        13, "field-weakening current", F32, RW, UNMAPPED, S(Setting::FieldWeakeningCurrent); "A", 1.0, within(0.0, 200.0);
            "Largest d current against the magnet's flux, for speeds at which the supply's voltage is used up; 0: none; at most the current limit and flux linkage over inductance d"
    }
    0x2102 "gear" {
        1, "gear ratio", F32, RW, UNMAPPED, S(Setting::GearRatio); "", 1.0, within(-500.0, 500.0);
            "Rotor revolutions per revolution of the joint, magnitude 1 or more; negative where a positive rotor turns the joint backwards"
        2, "joint's zero", F32, RW, UNMAPPED, S(Setting::JointZero); "rad", 1.0, within(-1_000.0, 1_000.0);
            "Joint's position where the encoder's first sample reads zero"
    }
    0x2103 "limits" {
        1, "torque limit", F32, RW, UNMAPPED, S(Setting::TorqueLimit); "Nm", 1.0, within(0.01, 2_000.0);
            "Largest torque at the joint; 6076h"
        2, "velocity limit", F32, RW, UNMAPPED, S(Setting::VelocityLimit); "rad/s", 1.0, within(0.1, 200.0);
            "Fastest the joint may be; a fault 20 % above it"
        3, "lowest position", F32, RW, UNMAPPED, S(Setting::LowestPosition); "rad", 1.0, within(-1_000.0, 1_000.0);
            "A fault when passed by more than the margin"
        4, "highest position", F32, RW, UNMAPPED, S(Setting::HighestPosition); "rad", 1.0, within(-1_000.0, 1_000.0);
            "A fault when passed by more than the margin"
        5, "position margin", F32, RW, UNMAPPED, S(Setting::PositionMargin); "rad", 1.0, within(1e-3, 10.0);
            "Margin beyond the position limits"
        6, "over-current limit", F32, RW, UNMAPPED, S(Setting::OverCurrent); "A", 1.0, within(0.0, 500.0);
            "Phase current at which the bridge switches off; at least 5 % above the current limit, at most the board's"
        7, "lowest bus voltage", F32, RW, UNMAPPED, S(Setting::LowestBusVoltage); "V", 1.0, within(5.0, 100.0);
            "A fault below it"
        8, "highest bus voltage", F32, RW, UNMAPPED, S(Setting::HighestBusVoltage); "V", 1.0, within(5.0, 100.0);
            "A fault above it; at least 1 V above the lowest, at most the board's"
        9, "bridge temperature limit", F32, RW, UNMAPPED, S(Setting::BridgeTemperature); "°C", 1.0, within(40.0, 150.0);
            "A fault at it, at most the board's; the current is derated over the last 20 K"
        10, "winding temperature limit", F32, RW, UNMAPPED, S(Setting::WindingTemperature); "°C", 1.0, within(60.0, 200.0);
            "A fault at it; the current is derated over the last 20 K"
        11, "command deadline", F32, RW, UNMAPPED, S(Setting::CommandDeadline); "s", 1.0, within(1e-3, 10.0);
            "Time without a set-point after which the joint brakes; at most the board's"
        12, "limit damping", F32, RW, UNMAPPED, S(Setting::LimitDamping); "Nm s/rad", 1.0, within(0.0, 1e6);
            "With which torque fades towards velocity and position limits, and with which the joint brakes; at least 5 times the torque limit over the velocity limit"
        13, "regeneration band", F32, RW, UNMAPPED, S(Setting::RegenerationBand); "V", 1.0, within(0.1, 95.0);
            "Span below the highest bus voltage over which a braking current that feeds the supply fades to nothing"
        14, "chopper voltage", F32, RW, UNMAPPED, S(Setting::ChopperVoltage); "V", 1.0, within(0.0, 100.0);
            "Supply at which the brake chopper conducts, until it is 1 % less; 0: never; from 1 V above the lowest bus voltage to where the regeneration band begins, on a board that has an output for one"
        15, "chopper share", F32, RW, UNMAPPED, S(Setting::ChopperShare); "", 1.0, within(0.001, 1.0);
            "Largest part of the time in which the brake chopper may conduct, mean over 10 s: power of its resistor times resistance over the chopper voltage squared"
    }
    0x2104 "gains" {
        1, "current bandwidth", F32, RW, UNMAPPED, S(Setting::CurrentBandwidth); "Hz", 1.0, within(10.0, 100e3);
            "Bandwidth of the current loop; at most an eighteenth of the control rate"
        2, "observer bandwidth", F32, RW, UNMAPPED, S(Setting::ObserverBandwidth); "Hz", 1.0, within(1.0, 100e3);
            "Bandwidth of the tracking observer; at most a tenth of the control rate"
        3, "stiffness", F32, RW, UNMAPPED, S(Setting::Stiffness); "Nm/rad", 1.0, within(0.0, 1e5);
            "Stiffness of the position mode"
        4, "damping", F32, RW, UNMAPPED, S(Setting::Damping); "Nm s/rad", 1.0, within(0.0, 1e4);
            "Damping of position and velocity mode"
        5, "integral gain", F32, RW, UNMAPPED, S(Setting::Integral); "Nm/rad", 1.0, within(0.0, 1e6);
            "Of the velocity error in velocity mode; position mode integrates at a tenth of it"
        6, "acceleration", F32, RW, UNMAPPED, S(Setting::Acceleration); "rad/s²", 1.0, within(0.1, 1e5);
            "Of ramps"
        7, "quick-stop deceleration", F32, RW, UNMAPPED, S(Setting::QuickStopDeceleration); "rad/s²", 1.0, within(0.1, 1e5);
            "Of quick stop and fault reaction"
        8, "braking time", F32, RW, UNMAPPED, S(Setting::BrakingTime); "s", 1.0, within(0.01, 10.0);
            "Longest time that braking may take before the bridge switches off"
        9, "voltage fraction", F32, RW, UNMAPPED, S(Setting::VoltageFraction); "", 1.0, within(0.1, 1.1547005);
            "Longest voltage vector over the longest one that fits at any angle; above 1 the currents are no sines at the limit, at 2 / sqrt 3 it is the whole hexagon"
    }
    0x2105 "oscillator" {
        1, "oscillator trim", U8, RW, UNMAPPED, S(Setting::OscillatorTrim); "", 1.0, within(54.0, 74.0);
            "Trim of the board's oscillator, steps of some 0.3 %, more is faster; from the factory 64. It acts as soon as it is taken: store it once the bus has borne it"
    }
    0x2106 "heat" {
        1, "winding heat capacity", F32, RW, UNMAPPED, S(Setting::WindingCapacity); "J/K", 1.0, within(0.1, 10_000.0);
            "Heat capacity of the winding"
        2, "housing heat capacity", F32, RW, UNMAPPED, S(Setting::HousingCapacity); "J/K", 1.0, within(0.1, 100_000.0);
            "Heat capacity of stator and housing"
        3, "winding to housing", F32, RW, UNMAPPED, S(Setting::WindingToHousing); "K/W", 1.0, within(0.01, 100.0);
            "Thermal resistance from winding to housing"
        4, "housing to ambient", F32, RW, UNMAPPED, S(Setting::HousingToAmbient); "K/W", 1.0, within(0.01, 100.0);
            "Thermal resistance from housing to surroundings"
        5, "ambient temperature", F32, RW, UNMAPPED, S(Setting::Ambient); "°C", 1.0, within(-40.0, 85.0);
            "Temperature of the surroundings"
    }
    0x2107 "open loop" {
        1, "open-loop frame", U64, RW, RECEIVE, Set(SetPoint::OpenLoop); "", 1.0, ANY;
            "Mode -2. Four numbers of 16 bits, the lowest first: voltage along the field, mV, phase amplitude; speed of the field, signed, 0.01 electrical turns/s, 50 turns/s at most; \
             amplitudes of a voltage that alternates with an eighth of 2108h:16 along the field and across it, mV. Slewed at 50 V/s; lowered beyond 2101h:5. Each one renews a deadline of 0.1 s"
    }
    0x2108 "open-loop window" {
        1, "window number", U32, RO, UNMAPPED, W(Window::Number); "", 1.0, ANY;
            "Windows of 128 control steps since the start; 0 none yet. Reading it holds the others, which are means of that window"
        2, "window's current along", F32, RO, UNMAPPED, W(Window::CurrentAlong); "A", 1.0, ANY;
            "Current along the field"
        3, "window's current across", F32, RO, UNMAPPED, W(Window::CurrentAcross); "A", 1.0, ANY;
            "Current across the field"
        4, "window's voltage along", F32, RO, UNMAPPED, W(Window::VoltageAlong); "V", 1.0, ANY;
            "Voltage along the field, without what dead-time compensation adds"
        5, "window's voltage across", F32, RO, UNMAPPED, W(Window::VoltageAcross); "V", 1.0, ANY;
            "Voltage across the field"
        6, "in-phase current along", F32, RO, UNMAPPED, W(Window::InPhaseAlong); "A", 1.0, ANY;
            "Amplitude of the current along the field, in phase with sin(2 pi n / 8) of the window's step n, as the alternating voltage that is computed in that step"
        7, "quadrature current along", F32, RO, UNMAPPED, W(Window::QuadratureAlong); "A", 1.0, ANY;
            "The same with cos(2 pi n / 8)"
        8, "in-phase current across", F32, RO, UNMAPPED, W(Window::InPhaseAcross); "A", 1.0, ANY;
            "As sub-index 6, across the field"
        9, "quadrature current across", F32, RO, UNMAPPED, W(Window::QuadratureAcross); "A", 1.0, ANY;
            "As sub-index 7, across the field"
        10, "alternating voltage along", F32, RO, UNMAPPED, W(Window::AlternatingAlong); "V", 1.0, ANY;
            "Amplitude of the alternating voltage along the field"
        11, "alternating voltage across", F32, RO, UNMAPPED, W(Window::AlternatingAcross); "V", 1.0, ANY;
            "Amplitude of the alternating voltage across the field"
        12, "window's encoder", U32, RO, UNMAPPED, W(Window::Encoder); "turns", 1.0 / 4_294_967_296.0, ANY;
            "Encoder in the window's last step"
        13, "window's field", U32, RO, UNMAPPED, W(Window::Field); "turns", 1.0 / 4_294_967_296.0, ANY;
            "Angle of the field in the window's last step, electrical turns from phase A; 0 when the state begins"
        14, "window's supply", F32, RO, UNMAPPED, W(Window::BusVoltage); "V", 1.0, ANY;
            "Supply"
        15, "encoder referenced", Bool, RO, UNMAPPED, W(Window::Referenced); "", 1.0, ANY;
            "1 where the encoder's zero is known: always with an absolute one, from the index on with an incremental one"
        16, "control rate", U32, RO, UNMAPPED, W(Window::ControlRate); "Hz", 1.0, ANY;
            "Control steps a second"
    }
    0x2109 "holding brake" {
        1, "brake release time", F32, RW, UNMAPPED, S(Setting::BrakeRelease); "s", 1.0, within(0.0, 5.0);
            "For so long an enabled joint holds where it is before it follows a target"
        2, "brake apply time", F32, RW, UNMAPPED, S(Setting::BrakeApply); "s", 1.0, within(0.0, 5.0);
            "For so long a joint that has stopped goes on bearing its load before the bridge is off"
    }
}
