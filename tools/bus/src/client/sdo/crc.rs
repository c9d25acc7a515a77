//! The CRC of block transfers: polynomial x^16 + x^12 + x^5 + 1, initial value 0 (CiA 301 section 7.2.4.3.16); host.

/// CRC of all of `data`.
pub(super) fn crc(data: &[u8]) -> u16 {
    data.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte) << 8, |crc, _| crc << 1 ^ if crc & 0x8000 != 0 { 0x1021 } else { 0 })
    })
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_check_value_is_that_of_the_standard() {
        // CiA 301 gives 31C3h for "123456789".
        assert_eq!(super::crc(b"123456789"), 0x31C3);
    }
}
