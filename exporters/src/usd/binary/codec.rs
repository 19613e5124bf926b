//! Compression of tables and integer arrays in binary files: differences with 2-bit codes for their widths, then LZ4.

/// Bytes of a difference by its code; code 0 is the most common difference.
const WIDTHS: [usize; 4] = [0, 1, 2, 4];

/// Bytes that LZ4 makes of one at most.
const LZ4_EXPANSION_MAX: usize = 255;

/// Compresses bytes: a zero, for a single piece, and an LZ4 block.
pub(super) fn compress(bytes: &[u8]) -> Vec<u8> {
    let mut out = vec![0];
    out.extend(lz4_flex::block::compress(bytes));
    out
}

/// The inverse of [`compress`], for at most `bytes_max` bytes.
pub(super) fn decompress(block: &[u8], bytes_max: usize) -> Result<Vec<u8>, String> {
    let Some((0, lz4)) = block.split_first().map(|(pieces, rest)| (*pieces, rest)) else {
        return Err("compressed block of several pieces or without any".to_owned());
    };
    let most = lz4.len().saturating_mul(LZ4_EXPANSION_MAX).saturating_add(64).min(bytes_max);
    let mut out = vec![0; most];
    let length = lz4_flex::block::decompress_into(lz4, &mut out).map_err(|e| format!("LZ4 block: {e}"))?;
    out.truncate(length);
    Ok(out)
}

/// Compresses integers, best if neighbours differ little.
pub(super) fn compress_ints(values: &[i32]) -> Vec<u8> {
    let mut last = 0_i32;
    let differences: Vec<i32> =
        values.iter().map(|&v| v.wrapping_sub(std::mem::replace(&mut last, v))).collect();
    let common = commonest(&differences);
    let mut out = common.to_le_bytes().to_vec();
    let first_code = out.len();
    out.resize(first_code + values.len().div_ceil(4), 0);
    for (i, &d) in differences.iter().enumerate() {
        let code = match d {
            d if d == common => 0,
            d if i8::try_from(d).is_ok() => 1,
            d if i16::try_from(d).is_ok() => 2,
            _ => 3,
        };
        out[first_code + i / 4] |= code << (2 * (i % 4));
        out.extend_from_slice(&d.to_le_bytes()[..WIDTHS[usize::from(code)]]);
    }
    compress(&out)
}

/// The most common value; of several, the largest.
fn commonest(values: &[i32]) -> i32 {
    let mut counts = std::collections::HashMap::new();
    for &v in values {
        *counts.entry(v).or_insert(0_usize) += 1;
    }
    counts.into_iter().map(|(v, n)| (n, v)).max().map_or(0, |(_, v)| v)
}

/// The inverse of [`compress_ints`] for `count` integers.
pub(super) fn decompress_ints(block: &[u8], count: usize) -> Result<Vec<i32>, String> {
    let num_codes = count.div_ceil(4);
    let bytes_max = count.saturating_mul(4).saturating_add(num_codes).saturating_add(4);
    let bytes = decompress(block, bytes_max)?;
    let cut = || format!("{} bytes are too few for {count} compressed integers", bytes.len());
    // This also bounds the count before anything is allocated for it.
    let (common, rest) = bytes.split_first_chunk::<4>().ok_or_else(cut)?;
    let (codes, mut rest) = rest.split_at_checked(num_codes).ok_or_else(cut)?;
    let common = i32::from_le_bytes(*common);
    let mut values = Vec::with_capacity(count);
    let mut last = 0_i32;
    for i in 0..count {
        let code = codes[i / 4] >> (2 * (i % 4)) & 3;
        let width = WIDTHS[usize::from(code)];
        let (field, after) = rest.split_at_checked(width).ok_or_else(cut)?;
        rest = after;
        let difference = match *field {
            [a] => i32::from(a as i8),
            [a, b] => i32::from(i16::from_le_bytes([a, b])),
            [a, b, c, d] => i32::from_le_bytes([a, b, c, d]),
            _ => common,
        };
        last = last.wrapping_add(difference);
        values.push(last);
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_round_trip_and_damage_is_an_error() {
        let mut random = crate::asset::tests::random(5);
        let mixed: Vec<i32> = (0..1000).map(|i| (random(1 << 24) << 8) as i32 >> (i % 4 * 8)).collect();
        let cases = [
            vec![],
            vec![7],
            vec![0; 100],
            (0..77).collect(),
            vec![i32::MIN, i32::MAX, i32::MIN, 0, -1],
            mixed,
        ];
        for values in cases {
            let block = compress_ints(&values);
            assert_eq!(decompress_ints(&block, values.len()).unwrap(), values);
            assert!(decompress_ints(&block, 4 * values.len() + 40).is_err(), "more than there are");
            for cut in 0..block.len() {
                assert!(decompress_ints(&block[..cut], values.len()).is_err(), "cut to {cut}");
            }
        }
        // A thousand equal numbers take next to nothing.
        assert!(compress_ints(&[3; 1000]).len() < 30);
        // A count beyond all bounds allocates nothing for it.
        assert!(decompress_ints(&compress_ints(&[1, 2, 3]), usize::MAX).is_err());
    }
}
