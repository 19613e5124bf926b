//! Single bits and variable-length numbers.

/// Collects bits into bytes, least significant first.
#[derive(Default)]
pub struct BitWriter {
    bytes: Vec<u8>,
    pending: u64,
    num_pending: u32,
}

impl BitWriter {
    /// Appends the lowest `count` bits of a value; `count` is at most 32.
    pub fn put(&mut self, value: u32, count: u32) {
        self.pending |= (u64::from(value) & ((1 << count) - 1)) << self.num_pending;
        self.num_pending += count;
        while self.num_pending >= 8 {
            self.bytes.push(self.pending as u8);
            self.pending >>= 8;
            self.num_pending -= 8;
        }
    }

    /// The bytes, the last padded with zeros.
    pub fn finish(mut self) -> Vec<u8> {
        if self.num_pending > 0 {
            self.bytes.push(self.pending as u8);
        }
        self.bytes
    }
}

/// Reads what [`BitWriter`] wrote.
pub struct BitReader<'a> {
    bytes: &'a [u8],
    pending: u64,
    num_pending: u32,
}

impl<'a> BitReader<'a> {
    /// Begins at the first byte.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, pending: 0, num_pending: 0 }
    }

    /// Takes the next `count` bits, at most 32; `None` beyond the end.
    pub fn take(&mut self, count: u32) -> Option<u32> {
        while self.num_pending < count {
            let (&first, rest) = self.bytes.split_first()?;
            self.pending |= u64::from(first) << self.num_pending;
            self.num_pending += 8;
            self.bytes = rest;
        }
        let value = self.pending & ((1 << count) - 1);
        self.pending >>= count;
        self.num_pending -= count;
        Some(value as u32)
    }

    /// Whether everything but the padding of the last byte was read.
    pub fn is_spent(&self) -> bool {
        self.bytes.is_empty() && self.num_pending < 8 && self.pending == 0
    }
}

/// Appends a number of up to 64 bits: seven bits per byte, lowest first, the top bit set in all bytes but the last.
pub fn put_varint(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

/// Takes such a number off the front; `None` if it is truncated or exceeds 64 bits.
pub fn take_varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0_u64;
    for shift in (0..64).step_by(7) {
        let (&first, rest) = bytes.split_first()?;
        *bytes = rest;
        let part = u64::from(first & 0x7f);
        if shift == 63 && part > 1 {
            return None;
        }
        value |= part << shift;
        if first < 0x80 {
            return Some(value);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_and_varints_round_trip() {
        let mut writer = BitWriter::default();
        let values = [(5, 3), (0, 0), (u32::MAX, 32), (1, 1), (0x1234, 13), (0, 7)];
        for (value, count) in values {
            writer.put(value, count);
        }
        let bytes = writer.finish();
        assert_eq!(bytes.len(), 7);
        let mut reader = BitReader::new(&bytes);
        for (value, count) in values {
            assert_eq!(reader.take(count), Some((u64::from(value) & ((1 << count) - 1)) as u32));
        }
        assert!(reader.is_spent() && reader.take(1).is_none());
        for value in [0, 127, 128, 300, u64::from(u32::MAX), u64::MAX] {
            let mut bytes = Vec::new();
            put_varint(&mut bytes, value);
            let mut rest = bytes.as_slice();
            assert_eq!((take_varint(&mut rest), rest.len()), (Some(value), 0));
            assert_eq!(take_varint(&mut &bytes[..bytes.len() - 1]), None);
        }
        assert_eq!(take_varint(&mut [0xff; 11].as_slice()), None);
    }
}
