//! Reads values of a binary file. Arrays are kept, so that many uses of one cost nothing.

use super::read_tables::{Cursor, ReadTables};
use super::{FORM_TYPES, Rep, codec, list_op, types};
use crate::usd::layer::Metadata;
use crate::usd::text_read::DEPTH_MAX;
use crate::usd::value::{Form, ListOp, Numbers, Value};
use crate::{Error, Result};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// Reads values.
pub(super) struct Values<'a> {
    bytes: &'a [u8],
    tables: &'a ReadTables,
    path: &'a Path,
    /// Arrays of numbers by their word.
    arrays: HashMap<Rep, Value>,
    /// Bytes that may still be decoded.
    budget: u64,
    /// Length of the value in the file that was read last; 0 if it was held in its word or read before.
    pub(super) last_bytes: u64,
}

type Words<T> = Result<T, String>;

/// Makes the edit of a list.
type Edit = fn(Vec<String>) -> ListOp;

impl<'a> Values<'a> {
    pub(super) fn new(bytes: &'a [u8], tables: &'a ReadTables, path: &'a Path, budget: u64) -> Self {
        Self { bytes, tables, path, arrays: HashMap::new(), budget, last_bytes: 0 }
    }

    fn invalid(&self, name: &str, what: String) -> Error {
        Error::invalid(self.path, format!("{name}: {what}"))
    }

    /// Takes from what may be decoded.
    pub(super) fn spend(&mut self, num_bytes: usize) -> Result<()> {
        self.budget = self.budget.checked_sub(num_bytes as u64).ok_or_else(|| {
            Error::too_large(self.path, "the values decode to more bytes than the limit allows")
        })?;
        Ok(())
    }

    /// Bytes at a value's place.
    fn at(&self, rep: Rep) -> Words<Cursor<'a>> {
        let rest = usize::try_from(rep.payload()).ok().and_then(|at| self.bytes.get(at..));
        rest.map(|rest| Cursor { rest })
            .ok_or_else(|| format!("value at byte {} of {}", rep.payload(), self.bytes.len()))
    }

    /// A value. `name` is for messages.
    pub(super) fn read(&mut self, rep: Rep, name: &str, depth: usize) -> Result<Value> {
        self.last_bytes = 0;
        if depth > DEPTH_MAX {
            let what = format!("{name}: dictionaries nested more than {DEPTH_MAX} deep");
            return Err(Error::unsupported(self.path, what));
        }
        if rep.has(Rep::EDIT) {
            return Err(Error::unsupported(self.path, format!("{name}: edits of arrays")));
        }
        if let Some(value) = self.arrays.get(&rep) {
            return Ok(value.clone());
        }
        let value_type = rep.value_type();
        let scalar = FORM_TYPES.iter().find_map(|(form, by_scalar)| {
            by_scalar.iter().position(|&t| t == value_type && t != 0).map(|scalar| (*form, scalar))
        });
        if let Some((form, scalar)) = scalar {
            return self.read_numbers(rep, form, scalar, name);
        }
        self.read_other(rep, name, depth)
    }

    fn read_other(&mut self, rep: Rep, name: &str, depth: usize) -> Result<Value> {
        let is_array = rep.has(Rep::ARRAY);
        let word = rep.payload() as u32;
        let tables = self.tables;
        let wrong = |what: String| Error::invalid(self.path, format!("{name}: {what}"));
        let text = match (rep.value_type(), is_array) {
            (types::BOOL, false) => return Ok(Value::Bool(word & 0xff != 0)),
            (types::TOKEN | types::ASSET, false) => tables.token(word).map_err(wrong)?,
            (types::STRING, false) => tables.string(word).map_err(wrong)?,
            (types::TOKEN, true) => return Ok(Value::Tokens(self.tokens(rep, name)?)),
            (types::TOKEN_VECTOR, false) => return Ok(Value::Tokens(self.tokens(rep, name)?)),
            (types::TOKEN_LIST_OP, false) => {
                return Ok(Value::TokenList(self.list(rep, name, ReadTables::token)?));
            }
            (types::STRING_LIST_OP, false) => {
                return Ok(Value::TokenList(self.list(rep, name, ReadTables::string)?));
            }
            (types::DICTIONARY, false) => return Ok(Value::Dictionary(self.dictionary(rep, name, depth)?)),
            (other, _) => {
                let array = if is_array { "arrays of " } else { "" };
                return Err(Error::unsupported(self.path, format!("{name}: {array}values of type {other}")));
            }
        };
        self.spend(text.len())?;
        Ok(match rep.value_type() {
            types::TOKEN => Value::Token(text.to_owned()),
            types::ASSET => Value::Asset(text.to_owned()),
            _ => Value::String(text.to_owned()),
        })
    }

    fn read_numbers(&mut self, rep: Rep, form: Form, scalar: usize, name: &str) -> Result<Value> {
        let value = match scalar {
            0 => Value::Ints(self.numbers(rep, form, name, i32::from_le_bytes, |word| word as i32, |i| i)?),
            1 => Value::Floats(
                self.numbers(rep, form, name, f32::from_le_bytes, f32::from_bits, |i| i as f32)?,
            ),
            _ => Value::Doubles(self.numbers(
                rep,
                form,
                name,
                f64::from_le_bytes,
                |word| f32::from_bits(word).into(),
                f64::from,
            )?),
        };
        if rep.has(Rep::ARRAY) && rep.payload() != 0 {
            self.arrays.insert(rep, value.clone());
        }
        Ok(value)
    }

    /// Numbers from bytes, from the word or, vectors of small integers, from the word's bytes.
    fn numbers<T: Copy, const N: usize>(
        &mut self,
        rep: Rep,
        form: Form,
        name: &str,
        from_bytes: impl Fn([u8; N]) -> T,
        from_word: impl Fn(u32) -> T,
        from_int: impl Fn(i32) -> T,
    ) -> Result<Numbers<T>> {
        let is_array = rep.has(Rep::ARRAY);
        let width = form.width();
        if rep.has(Rep::COMPRESSED) {
            return self.compressed(rep, form, name, from_bytes, from_int);
        }
        let mut values: Vec<T> = if is_array && rep.payload() == 0 {
            Vec::new()
        } else if rep.has(Rep::INLINED) && form == Form::One {
            vec![from_word(rep.payload() as u32)]
        } else if rep.has(Rep::INLINED) {
            rep.payload().to_le_bytes()[..width].iter().map(|&b| from_int((b as i8).into())).collect()
        } else {
            let raw = self.raw(rep, N * width, is_array).map_err(|what| self.invalid(name, what))?;
            self.spend(raw.len())?;
            self.last_bytes = raw.len() as u64 + if is_array { 8 } else { 0 };
            let (values, _) = raw.as_chunks::<N>();
            values.iter().map(|&v| from_bytes(v)).collect()
        };
        if form == Form::Quaternion && !rep.has(Rep::INLINED) {
            // The real part is the last in files.
            values.chunks_exact_mut(4).for_each(|q| q.rotate_right(1));
        }
        Ok(Numbers { form, is_array, values: Arc::new(values) })
    }

    /// Bytes of an element or an array.
    fn raw(&self, rep: Rep, element_bytes: usize, is_array: bool) -> Words<&'a [u8]> {
        let mut cursor = self.at(rep)?;
        let count = if is_array { cursor.count(element_bytes)? } else { 1 };
        cursor.bytes(count * element_bytes)
    }

    /// Compressed arrays. We compress integers; other programs also floats that are all integers or few.
    fn compressed<T: Copy, const N: usize>(
        &mut self,
        rep: Rep,
        form: Form,
        name: &str,
        from_bytes: impl Fn([u8; N]) -> T,
        from_int: impl Fn(i32) -> T,
    ) -> Result<Numbers<T>> {
        if form != Form::One || !rep.has(Rep::ARRAY) {
            let what = format!("{name}: compressed arrays of values of type {}", rep.value_type());
            return Err(Error::unsupported(self.path, what));
        }
        let is_int = rep.value_type() == types::INT;
        let (values, num_bytes) =
            self.decompressed(rep, is_int, from_bytes, from_int).map_err(|what| self.invalid(name, what))?;
        self.spend(N * values.len())?;
        self.last_bytes = num_bytes;
        Ok(Numbers { form, is_array: true, values: Arc::new(values) })
    }

    /// The numbers and their length in the file.
    fn decompressed<T: Copy, const N: usize>(
        &self,
        rep: Rep,
        is_int: bool,
        from_bytes: impl Fn([u8; N]) -> T,
        from_int: impl Fn(i32) -> T,
    ) -> Words<(Vec<T>, u64)> {
        let mut cursor = self.at(rep)?;
        let before = cursor.rest.len();
        let count = usize::try_from(cursor.u64()?).unwrap_or(usize::MAX);
        if count.saturating_mul(8) as u64 > self.budget {
            return Err(format!("{count} compressed numbers, more than the limit allows"));
        }
        let code = if is_int { b'i' } else { cursor.array::<1>()?[0] };
        let table: Vec<T> = match code {
            b'i' => Vec::new(),
            b't' => {
                let length = cursor.u32()? as usize;
                let bytes = cursor.bytes(length.saturating_mul(N))?;
                bytes.as_chunks::<N>().0.iter().map(|&b| from_bytes(b)).collect()
            }
            other => return Err(format!("compressed numbers of kind {other}")),
        };
        let length = cursor.count(1)?;
        let ints = codec::decompress_ints(cursor.bytes(length)?, count)?;
        let num_bytes = (before - cursor.rest.len()) as u64;
        if code == b'i' {
            return Ok((ints.into_iter().map(from_int).collect(), num_bytes));
        }
        let entry =
            |i: i32| table.get(i as u32 as usize).copied().ok_or_else(|| format!("entry {i} of a table"));
        Ok((ints.into_iter().map(entry).collect::<Words<_>>()?, num_bytes))
    }

    /// A counted list of indices.
    fn indices(&mut self, cursor: &mut Cursor, name: &str) -> Result<Vec<u32>> {
        let count = cursor.count(4).map_err(|what| self.invalid(name, what))?;
        self.spend(4 * count)?;
        (0..count).map(|_| cursor.u32()).collect::<Words<_>>().map_err(|what| self.invalid(name, what))
    }

    fn texts(
        &mut self,
        indices: &[u32],
        name: &str,
        text: impl Fn(&'a ReadTables, u32) -> Words<&'a str>,
    ) -> Result<Vec<String>> {
        let mut out = Vec::with_capacity(indices.len());
        for &index in indices {
            let text = text(self.tables, index).map_err(|what| self.invalid(name, what))?;
            self.spend(text.len() + size_of::<String>())?;
            out.push(text.to_owned());
        }
        Ok(out)
    }

    fn tokens(&mut self, rep: Rep, name: &str) -> Result<Vec<String>> {
        if rep.payload() == 0 {
            return Ok(Vec::new());
        }
        let mut cursor = self.at(rep).map_err(|what| self.invalid(name, what))?;
        let indices = self.indices(&mut cursor, name)?;
        self.last_bytes = 8 + 4 * indices.len() as u64;
        self.texts(&indices, name, ReadTables::token)
    }

    fn list(
        &mut self,
        rep: Rep,
        name: &str,
        text: impl Fn(&'a ReadTables, u32) -> Words<&'a str>,
    ) -> Result<ListOp> {
        let (edit, indices) = self.list_indices(rep, name)?;
        let items = self.texts(&indices, name, text)?;
        Ok(edit(items))
    }

    /// Indices of a list edit and which edit it is.
    fn list_indices(&mut self, rep: Rep, name: &str) -> Result<(Edit, Vec<u32>)> {
        let mut cursor = self.at(rep).map_err(|what| self.invalid(name, what))?;
        let [bits] = cursor.array().map_err(|what| self.invalid(name, what))?;
        let edit: Edit = match bits & !list_op::EXPLICIT {
            0 | list_op::HAS_EXPLICIT => ListOp::Explicit,
            list_op::HAS_PREPENDED => ListOp::Prepend,
            list_op::HAS_APPENDED => ListOp::Append,
            other => {
                let known = list_op::HAS_ADDED | list_op::HAS_DELETED | list_op::HAS_ORDERED;
                let what = if other & known != 0 { "added, deleted or ordered" } else { "several" };
                return Err(Error::unsupported(self.path, format!("{name}: list edits: {what}")));
            }
        };
        let indices =
            if bits & !list_op::EXPLICIT == 0 { Vec::new() } else { self.indices(&mut cursor, name)? };
        self.last_bytes = 9 + 4 * indices.len() as u64;
        Ok((edit, indices))
    }

    /// Indices of the paths in a list.
    pub(super) fn path_indices(&mut self, rep: Rep, name: &str) -> Result<Vec<u32>> {
        if rep.value_type() != types::PATH_LIST_OP || rep.has(Rep::ARRAY | Rep::INLINED) {
            return Err(self.invalid(name, format!("value of type {}, expected paths", rep.value_type())));
        }
        Ok(self.list_indices(rep, name)?.1)
    }

    fn dictionary(&mut self, rep: Rep, name: &str, depth: usize) -> Result<Metadata> {
        if rep.has(Rep::INLINED) {
            return Ok(Metadata::new());
        }
        let mut entries = Metadata::new();
        let mut cursor = self.at(rep).map_err(|what| self.invalid(name, what))?;
        let count = cursor.count(20).map_err(|what| self.invalid(name, what))?;
        let mut num_bytes = 8;
        for _ in 0..count {
            let (key, rep) = self.entry(&mut cursor).map_err(|what| self.invalid(name, what))?;
            self.spend(key.len() + size_of::<Value>())?;
            let value = self.read(rep, &format!("{name}:{key}"), depth + 1)?;
            num_bytes += 20 + self.last_bytes;
            entries.push((key, value));
        }
        self.last_bytes = num_bytes;
        Ok(entries)
    }

    /// A key and the word of its value, to which an offset leads.
    fn entry(&self, cursor: &mut Cursor<'a>) -> Words<(String, Rep)> {
        let key = self.tables.string(cursor.u32()?)?.to_owned();
        let mut rest = cursor.clone();
        let offset = u64::from_le_bytes(rest.array()?);
        let offset = usize::try_from(offset).map_err(|_| format!("offset {offset}"))?;
        let mut at = cursor.clone();
        at.bytes(offset)?;
        let rep = Rep(at.u64()?);
        *cursor = at;
        Ok((key, rep))
    }

    /// Chosen variants by set.
    pub(super) fn variant_selection(&mut self, rep: Rep) -> Result<Vec<(String, String)>> {
        let name = "variantSelection";
        if rep.value_type() != types::VARIANT_SELECTION {
            return Err(self.invalid(name, format!("value of type {}", rep.value_type())));
        }
        let mut cursor = self.at(rep).map_err(|what| self.invalid(name, what))?;
        let count = cursor.count(8).map_err(|what| self.invalid(name, what))?;
        let mut chosen = Vec::new();
        for _ in 0..count {
            let pair = [cursor.u32(), cursor.u32()];
            let texts = pair.map(|index| index.and_then(|i| self.tables.string(i)));
            let [set, variant] = texts.map(|text| text.map_err(|what| self.invalid(name, what)));
            let (set, variant) = (set?, variant?);
            self.spend(set.len() + variant.len() + 48)?;
            chosen.push((set.to_owned(), variant.to_owned()));
        }
        self.last_bytes = 8 + 8 * count as u64;
        Ok(chosen)
    }
}
