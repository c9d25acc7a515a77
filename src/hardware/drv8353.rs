//! DRV8353S gate driver: coding of its registers, and names of its faults.
//!
//! Sources: TI SLVSDY6, "Register maps", and the tables of codes in the vendor's firmware (fw/drv8323.cc), read not
//! copied; both agree with a second public header of the register fields. Frames of 16 bits: bit 15 reads, bits 14 to
//! 11 are the register, bits 10 to 0 the data.
//!
//! | register | bits |
//! |---|---|
//! | 0 fault status 1 | 10 any fault, 9 VDS over-current, 8 gate drive, 7 under-voltage lock-out, 6 thermal shutdown, 5 to 0 VDS over-current of HA, LA, HB, LB, HC, LC |
//! | 1 fault status 2 | 10 to 8 over-current of the sense amplifiers A, B, C, 7 thermal warning, 6 under-voltage of the gate drive's supply, 5 to 0 gate drive of HA, LA, HB, LB, HC, LC |
//! | 2 driver control | 10 a fault switches all half bridges off (OCP_ACT), 9 gate supply's under-voltage disabled, 8 gate drive fault disabled, 7 thermal warning reported, 6 and 5 inputs (0 six, 1 three, 2 one PWM, 3 independent), 4 and 3 of one PWM, 2 coast, 1 brake, 0 clear faults (CLR_FLT; clears itself) |
//! | 3 high-side gates | 10 to 8 lock (011b unlocks, 110b locks), 7 to 4 source current, 3 to 0 sink current |
//! | 4 low-side gates | 10 faults clear cycle by cycle (CBC), 9 and 8 drive time, 7 to 4 source current, 3 to 0 sink current |
//! | 5 over-current | 10 retry time (0 8 ms, 1 50 µs), 9 and 8 dead time, 7 and 6 mode (0 latched, 1 retry, 2 reported, 3 none), 5 and 4 deglitch time, 3 to 0 VDS level |
//! | 6 amplifiers | 10 low-side VDS as the sense, 9 reference halved, 8 low-side reference, 7 and 6 gain (5, 10, 20, 40), 5 sense over-current disabled, 4 to 2 calibration of A, B, C, 1 and 0 its level (0.25, 0.5, 0.75, 1 V) |
//! | 7 | 0 calibration as on the DRV8323 |

/// Fault status 1: any fault; mirrors nFAULT.
pub const FAULT: u16 = 1 << 10;
/// Fault status 1: VDS over-current.
pub const VDS_OVER_CURRENT: u16 = 1 << 9;
/// Fault status 1: gate drive.
pub const GATE_DRIVE: u16 = 1 << 8;
/// Fault status 1: under-voltage lock-out.
pub const UNDER_VOLTAGE: u16 = 1 << 7;
/// Fault status 1: thermal shutdown.
pub const THERMAL_SHUTDOWN: u16 = 1 << 6;
/// Fault status 2: over-current of a sense amplifier.
pub const SENSE_OVER_CURRENT: u16 = 0b111 << 8;
/// Fault status 2: under-voltage of the gate drive's supply.
pub const GATE_SUPPLY: u16 = 1 << 6;

/// Driver control.
pub const CONTROL: u16 = 2;
/// Driver control: clear faults.
pub const CLEAR_FAULTS: u16 = 1;
/// The last register.
pub const LAST: u16 = 7;
/// Amplifiers.
pub const AMPLIFIERS: u16 = 6;
/// Amplifiers: their inputs are shorted, for calibration.
pub const CALIBRATE: u16 = 0b111 << 2;
/// Word read from a bus that nobody drives: the line is pulled up.
pub const SILENCE: u16 = 0x7ff;

/// Codes of a field: what each stands for, in the order of the codes.
const SOURCE_MA: [u16; 16] = [50, 50, 100, 150, 300, 350, 400, 450, 550, 600, 650, 700, 850, 900, 950, 1_000];
const SINK_MA: [u16; 16] =
    [100, 100, 200, 300, 600, 700, 800, 900, 1_100, 1_200, 1_300, 1_400, 1_700, 1_800, 1_900, 2_000];
const VDS_MV: [u16; 16] = [60, 70, 80, 90, 100, 200, 300, 400, 500, 600, 700, 800, 900, 1_000, 1_500, 2_000];
const DRIVE_TIME_NS: [u16; 4] = [500, 1_000, 2_000, 4_000];
const DEAD_TIME_NS: [u16; 4] = [50, 100, 200, 400];
const DEGLITCH_US: [u16; 4] = [1, 2, 4, 8];
const GAIN: [u16; 4] = [5, 10, 20, 40];
const SENSE_MV: [u16; 4] = [250, 500, 750, 1_000];

/// The first code that stands for a value. While compiling: a value that has none does not compile.
const fn code<const N: usize>(values: [u16; N], value: u16) -> u16 {
    let mut code = 0;
    while values[code] != value {
        code += 1;
    }
    code as u16
}

/// Settings of the driver that differ between boards. The rest is the same everywhere: three PWM inputs, over-current
/// latched and switching all half bridges off, faults reported cycle by cycle, reference of the amplifiers halved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Source and sink current of the high-side gates, mA.
    pub high_side: (u16, u16),
    /// Source and sink current of the low-side gates, mA.
    pub low_side: (u16, u16),
    /// Time for which the gates are driven with these, ns.
    pub drive_time: u16,
    /// Dead time between the switches of a half bridge, ns.
    pub dead_time: u16,
    /// Voltage of a transistor that conducts at which it counts as over-current, mV.
    pub vds_level: u16,
    /// Time for which the voltage has to last, µs.
    pub deglitch: u16,
    /// Gain of the current amplifiers.
    pub gain: u16,
    /// Voltage of a shunt at which it counts as over-current, mV.
    pub sense_level: u16,
}

/// Settings of the moteus r4.10 and r4.11, as in the vendor's firmware; the sense level is the vendor's default.
pub const MOTEUS_R4_11: Settings = Settings {
    high_side: (100, 200),
    low_side: (100, 600),
    drive_time: 1_000,
    dead_time: 50,
    vds_level: 700,
    deglitch: 4,
    gain: 20,
    sense_level: 500,
};

impl Settings {
    /// Number and content of the registers that are written, 2 to 7.
    pub const fn registers(&self) -> [(u16, u16); 6] {
        let high = code(SOURCE_MA, self.high_side.0) << 4 | code(SINK_MA, self.high_side.1);
        let low = code(SOURCE_MA, self.low_side.0) << 4 | code(SINK_MA, self.low_side.1);
        [
            (CONTROL, 1 << 10 | 0b01 << 5),
            (3, 0b011 << 8 | high),
            (4, 1 << 10 | code(DRIVE_TIME_NS, self.drive_time) << 8 | low),
            // Latched; the retry time of 8 ms does not count then (the DRV8323 of older boards has 4 ms by the same
            // bit).
            (
                5,
                code(DEAD_TIME_NS, self.dead_time) << 8
                    | code(DEGLITCH_US, self.deglitch) << 4
                    | code(VDS_MV, self.vds_level),
            ),
            (AMPLIFIERS, 1 << 9 | code(GAIN, self.gain) << 6 | code(SENSE_MV, self.sense_level)),
            (LAST, 1),
        ]
    }
}

/// The first thing that both status words name, in words for a log; empty where they name nothing.
pub fn name(status: [u16; 2]) -> &'static str {
    let [first, second] = status;
    if first & second & SILENCE == SILENCE {
        return "does not answer";
    }
    let named = [
        (first & VDS_OVER_CURRENT, "over-current of a transistor"),
        (second & SENSE_OVER_CURRENT, "over-current of a shunt"),
        (first & UNDER_VOLTAGE, "under-voltage lock-out"),
        (second & GATE_SUPPLY, "under-voltage of the gate supply"),
        (first & THERMAL_SHUTDOWN, "thermal shutdown"),
        (first & GATE_DRIVE, "gate drive"),
        (first & FAULT, "fault"),
    ];
    named.iter().find(|(bits, _)| *bits != 0).map_or("", |(_, name)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_registers_of_an_r4_11_are_these() {
        let registers = MOTEUS_R4_11.registers();
        assert_eq!(registers.map(|(number, _)| number), [2, 3, 4, 5, 6, 7]);
        assert_eq!(
            registers.map(|(_, content)| content),
            [
                0b100_0010_0000,
                // Unlocked, 100 mA, 200 mA.
                0b011_0010_0010,
                // Cycle by cycle, 1,000 ns, 100 mA, 600 mA.
                0b101_0010_0100,
                // 50 ns, latched, 4 µs, 700 mV.
                0b000_0010_1010,
                // Halved, 20, 500 mV.
                0b010_1000_0001,
                1,
            ]
        );
    }

    #[test]
    fn a_change_of_a_setting_changes_its_field_alone() {
        let changed = |settings: Settings| {
            let both = MOTEUS_R4_11.registers().into_iter().zip(settings.registers());
            both.map(|((_, before), (_, after))| before ^ after).collect::<Vec<u16>>()
        };
        let of = MOTEUS_R4_11;
        assert_eq!(changed(Settings { high_side: (1_000, 2_000), ..of }), [0, 0b1101_1101, 0, 0, 0, 0]);
        assert_eq!(changed(Settings { low_side: (50, 100), ..of }), [0, 0, 0b0010_0100, 0, 0, 0]);
        assert_eq!(changed(Settings { drive_time: 4_000, ..of }), [0, 0, 0b10 << 8, 0, 0, 0]);
        assert_eq!(changed(Settings { dead_time: 200, ..of }), [0, 0, 0, 0b10 << 8, 0, 0]);
        assert_eq!(changed(Settings { deglitch: 8, ..of }), [0, 0, 0, 0b01 << 4, 0, 0]);
        assert_eq!(changed(Settings { vds_level: 500, ..of }), [0, 0, 0, 0b0010, 0, 0]);
        assert_eq!(changed(Settings { gain: 10, ..of }), [0, 0, 0, 0, 0b11 << 6, 0]);
        assert_eq!(changed(Settings { sense_level: 1_000, ..of }), [0, 0, 0, 0, 0b10, 0]);
    }

    #[test]
    fn the_dead_time_is_what_the_joint_is_told() {
        let told = crate::default_configuration::MOTEUS_R4.bridge.dead_time;
        assert!((f32::from(MOTEUS_R4_11.dead_time) * 1e-9 - told).abs() < 1e-12);
    }

    #[test]
    fn the_documentation_has_the_settings_that_are_written() {
        let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/boards.md")).unwrap();
        let Settings { high_side, low_side, drive_time, dead_time, vds_level, deglitch, gain, sense_level } =
            MOTEUS_R4_11;
        for row in [
            format!("| high-side gates, source and sink current | {} and {} mA |", high_side.0, high_side.1),
            format!("| low-side gates, source and sink current | {} and {} mA |", low_side.0, low_side.1),
            format!("| time for which a gate is driven with these | {drive_time} ns |"),
            format!("| dead time | {dead_time} ns |"),
            format!("| over-current of a transistor, by its voltage (VDS) | {vds_level} mV |"),
            format!("| for at least | {deglitch} µs |"),
            format!("| gain of the current amplifiers | {gain} |"),
            format!("| over-current of a shunt | {sense_level} mV |"),
        ] {
            assert_eq!(text.matches(&row).count(), 1, "docs/boards.md: {row}");
        }
    }

    #[test]
    fn every_kind_of_fault_has_a_name() {
        assert_eq!(name([FAULT | VDS_OVER_CURRENT | 1 << 4, 0]), "over-current of a transistor");
        assert_eq!(name([FAULT, 1 << 9]), "over-current of a shunt");
        assert_eq!(name([FAULT | UNDER_VOLTAGE, 0]), "under-voltage lock-out");
        assert_eq!(name([FAULT, GATE_SUPPLY]), "under-voltage of the gate supply");
        assert_eq!(name([FAULT | THERMAL_SHUTDOWN, 0]), "thermal shutdown");
        assert_eq!(name([FAULT | GATE_DRIVE, 1 << 3]), "gate drive");
        assert_eq!(name([FAULT, 0]), "fault");
        assert_eq!(name([SILENCE; 2]), "does not answer");
        assert_eq!(name([0, 0]), "");
    }
}
