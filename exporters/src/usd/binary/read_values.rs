//! Reads the values of a binary file that our writer stores. Decoded arrays are cached, because variants share them.

use super::read_tables::{Cursor, ReadTables};
use super::{COMPRESSED_LENGTH_MIN, FORM_TYPES, Rep, codec, list_op, types};
use crate::usd::layer::Metadata;
use crate::usd::text_read::DEPTH_MAX;
use crate::usd::value::{Form, Numbers, Value};
use crate::{Error, Result, quoted};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// Reads values at their words.
pub(super) struct Values<'a> {
    bytes: &'a [u8],
    tables: &'a ReadTables,
    path: &'a Path,
    /// Arrays of numbers by their word.
    arrays: HashMap<Rep, Value>,
    budget_bytes: u64,
    /// Length of the value in the file that was read last; 0 if its word held it or it was read before.
    pub(super) last_bytes: u64,
}

type Words<T> = Result<T, String>;

impl<'a> Values<'a> {
    pub(super) fn new(bytes: &'a [u8], tables: &'a ReadTables, path: &'a Path, budget_bytes: u64) -> Self {
        Self { bytes, tables, path, arrays: HashMap::new(), budget_bytes, last_bytes: 0 }
    }

    pub(super) fn invalid(&self, name: &str, what: impl std::fmt::Display) -> Error {
        invalid!(self.path, "{}: {what}", quoted(name))
    }

    pub(super) fn unsupported(&self, name: &str, what: impl std::fmt::Display) -> Error {
        let what = format!("{}: {what}, which files of this program do not have", quoted(name));
        Error::unsupported(self.path, what)
    }

    /// Counts memory that is about to be taken.
    pub(super) fn spend(&mut self, num_bytes: usize) -> Result<()> {
        self.budget_bytes = self.budget_bytes.checked_sub(num_bytes as u64).ok_or_else(|| {
            Error::too_large(self.path, "the values decode to more bytes than the limit allows")
        })?;
        Ok(())
    }

    /// The file from a value's place on.
    fn at(&self, rep: Rep, name: &str) -> Result<Cursor<'a>> {
        let rest = usize::try_from(rep.payload()).ok().and_then(|at| self.bytes.get(at..));
        let cut = || format!("value at byte {} of {}", rep.payload(), self.bytes.len());
        rest.map(|rest| Cursor { rest }).ok_or_else(|| self.invalid(name, cut()))
    }

    /// Reads a value; `name` is for messages.
    pub(super) fn read(&mut self, rep: Rep, name: &str, depth: usize) -> Result<Value> {
        self.last_bytes = 0;
        if depth > DEPTH_MAX {
            return Err(self.unsupported(name, format!("dictionaries nested more than {DEPTH_MAX} deep")));
        }
        if let Some(value) = self.arrays.get(&rep) {
            return Ok(value.clone());
        }
        let of_form = |(form, types): &(Form, [u8; 3])| {
            Some((*form, types.iter().position(|&t| t == rep.value_type() && t != 0)?))
        };
        if let Some((form, scalar)) = FORM_TYPES.iter().find_map(of_form) {
            let value = match scalar {
                0 => Value::Ints(self.numbers(rep, form, name, i32::from_le_bytes)?),
                1 => Value::Floats(self.numbers(rep, form, name, f32::from_le_bytes)?),
                _ => Value::Doubles(self.numbers(rep, form, name, f64::from_le_bytes)?),
            };
            if rep.payload() != 0 {
                self.arrays.insert(rep, value.clone());
            }
            return Ok(value);
        }
        const NONE: u64 = 0;
        match (rep.value_type(), rep.flags()) {
            (types::BOOL, Rep::INLINED) => Ok(Value::Bool(rep.word() != 0)),
            (types::TOKEN, Rep::INLINED) => {
                Ok(Value::Token(self.text(ReadTables::token, rep.word(), name)?))
            }
            (types::ASSET, Rep::INLINED) => {
                Ok(Value::Asset(self.text(ReadTables::token, rep.word(), name)?))
            }
            (types::STRING, Rep::INLINED) => {
                Ok(Value::String(self.text(ReadTables::string, rep.word(), name)?))
            }
            (types::TOKEN, Rep::ARRAY) | (types::TOKEN_VECTOR, NONE) => {
                Ok(Value::Tokens(self.tokens(rep, name)?))
            }
            (types::TOKEN_LIST_OP, NONE) => {
                let tokens = self.list(rep, list_op::PREPENDED, name)?;
                Ok(Value::Prepended(self.texts(&tokens, name)?))
            }
            (types::DICTIONARY, NONE) => Ok(Value::Dictionary(self.dictionary(rep, name, depth)?)),
            (other, flags) => {
                let what = format!("a value of type {other} with the flags {:#x}", flags >> 56);
                Err(self.unsupported(name, what))
            }
        }
    }

    /// Numbers as our writer stores them: single ones of 32 bits in the word, long arrays of integers compressed.
    fn numbers<T: Copy, const N: usize>(
        &mut self,
        rep: Rep,
        form: Form,
        name: &str,
        from_bytes: impl Fn([u8; N]) -> T,
    ) -> Result<Numbers<T>> {
        let width = form.width();
        let is_array = rep.flags() & Rep::ARRAY != 0;
        let is_int = rep.value_type() == types::INT;
        let values: Vec<T> = match rep.flags() {
            Rep::ARRAY if rep.payload() == 0 => Vec::new(),
            Rep::INLINED if form == Form::One && N == 4 => {
                let word = rep.word().to_le_bytes();
                word.first_chunk().map(|word| from_bytes(*word)).into_iter().collect()
            }
            0 | Rep::ARRAY => {
                let mut cursor = self.at(rep, name)?;
                let count = if is_array { cursor.count(N * width) } else { Ok(1) };
                let raw = count.and_then(|count| cursor.bytes(count * N * width));
                let raw = raw.map_err(|what| self.invalid(name, what))?;
                self.spend(raw.len())?;
                self.last_bytes = raw.len() as u64 + if is_array { 8 } else { 0 };
                raw.as_chunks::<N>().0.iter().map(|&v| from_bytes(v)).collect()
            }
            flags if flags == Rep::ARRAY | Rep::COMPRESSED && is_int => {
                let ints = self.compressed(rep, name)?;
                ints.iter().filter_map(|i| i.to_le_bytes().first_chunk().map(|b| from_bytes(*b))).collect()
            }
            flags => {
                let what = format!("numbers of type {} with the flags {:#x}", rep.value_type(), flags >> 56);
                return Err(self.unsupported(name, what));
            }
        };
        let mut values = values;
        if form == Form::Quaternion {
            // The real part is the last in files.
            values.chunks_exact_mut(4).for_each(|q| q.rotate_right(1));
        }
        Ok(Numbers { form, is_array, values: Arc::new(values) })
    }

    fn compressed(&mut self, rep: Rep, name: &str) -> Result<Vec<i32>> {
        let mut cursor = self.at(rep, name)?;
        let read = |cursor: &mut Cursor<'a>| -> Words<(u64, &'a [u8])> {
            let (count, length) = (cursor.u64()?, cursor.count(1)?);
            Ok((count, cursor.bytes(length)?))
        };
        let (count, block) = read(&mut cursor).map_err(|what| self.invalid(name, what))?;
        let count = usize::try_from(count).unwrap_or(usize::MAX);
        // With the integers' bytes before they are unpacked.
        self.spend(count.max(COMPRESSED_LENGTH_MIN).saturating_mul(2 * size_of::<i32>()))?;
        self.last_bytes = 16 + block.len() as u64;
        codec::decompress_ints(block, count).map_err(|what| self.invalid(name, what))
    }

    fn text(
        &mut self,
        of: impl Fn(&'a ReadTables, u32) -> Words<&'a str>,
        index: u32,
        name: &str,
    ) -> Result<String> {
        let text = of(self.tables, index).map_err(|what| self.invalid(name, what))?;
        self.spend(text.len() + size_of::<String>())?;
        Ok(text.to_owned())
    }

    fn texts(&mut self, tokens: &[u32], name: &str) -> Result<Vec<String>> {
        tokens.iter().map(|&token| self.text(ReadTables::token, token, name)).collect()
    }

    /// A counted list of indices.
    fn indices(&mut self, cursor: &mut Cursor<'a>, name: &str) -> Result<Vec<u32>> {
        let count = cursor.count(4).map_err(|what| self.invalid(name, what))?;
        self.spend(4 * count)?;
        (0..count).map(|_| cursor.u32()).collect::<Words<_>>().map_err(|what| self.invalid(name, what))
    }

    fn tokens(&mut self, rep: Rep, name: &str) -> Result<Vec<String>> {
        if rep.payload() == 0 {
            return Ok(Vec::new());
        }
        let mut cursor = self.at(rep, name)?;
        let indices = self.indices(&mut cursor, name)?;
        self.last_bytes = 8 + 4 * indices.len() as u64;
        self.texts(&indices, name)
    }

    /// Indices in a list edit of a kind.
    fn list(&mut self, rep: Rep, kind: u8, name: &str) -> Result<Vec<u32>> {
        let mut cursor = self.at(rep, name)?;
        let [found] = cursor.array().map_err(|what| self.invalid(name, what))?;
        if found != kind {
            return Err(self.unsupported(name, format!("a list edit of kind {found:#x}")));
        }
        let indices = self.indices(&mut cursor, name)?;
        self.last_bytes = 9 + 4 * indices.len() as u64;
        Ok(indices)
    }

    /// Index of the only path in a list.
    pub(super) fn path_index(&mut self, rep: Rep, name: &str) -> Result<u32> {
        if (rep.value_type(), rep.flags()) != (types::PATH_LIST_OP, 0) {
            return Err(self.invalid(name, format!("a value of type {}, expected a path", rep.value_type())));
        }
        match *self.list(rep, list_op::EXPLICIT, name)? {
            [path] => Ok(path),
            ref paths => Err(self.unsupported(name, format!("{} paths, not one", paths.len()))),
        }
    }

    fn dictionary(&mut self, rep: Rep, name: &str, depth: usize) -> Result<Metadata> {
        let mut entries = Metadata::new();
        let mut cursor = self.at(rep, name)?;
        let count = cursor.count(20).map_err(|what| self.invalid(name, what))?;
        let mut num_bytes = 8;
        for _ in 0..count {
            let entry = [cursor.u32().map(u64::from), cursor.u64(), cursor.u64()];
            let [Ok(key), Ok(offset), Ok(rep)] = entry else {
                return Err(self.invalid(name, "a truncated dictionary"));
            };
            if offset != 8 {
                return Err(self.unsupported(name, "values apart from their dictionary"));
            }
            let key = self.text(ReadTables::string, key as u32, name)?;
            self.spend(size_of::<Value>())?;
            let value = self.read(Rep(rep), &key, depth + 1)?;
            num_bytes += 20 + self.last_bytes;
            entries.push((key, value));
        }
        self.last_bytes = num_bytes;
        Ok(entries)
    }

    /// The variant set that is chosen from, and its variant.
    pub(super) fn variant_selection(&mut self, rep: Rep, name: &str) -> Result<(String, String)> {
        if (rep.value_type(), rep.flags()) != (types::VARIANT_SELECTION, 0) {
            return Err(self.invalid(name, format!("a choice of type {}", rep.value_type())));
        }
        let mut cursor = self.at(rep, name)?;
        let (count, set, variant) =
            match [cursor.u64(), cursor.u32().map(u64::from), cursor.u32().map(u64::from)] {
                [Ok(count), Ok(set), Ok(variant)] => (count, set as u32, variant as u32),
                _ => return Err(self.invalid(name, "a truncated choice of variants")),
            };
        if count != 1 {
            return Err(self.unsupported(name, format!("choices from {count} variant sets, not one")));
        }
        let set = self.text(ReadTables::string, set, name)?;
        let variant = self.text(ReadTables::string, variant, name)?;
        self.last_bytes = 16;
        Ok((set, variant))
    }
}
