//! 2100h to 21FFh: the configuration. Limits that depend on other settings are the widest possible.

use super::*;
use crate::objects::field::{
    CalibrationField, ConfigurationField as C, Field::Calibration as K, Field::Configuration as Control,
    Field::Setting as S,
};
use crate::objects::settings::Setting;

room! {
    0x2100 "configuration" {
        1, "command", U8, WO, UNMAPPED, Control(C::Command); "", 1.0, within(1.0, 2.0);
            "1: check what is staged as a whole and take it, with the motor off; 2: forget it. What is taken is stored by 1010h"
        2, "result", U8, RO, UNMAPPED, Control(C::Result); "", 1.0, ANY;
            "Of the last command: 0 done, 1 a setting was refused, 2 the control step has not taken the configuration before"
        3, "refused setting", Text, RO, UNMAPPED, Control(C::RefusedSetting); "", 1.0, ANY;
            "Name of the setting that was refused; empty where none was"
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
            "Largest current"
        6, "pole pairs", U32, RW, UNMAPPED, S(Setting::PolePairs); "", 1.0, within(1.0, 64.0);
            "Electrical turns in a turn of the rotor"
        7, "encoder reversed", U8, RW, UNMAPPED, S(Setting::Direction); "", 1.0, within(0.0, 1.0);
            "1 where the encoder counts down while the field turns forward"
        8, "electrical zero", U32, RW, UNMAPPED, S(Setting::ElectricalZero); "turns", 1.0 / 4_294_967_296.0, ANY;
            "Electrical angle of the encoder where the d axis lies on phase A"
        9, "encoder latency", F32, RW, UNMAPPED, S(Setting::EncoderLatency); "s", 1.0, within(0.0, 1e-3);
            "Age of an encoder sample when the control step sees it"
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
            "Phase current at which the bridge switches off; at least 5 % above the current limit"
        7, "lowest bus voltage", F32, RW, UNMAPPED, S(Setting::LowestBusVoltage); "V", 1.0, within(5.0, 100.0);
            "A fault below it"
        8, "highest bus voltage", F32, RW, UNMAPPED, S(Setting::HighestBusVoltage); "V", 1.0, within(5.0, 100.0);
            "A fault above it; at least 1 V above the lowest"
        9, "bridge temperature limit", F32, RW, UNMAPPED, S(Setting::BridgeTemperature); "°C", 1.0, within(40.0, 150.0);
            "A fault above it"
        10, "winding temperature limit", F32, RW, UNMAPPED, S(Setting::WindingTemperature); "°C", 1.0, within(60.0, 200.0);
            "A fault at it; the current is derated over the last 20 K"
        11, "command deadline", F32, RW, UNMAPPED, S(Setting::CommandDeadline); "s", 1.0, within(1e-3, 10.0);
            "Time without a set-point after which the joint brakes"
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
    0x2107 "calibration" {
        1, "calibration current", F32, RW, UNMAPPED, K(CalibrationField::Current); "A", 1.0, within(0.0, 100.0);
            "Writing a current, 0.1 A or more, measures the motor with it: the joint, which must be switched off, turns by itself there and back. 0 gives it up, and so does any command. \
             What was found goes into 2101h:1, 2, 3, 6, 7 and 8, in use and staged; 1010h stores it"
        2, "calibration progress", U8, RO, UNMAPPED, K(CalibrationField::Progress); "", 1.0, ANY;
            "0 none yet, 1 offsets, 2 resistance, 3 inductance, 4 alignment, 5 ending, 6 done, 7 given up"
        3, "calibration failure", U8, RO, UNMAPPED, K(CalibrationField::Failure); "", 1.0, ANY;
            "Why it was given up: 0 it was not, 1 asked to, 2 too long, 3 supply too low, 4 over-current, 5 encoder lost, 6 rotor moves, 7 offset too large, 8 phase open, \
             9 current not reached, 10 currents do not add up, 11 resistance implausible, 12 ripple too small, 13 not inductive, 14 rotor did not move, 15 rotor slipped, \
             16 and 17 pole pairs unclear or others, 18 lag too large, 19 rotor beside the field"
        4, "calibration failure's value", F32, RO, UNMAPPED, K(CalibrationField::Value); "", 1.0, ANY;
            "What was measured when it was given up, in the failure's unit"
        5, "calibration failure's limit", F32, RO, UNMAPPED, K(CalibrationField::Limit); "", 1.0, ANY;
            "What that was held against"
        6, "lag of the rotor", F32, RO, UNMAPPED, K(CalibrationField::Lag); "turns", 1.0, ANY;
            "How far the rotor lagged behind the field, electrical turns: friction against the current"
        7, "lost voltage", F32, RO, UNMAPPED, K(CalibrationField::LostVoltage); "V", 1.0, ANY;
            "Voltage that a leg loses beyond what dead-time compensation makes up for"
    }
}
