//! Streams of integers in few bytes. A number u >= 0 is split into a class, a byte that is compressed, and the bits that the
//! class leaves open, which are stored: u below 16 is its own class; above that the class holds the length of u and the
//! three bits after its leading one. Small numbers can share a byte, two or four together, with an escape, because zstd
//! takes at least a bit for each byte. The encoder chooses what costs least.

use super::bits::{BitReader, BitWriter, put_varint, take_varint};
use crate::{Error, Result};

/// Smallest number whose class leaves bits open.
const FIRST_OPEN: u32 = 16;

/// Bytes that zstd makes of one at most: 128 KiB from a block of 4 bytes.
const ZSTD_EXPANSION: usize = 1 << 15;

/// How the symbols of a stream are compressed: the low half of the codec byte.
const STORED: u8 = 0;
const ZSTD: u8 = 1;

/// High half of the codec byte for streams of plain bytes; 1, 2 and 3 pack 1, 2 and 4 numbers into a byte.
const PLAIN: u8 = 0;

/// Maps `0, -1, 1, -2, ...` to `0, 1, 2, 3, ...`.
pub fn zigzag(value: i32) -> u32 {
    ((value << 1) ^ (value >> 31)) as u32
}

/// The inverse of [`zigzag`].
pub fn unzigzag(value: u32) -> i32 {
    (value >> 1) as i32 ^ -((value & 1) as i32)
}

/// The class of a number, its open bits and how many these are.
fn class_of(u: u32) -> (u8, u32, u32) {
    if u < FIRST_OPEN {
        return (u as u8, 0, 0);
    }
    let length = 31 - u.leading_zeros();
    let open = length - 3;
    ((16 + 8 * (length - 4) + ((u >> open) & 7)) as u8, u & ((1 << open) - 1), open)
}

/// The smallest number of a class, and how many bits it leaves open; `None` beyond 32 bits.
fn opened(class: u8) -> Option<(u32, u32)> {
    let class = u32::from(class);
    if class < FIRST_OPEN {
        return Some((class, 0));
    }
    let length = 4 + (class - 16) / 8;
    let open = length - 3;
    (length < 32).then(|| ((8 + (class - 16) % 8) << open, open))
}

/// Appends a stream of numbers: codec, then counts of numbers, symbols, coded bytes and bytes of open bits, then both.
pub fn put_numbers(out: &mut Vec<u8>, numbers: &[u32], level: i32) {
    let packing = cheapest_packing(numbers);
    let (symbols, open) = symbols(numbers, packing);
    put_stream(out, packing << 4, numbers.len(), &symbols, &open, level);
}

/// Appends a stream of bytes.
pub fn put_bytes(out: &mut Vec<u8>, bytes: &[u8], level: i32) {
    put_stream(out, PLAIN << 4, bytes.len(), bytes, &[], level);
}

fn put_stream(out: &mut Vec<u8>, packing: u8, count: usize, symbols: &[u8], open: &[u8], level: i32) {
    let compressed = compress(symbols, level).filter(|c| c.len() < symbols.len());
    let (codec, coded) = match &compressed {
        Some(compressed) => (ZSTD, compressed.as_slice()),
        None => (STORED, symbols),
    };
    out.push(packing | codec);
    for size in [count, symbols.len(), coded.len(), open.len()] {
        put_varint(out, size as u64);
    }
    out.extend_from_slice(coded);
    out.extend_from_slice(open);
}

/// Compresses into a frame without content size, which the stream states; `None` if zstd fails or there is nothing to
/// compress.
pub fn compress(bytes: &[u8], level: i32) -> Option<Vec<u8>> {
    if bytes.is_empty() {
        return None;
    }
    let mut compressor = zstd::bulk::Compressor::new(level).ok()?;
    compressor.set_parameter(zstd::zstd_safe::CParameter::ContentSizeFlag(false)).ok()?;
    compressor.compress(bytes).ok()
}

/// Symbols and open bits of numbers.
fn symbols(numbers: &[u32], packing: u8) -> (Vec<u8>, Vec<u8>) {
    let mut open = BitWriter::default();
    let mut class = |u: u32| {
        let (class, bits, count) = class_of(u);
        open.put(bits, count);
        class
    };
    if packing == 1 {
        let bytes = numbers.iter().map(|&u| class(u)).collect();
        return (bytes, open.finish());
    }
    let (per_byte, bits, escape) = packed_shape(packing);
    let pack = |group: &[u32]| (0..).zip(group).fold(0, |byte, (i, &u)| byte | u.min(escape) << (i * bits));
    let mut bytes: Vec<u8> = numbers.chunks(per_byte).map(|group| pack(group) as u8).collect();
    bytes.extend(numbers.iter().filter(|&&u| u >= escape).map(|&u| class(u - escape)));
    (bytes, open.finish())
}

/// Numbers per byte, bits of each, and the escape.
fn packed_shape(packing: u8) -> (usize, u32, u32) {
    if packing == 2 { (2, 4, 15) } else { (4, 2, 3) }
}

/// The packing for which a byte-wise Huffman coder would need the fewest bits, by the entropies of the bytes.
fn cheapest_packing(numbers: &[u32]) -> u8 {
    let cost = |packing: u8| {
        let (bytes, open) = symbols(numbers, packing);
        let body = if packing == 1 { bytes.len() } else { numbers.len().div_ceil(packed_shape(packing).0) };
        let (body, escapes) = bytes.split_at(body);
        let coded: f64 = [body, escapes].iter().map(|part| huffman_bits(part)).sum();
        coded + 8.0 * open.len() as f64
    };
    // Packing does not help where most numbers are large.
    let small = numbers.iter().filter(|&&u| u < 15).count();
    let candidates: &[u8] = if 2 * small < numbers.len() { &[1] } else { &[1, 2, 3] };
    candidates.iter().map(|&p| (p, cost(p))).min_by(|a, b| a.1.total_cmp(&b.1)).map_or(1, |(p, _)| p)
}

/// Estimated size: at least a bit per symbol, and five bits of table for each distinct one.
fn huffman_bits(bytes: &[u8]) -> f64 {
    let mut counts = [0_u32; 256];
    for &b in bytes {
        counts[usize::from(b)] += 1;
    }
    let total = bytes.len() as f64;
    let bits = |n: u32| f64::from(n) * (total / f64::from(n)).log2();
    let occurring = counts.iter().filter(|&&n| n > 0);
    let entropy: f64 = occurring.clone().map(|&n| bits(n)).sum();
    let distinct = occurring.count();
    if distinct <= 1 { 8.0 } else { entropy.max(total) + 5.0 * distinct as f64 }
}

/// Takes a stream of numbers off the front.
///
/// # Errors
/// [`Error::Invalid`] if it is damaged or holds more than `most` numbers, [`Error::Unsupported`] for an unknown codec.
pub fn take_numbers(block: &mut &[u8], most: usize) -> Result<Vec<u32>> {
    let stream = Stream::take(block, most)?;
    let symbols = stream.symbols()?;
    let numbers = match stream.packing {
        1 => unpack_classes(&symbols, stream.open),
        2 | 3 => unpack_shared(&symbols, stream.open, stream.count, stream.packing),
        _ => return Err(unknown_codec(stream.packing << 4 | stream.codec)),
    };
    match numbers {
        Some(numbers) if numbers.len() == stream.count => Ok(numbers),
        _ => Err(damaged("symbols and open bits do not fit each other")),
    }
}

/// Takes a stream of exactly `n` numbers off the front.
///
/// # Errors
/// As [`take_numbers`].
pub fn take_exactly(block: &mut &[u8], n: usize) -> Result<Vec<u32>> {
    let numbers = take_numbers(block, n)?;
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
pub fn take_or_zeros(block: &mut &[u8], n: usize) -> Result<Vec<u32>> {
    match take_numbers(block, n)? {
        numbers if numbers.len() == n => Ok(numbers),
        numbers if numbers.is_empty() => crate::limits::filled(n, 0),
        numbers => Err(damaged(&format!("{} numbers, expected {n} or none", numbers.len()))),
    }
}

/// Takes a stream of exactly `count` bytes off the front.
///
/// # Errors
/// As [`take_numbers`].
pub fn take_bytes(block: &mut &[u8], count: usize) -> Result<Vec<u8>> {
    let stream = Stream::take(block, count)?;
    if stream.packing != PLAIN {
        return Err(unknown_codec(stream.packing << 4 | stream.codec));
    }
    let bytes = stream.symbols()?;
    if bytes.len() == count && stream.open.is_empty() {
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
pub fn expand(coded: &[u8], num_bytes: usize) -> Result<Vec<u8>> {
    if num_bytes > coded.len().saturating_mul(ZSTD_EXPANSION) {
        return Err(damaged(&format!("{} bytes cannot hold {num_bytes}", coded.len())));
    }
    let mut bytes = crate::limits::filled(num_bytes, 0_u8)?;
    let mut decompressor = zstd::bulk::Decompressor::new().map_err(|e| damaged(&e.to_string()))?;
    let found = decompressor.decompress_to_buffer(coded, &mut bytes[..]);
    match found.map_err(|e| damaged(&format!("zstd: {e}")))? {
        found if found == num_bytes => Ok(bytes),
        found => Err(damaged(&format!("{found} bytes, expected {num_bytes}"))),
    }
}

fn damaged(what: &str) -> Error {
    Error::invalid("", format!("stream: {what}"))
}

fn unknown_codec(codec: u8) -> Error {
    Error::unsupported("", format!("stream: codec {codec:#04x}; supported: zstd and stored classes"))
}

/// A stream whose sizes have been checked.
struct Stream<'a> {
    packing: u8,
    codec: u8,
    count: usize,
    num_symbols: usize,
    coded: &'a [u8],
    open: &'a [u8],
}

impl<'a> Stream<'a> {
    fn take(block: &mut &'a [u8], most: usize) -> Result<Self> {
        let cut = || damaged("truncated");
        let (&codec, rest) = block.split_first().ok_or_else(cut)?;
        *block = rest;
        let mut size = || take_varint(block).ok_or_else(cut);
        let [count, num_symbols, coded, open] = [size()?, size()?, size()?, size()?];
        if count > most as u64 || num_symbols > 2 * count + 1 {
            return Err(damaged(&format!(
                "{count} numbers in {num_symbols} symbols, expected at most {most}"
            )));
        }
        if codec & 15 == STORED && num_symbols != coded {
            return Err(damaged(&format!("{coded} bytes for {num_symbols} stored symbols")));
        }
        let mut part = |size: u64| {
            let at = usize::try_from(size).ok().filter(|&size| size <= block.len()).ok_or_else(cut)?;
            let (part, rest) = block.split_at(at);
            *block = rest;
            Ok(part)
        };
        let (coded, open) = (part(coded)?, part(open)?);
        // Both fit: `most` and the block did.
        let (count, num_symbols) = (count as usize, num_symbols as usize);
        Ok(Self { packing: codec >> 4, codec: codec & 15, count, num_symbols, coded, open })
    }

    fn symbols(&self) -> Result<Vec<u8>> {
        let bytes = match self.codec {
            STORED => self.coded.to_vec(),
            ZSTD => return expand(self.coded, self.num_symbols),
            _ => return Err(unknown_codec(self.packing << 4 | self.codec)),
        };
        if bytes.len() == self.num_symbols {
            Ok(bytes)
        } else {
            Err(damaged(&format!("{} symbols, expected {}", bytes.len(), self.num_symbols)))
        }
    }
}

fn unpack_classes(symbols: &[u8], open: &[u8]) -> Option<Vec<u32>> {
    let mut open = BitReader::new(open);
    let number = |&class: &u8| {
        let (first, bits) = opened(class)?;
        Some(if bits == 0 { first } else { first + open.take(bits)? })
    };
    let numbers = symbols.iter().map(number).collect::<Option<Vec<u32>>>()?;
    open.is_spent().then_some(numbers)
}

fn unpack_shared(symbols: &[u8], open: &[u8], count: usize, packing: u8) -> Option<Vec<u32>> {
    let (per_byte, bits, escape) = packed_shape(packing);
    let (body, escapes) = symbols.split_at_checked(count.div_ceil(per_byte))?;
    let escapes = unpack_classes(escapes, open)?;
    let mut escapes = escapes.iter();
    let mut numbers = Vec::with_capacity(count);
    for i in 0..count {
        let byte = u32::from(*body.get(i / per_byte)?);
        let u = (byte >> ((i % per_byte) as u32 * bits)) & escape;
        numbers.push(if u == escape { escapes.next()?.checked_add(escape)? } else { u });
    }
    escapes.next().is_none().then_some(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_round_trip_and_small_ones_take_few_bits() {
        let mut state = 1_u32;
        let mut random = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state >> 8
        };
        // Geometric numbers of several means, with outliers; entropies in bits by hand.
        for (shift, most_bits) in [(0, 0.42), (20, 1.1), (22, 2.6), (24, 6.6)] {
            let mut numbers: Vec<u32> = (0..40_000)
                .map(|_| if shift == 0 { u32::from(random() % 32 == 0) } else { random() >> shift })
                .map(|u| if shift == 20 { u32::from(u & 7 == 0) } else { u })
                .collect();
            let mut out = Vec::new();
            put_numbers(&mut out, &numbers, 19);
            let bits = 8.0 * out.len() as f64 / 40_000.0;
            assert!(bits < most_bits, "shift {shift}: {bits}");
            numbers.extend([u32::MAX, 1 << 31, 16, 15, 3, 0, 17]);
            out.clear();
            put_numbers(&mut out, &numbers, 3);
            let mut rest = out.as_slice();
            assert_eq!(take_numbers(&mut rest, numbers.len()).unwrap(), numbers);
            assert!(rest.is_empty());
            assert!(take_numbers(&mut out.as_slice(), numbers.len() - 1).is_err(), "more than expected");
        }
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
        lying[5] = 0x81;
        assert!(take_bytes(&mut lying.as_slice(), 1 << 22).is_err());
        // A few bytes that claim gigabytes.
        let mut claim = vec![ZSTD];
        for size in [1_u64 << 40, 1 << 40, 4, 0] {
            put_varint(&mut claim, size);
        }
        claim.extend([0; 4]);
        assert!(take_bytes(&mut claim.as_slice(), 1 << 40).is_err());
        let mut unknown = Vec::new();
        put_numbers(&mut unknown, &[1, 2, 3], 3);
        unknown[0] = 0x12;
        assert!(matches!(take_numbers(&mut unknown.as_slice(), 3), Err(Error::Unsupported { .. })));
        unknown[0] = 0x50;
        assert!(matches!(take_numbers(&mut unknown.as_slice(), 3), Err(Error::Unsupported { .. })));
    }
}
