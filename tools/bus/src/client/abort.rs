//! CiA's words for every SDO abort code; host.

use canopen_node::Abort;

/// Meaning of an abort code: CiA 301 section 7.2.4.3.17, table 22.
pub fn description(abort: Abort) -> &'static str {
    match abort.description() {
        "" => match abort.0 {
            // Codes that this project's server never sends, and other nodes do.
            0x0604_0047 => "General internal incompatibility in the device.",
            0x0609_0036 => "Maximum value is less than minimum value.",
            0x060A_0023 => "Resource not available: SDO connection.",
            0x0800_0023 => "Object dictionary dynamic generation fails or no object dictionary is present.",
            _ => "A code that CiA 301 does not list: see the device's manual.",
        },
        text => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_of_the_standard_has_its_text() {
        const TABLE_22: [u32; 31] = [
            0x0503_0000,
            0x0504_0000,
            0x0504_0001,
            0x0504_0002,
            0x0504_0003,
            0x0504_0004,
            0x0504_0005,
            0x0601_0000,
            0x0601_0001,
            0x0601_0002,
            0x0602_0000,
            0x0604_0041,
            0x0604_0042,
            0x0604_0043,
            0x0604_0047,
            0x0606_0000,
            0x0607_0010,
            0x0607_0012,
            0x0607_0013,
            0x0609_0011,
            0x0609_0030,
            0x0609_0031,
            0x0609_0032,
            0x0609_0036,
            0x060A_0023,
            0x0800_0000,
            0x0800_0020,
            0x0800_0021,
            0x0800_0022,
            0x0800_0023,
            0x0800_0024,
        ];
        let mut texts: Vec<_> = TABLE_22.iter().map(|code| description(Abort(*code))).collect();
        texts.sort_unstable();
        texts.dedup();
        assert_eq!(texts.len(), TABLE_22.len());
        assert!(texts.iter().all(|text| !text.contains("does not list")));
        assert!(description(Abort(1)).contains("does not list"));
    }
}
