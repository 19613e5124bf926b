//! Streams: numbers, coded by the arithmetic coder, and plain bytes, compressed with zstd.

use super::bits::{put_varint, take_varint};
use super::numbers::{NumberReader, NumberWriter};
use crate::files::limits::with_room;
use crate::{Error, Result};

/// Bytes that zstd makes of one at most: 128 KiB from a block of 4 bytes.
const ZSTD_EXPANSION: usize = 1 << 15;

/// Codecs of streams: bytes as they are, bytes in a zstd frame, numbers.
const STORED: u8 = 0;
const ZSTD: u8 = 1;
const ARITHMETIC: u8 = 2;

/// Maps `0, -1, 1, -2, ...` to `0, 1, 2, 3, ...`.
pub fn zigzag(value: i32) -> u32 {
    ((value << 1) ^ (value >> 31)) as u32
}

/// The inverse of [`zigzag`].
pub fn unzigzag(value: u32) -> i32 {
    (value >> 1) as i32 ^ -((value & 1) as i32)
}

/// No contexts but the numbers before; see [`put_numbers`].
pub fn alone(_: usize, _: &[u32]) -> [u32; 0] {
    []
}

/// Appends a stream of numbers. `contexts` gets the index of a number and the numbers before it.
pub fn put_numbers<const C: usize>(
    out: &mut Vec<u8>,
    numbers: &[u32],
    contexts: impl Fn(usize, &[u32]) -> [u32; C],
) {
    let mut writer = NumberWriter::new(C);
    for (i, &number) in numbers.iter().enumerate() {
        writer.put(number, &contexts(i, &numbers[..i]));
    }
    put_coded(out, writer);
}

/// Appends a stream of numbers that have been coded.
pub fn put_coded(out: &mut Vec<u8>, writer: NumberWriter) {
    let (count, coded) = writer.finish();
    put_stream(out, ARITHMETIC, count, &coded);
}

/// Appends a stream of bytes.
pub fn put_bytes(out: &mut Vec<u8>, bytes: &[u8], level: i32) {
    match compress(bytes, level, &[]).filter(|compressed| compressed.len() < bytes.len()) {
        Some(compressed) => put_stream(out, ZSTD, bytes.len(), &compressed),
        None => put_stream(out, STORED, bytes.len(), bytes),
    }
}

fn put_stream(out: &mut Vec<u8>, codec: u8, count: usize, coded: &[u8]) {
    out.push(codec);
    put_varint(out, count as u64);
    put_varint(out, coded.len() as u64);
    out.extend_from_slice(coded);
}

/// Compresses into a frame without content size, which the file states; `None` if zstd fails or there is nothing to
/// compress. Before the bytes stand those of a dictionary, as if they had been decoded already.
pub fn compress(bytes: &[u8], level: i32, dictionary: &[u8]) -> Option<Vec<u8>> {
    if bytes.is_empty() {
        return None;
    }
    let mut compressor = zstd::bulk::Compressor::with_dictionary(level, dictionary).ok()?;
    compressor.set_parameter(zstd::zstd_safe::CParameter::ContentSizeFlag(false)).ok()?;
    compressor.compress(bytes).ok()
}

/// Takes a stream of numbers off the front, with `contexts` as in [`put_numbers`].
///
/// # Errors
/// [`Error::Invalid`] if it is damaged or holds more than `most` numbers, [`Error::Unsupported`] for an unknown codec,
/// [`Error::TooLarge`] if there is no memory for it.
pub fn take_numbers<const C: usize>(
    block: &mut &[u8],
    most: usize,
    contexts: impl Fn(usize, &[u32]) -> [u32; C],
) -> Result<Vec<u32>> {
    let (count, mut reader) = take_coded(block, most, C)?;
    let mut numbers = with_room(count)?;
    for i in 0..count {
        numbers.push(reader.take(&contexts(i, &numbers)));
    }
    reader.finish()?;
    Ok(numbers)
}

/// Takes a stream of numbers off the front whose numbers will be read one by one: how many, and their reader.
///
/// # Errors
/// As [`take_numbers`].
pub fn take_coded<'a>(
    block: &mut &'a [u8],
    most: usize,
    contexts: usize,
) -> Result<(usize, NumberReader<'a>)> {
    let stream = Stream::take(block, most)?;
    if stream.codec != ARITHMETIC {
        return Err(unknown_codec(stream.codec));
    }
    Ok((stream.count, NumberReader::new(stream.coded, stream.count, contexts)?))
}

/// Takes a stream of exactly `n` numbers off the front.
///
/// # Errors
/// As [`take_numbers`].
pub fn take_exactly<const C: usize>(
    block: &mut &[u8],
    n: usize,
    contexts: impl Fn(usize, &[u32]) -> [u32; C],
) -> Result<Vec<u32>> {
    let numbers = take_numbers(block, n, contexts)?;
    if numbers.len() == n {
        Ok(numbers)
    } else {
        Err(damaged(&format!("{} numbers, expected {n}", numbers.len())))
    }
}

/// No numbers if all are zero: see [`take_or_zeros`].
pub fn unless_zeros(numbers: Vec<u32>) -> Vec<u32> {
    if numbers.iter().all(|&u| u == 0) { Vec::new() } else { numbers }
}

/// Takes a stream of `n` numbers off the front; one without numbers stands for zeros.
///
/// # Errors
/// As [`take_numbers`].
pub fn take_or_zeros<const C: usize>(
    block: &mut &[u8],
    n: usize,
    contexts: impl Fn(usize, &[u32]) -> [u32; C],
) -> Result<Vec<u32>> {
    match take_numbers(block, n, contexts)? {
        numbers if numbers.len() == n => Ok(numbers),
        numbers if numbers.is_empty() => crate::files::limits::filled(n, 0),
        numbers => Err(damaged(&format!("{} numbers, expected {n} or none", numbers.len()))),
    }
}

/// Takes a stream of exactly `count` bytes off the front.
///
/// # Errors
/// As [`take_numbers`].
pub fn take_bytes(block: &mut &[u8], count: usize) -> Result<Vec<u8>> {
    let stream = Stream::take(block, count)?;
    let bytes = match stream.codec {
        STORED => stream.coded.to_vec(),
        ZSTD => expand(stream.coded, stream.count, &[])?,
        codec => return Err(unknown_codec(codec)),
    };
    if bytes.len() == count && stream.count == count {
        Ok(bytes)
    } else {
        Err(damaged(&format!("{} bytes, expected {count}", bytes.len())))
    }
}

/// The inverse of [`compress`] for a known number of bytes; refuses sizes that the coded bytes cannot expand to before it
/// allocates.
///
/// # Errors
/// [`Error::Invalid`].
pub fn expand(coded: &[u8], num_bytes: usize, dictionary: &[u8]) -> Result<Vec<u8>> {
    if num_bytes > coded.len().saturating_mul(ZSTD_EXPANSION) {
        return Err(damaged(&format!("{} bytes cannot hold {num_bytes}", coded.len())));
    }
    let mut bytes = crate::files::limits::filled(num_bytes, 0_u8)?;
    let decompressor = zstd::bulk::Decompressor::with_dictionary(dictionary);
    let mut decompressor = decompressor.map_err(|e| damaged(&e.to_string()))?;
    let found = decompressor.decompress_to_buffer(coded, &mut bytes[..]);
    match found.map_err(|e| damaged(&format!("zstd: {e}")))? {
        found if found == num_bytes => Ok(bytes),
        found => Err(damaged(&format!("{found} bytes, expected {num_bytes}"))),
    }
}

fn damaged(what: &str) -> Error {
    invalid!("", "stream: {what}")
}

fn unknown_codec(codec: u8) -> Error {
    unsupported!("", "stream: codec {codec}; supported: 0 and 1 for bytes, 2 for numbers")
}

/// A stream whose sizes have been checked.
struct Stream<'a> {
    codec: u8,
    count: usize,
    coded: &'a [u8],
}

impl<'a> Stream<'a> {
    fn take(block: &mut &'a [u8], most: usize) -> Result<Self> {
        let cut = || damaged("truncated");
        let (&codec, rest) = block.split_first().ok_or_else(cut)?;
        *block = rest;
        let mut size = || usize::try_from(take_varint(block).ok_or_else(cut)?).map_err(|_| cut());
        let [count, coded] = [size()?, size()?];
        if count > most {
            return Err(damaged(&format!("{count} values, expected at most {most}")));
        }
        let (coded, rest) = block.split_at_checked(coded).ok_or_else(cut)?;
        *block = rest;
        Ok(Self { codec, count, coded })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_follow_each_other() {
        let numbers = [5, 0, u32::MAX, 1, 1];
        let mut out = Vec::new();
        put_numbers(&mut out, &numbers, alone);
        put_bytes(&mut out, &[7; 100], 3);
        put_numbers(&mut out, &[], alone);
        let mut rest = out.as_slice();
        assert!(take_exactly(&mut out.as_slice(), 6, alone).is_err());
        assert!(take_numbers(&mut out.as_slice(), 4, alone).is_err(), "more than expected");
        assert_eq!(take_exactly(&mut rest, 5, alone).unwrap(), numbers);
        assert_eq!(take_bytes(&mut rest, 100).unwrap(), [7; 100]);
        assert_eq!(take_or_zeros(&mut rest, 3, alone).unwrap(), [0; 3]);
        assert!(rest.is_empty());
        for value in [0, 1, -1, i32::MAX, i32::MIN, 12345] {
            assert_eq!(unzigzag(zigzag(value)), value);
        }
        assert_eq!([0, -1, 1, -2].map(zigzag), [0, 1, 2, 3]);
    }

    #[test]
    fn decompression_bombs_and_unknown_codecs_are_refused() {
        let mut bomb = Vec::new();
        put_bytes(&mut bomb, &vec![0; 1 << 22], 19);
        assert!(bomb.len() < 300, "{}", bomb.len());
        assert!(take_bytes(&mut bomb.as_slice(), 1 << 20).is_err());
        assert_eq!(take_bytes(&mut bomb.as_slice(), 1 << 22).unwrap().len(), 1 << 22);
        // The head says less than the frame holds.
        let mut lying = bomb.clone();
        lying[1] = 0x81;
        assert!(take_bytes(&mut lying.as_slice(), 1 << 22).is_err());
        // A few bytes that claim gigabytes.
        for codec in [STORED, ZSTD, ARITHMETIC] {
            let mut claim = vec![codec];
            for size in [1_u64 << 40, 4] {
                put_varint(&mut claim, size);
            }
            claim.extend([0; 4]);
            assert!(take_bytes(&mut claim.as_slice(), 1 << 40).is_err());
            assert!(take_numbers(&mut claim.as_slice(), 1 << 40, alone).is_err());
        }
        let mut unknown = Vec::new();
        put_numbers(&mut unknown, &[1, 2, 3], alone);
        for codec in [STORED, ZSTD, 3, 0x12] {
            unknown[0] = codec;
            assert!(matches!(
                take_numbers(&mut unknown.as_slice(), 3, alone),
                Err(Error::Unsupported { .. })
            ));
        }
        unknown[0] = ARITHMETIC;
        assert!(matches!(take_bytes(&mut unknown.as_slice(), 3), Err(Error::Unsupported { .. })));
    }
}
