//! SH degrees of the splats of a chunk, and the bands of coefficients that they share. Streams of a band hold only the
//! splats that have it.

use super::integers::{put_numbers, take_numbers};
use crate::{Error, Result, num_sh_coefficients};
use std::ops::Range;

/// Degrees above 0 up to one, and the coefficients that each adds.
pub fn bands(sh_degree: u32) -> impl Iterator<Item = (u8, Range<usize>)> {
    (1..=sh_degree).map(|degree| (degree as u8, num_sh_coefficients(degree - 1)..num_sh_coefficients(degree)))
}

/// Appends the degrees of splats; none if all are `most`, the largest of the file.
pub fn put_degrees(block: &mut Vec<u8>, degrees: &[u8], most: u32, level: i32) {
    let is_uniform = degrees.iter().all(|&degree| u32::from(degree) == most);
    let numbers = if is_uniform { Vec::new() } else { degrees.iter().map(|&degree| degree.into()).collect() };
    put_numbers(block, &numbers, level);
}

/// Takes the degrees of `n` splats off the front.
///
/// # Errors
/// As [`take_numbers`]; [`Error::Invalid`] for degrees above `most`.
pub fn take_degrees(block: &mut &[u8], n: usize, most: u32) -> Result<Vec<u8>> {
    let numbers = take_numbers(block, n)?;
    if numbers.is_empty() {
        return crate::limits::filled(n, most as u8);
    }
    if numbers.len() != n {
        return Err(Error::invalid(
            "",
            format!("SH degrees: {} numbers, expected {n} or none", numbers.len()),
        ));
    }
    match numbers.iter().find(|&&degree| degree > most) {
        Some(degree) => Err(Error::invalid("", format!("SH degree {degree} of a splat, at most {most}"))),
        None => Ok(numbers.iter().map(|&degree| degree as u8).collect()),
    }
}
