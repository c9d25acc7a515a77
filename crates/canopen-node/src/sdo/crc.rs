//! The CRC of block transfers: CiA 301 section 7.2.4.3.16, polynomial x^16 + x^12 + x^5 + 1 from 0, known as
//! CRC-16/XMODEM.

/// CRC without a table: a block of 889 bytes takes less time than its frames do, and flash is scarce.
const CRC: crc::Crc<u16, crc::NoTable> = crc::Crc::<u16, crc::NoTable>::new(&crc::CRC_16_XMODEM);

/// The CRC of what came so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BlockCrc(u16);

impl BlockCrc {
    pub(super) fn update(&mut self, data: &[u8]) {
        // Neither reflected nor inverted at the end: the register is the checksum.
        let mut digest = CRC.digest_with_initial(self.0);
        digest.update(data);
        self.0 = digest.finalize();
    }

    pub(super) fn value(self) -> u16 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_give_the_checksum_of_the_whole() {
        // The check value that CiA 301 gives for "123456789".
        let mut whole = BlockCrc::default();
        whole.update(b"123456789");
        assert_eq!(whole.value(), 0x31C3);
        let mut pieces = BlockCrc::default();
        for piece in [&b"1234567"[..], b"", b"89"] {
            pieces.update(piece);
        }
        assert_eq!(pieces.value(), 0x31C3);
    }
}
