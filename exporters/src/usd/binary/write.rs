//! Writes a layer as a binary file.

use super::tables::Tables;
use super::{
    COMPRESSED_LENGTH_MIN, FORM_TYPES, HEADER_BYTES, MAGIC, Rep, SECTIONS, VERSION, codec, list_op, spec,
    specifier, types,
};
use crate::usd::layer::{Content, Layer, Metadata, Prim, Property, VariantSet};
use crate::usd::value::{Form, Numbers, Value};
use std::collections::HashMap;
use twox_hash::XxHash3_128;

/// Values begin at multiples of this, so that readers can map arrays of any type.
const ALIGNMENT: usize = 16;

/// Encodes a layer.
pub(in crate::usd) fn binary_from_layer(layer: &Layer) -> Vec<u8> {
    let mut writer =
        BinaryWriter { out: vec![0; HEADER_BYTES], tables: Tables::new(), value_by_content: HashMap::new() };
    let mut fields = writer.metadata_fields(&layer.metadata);
    fields.extend(writer.children_field("primChildren", layer.root_prims.iter().map(|p| p.name.as_str())));
    writer.tables.spec(0, fields, spec::PSEUDO_ROOT);
    for prim in &layer.root_prims {
        let path = writer.tables.path(0, &prim.name, false);
        writer.prim(path, prim);
    }
    writer.finish()
}

struct BinaryWriter {
    out: Vec<u8>,
    tables: Tables,
    /// Positions of values by type, flags and digest, so that equal ones are stored once.
    value_by_content: HashMap<(u8, u64, u128), u64>,
}

impl BinaryWriter {
    fn prim(&mut self, path: u32, prim: &Prim) {
        let mut fields = vec![self.specifier(specifier::DEF)];
        if !prim.type_name.is_empty() {
            let rep = self.token_rep(&prim.type_name);
            fields.push(self.tables.field("typeName", rep));
        }
        self.body(path, prim, fields, spec::PRIM);
    }

    /// Adds the spec of a prim or a variant, and everything below it.
    fn body(&mut self, path: u32, prim: &Prim, mut fields: Vec<u32>, kind: u32) {
        fields.extend(self.metadata_fields(&prim.metadata));
        if let Some(set) = &prim.variant_set {
            fields.extend(self.variant_fields(set));
        }
        fields.extend(self.children_field("properties", prim.properties.iter().map(|p| p.name.as_str())));
        fields.extend(self.children_field("primChildren", prim.children.iter().map(|p| p.name.as_str())));
        self.tables.spec(path, fields, kind);
        for property in &prim.properties {
            self.property(path, property);
        }
        for child in &prim.children {
            let child_path = self.tables.path(path, &child.name, false);
            self.prim(child_path, child);
        }
        let Some(set) = &prim.variant_set else { return };
        let set_path = self.tables.path(path, &format!("{{{}=}}", set.name), false);
        let names = set.variants.iter().map(|v| v.name.as_str());
        let fields = self.children_field("variantChildren", names).into_iter().collect();
        self.tables.spec(set_path, fields, spec::VARIANT_SET);
        for variant in &set.variants {
            let element = format!("{{{}={}}}", set.name, variant.name);
            let variant_path = self.tables.path(path, &element, false);
            let over = self.specifier(specifier::OVER);
            self.body(variant_path, variant, vec![over], spec::VARIANT);
        }
    }

    fn specifier(&mut self, specifier: u32) -> u32 {
        self.tables.field("specifier", Rep::inlined(types::SPECIFIER, specifier))
    }

    fn variant_fields(&mut self, set: &VariantSet) -> Vec<u32> {
        let mut fields = Vec::new();
        fields.extend(self.children_field("variantSetChildren", std::iter::once(set.name.as_str())));
        let name = self.tables.string(&set.name);
        let mut list = vec![list_op::PREPENDED];
        push_counted(&mut list, &[name]);
        let rep = self.value(types::STRING_LIST_OP, 0, &list);
        fields.push(self.tables.field("variantSetNames", rep));
        let mut map = 1_u64.to_le_bytes().to_vec();
        map.extend([name, self.tables.string(&set.selection)].iter().flat_map(|v| v.to_le_bytes()));
        let rep = self.value(types::VARIANT_SELECTION, 0, &map);
        fields.push(self.tables.field("variantSelection", rep));
        fields
    }

    fn property(&mut self, prim: u32, property: &Property) {
        let path = self.tables.path(prim, &property.name, true);
        let custom = Rep::inlined(types::BOOL, property.is_custom.into());
        let mut fields = vec![self.tables.field("custom", custom)];
        let kind = match &property.content {
            Content::Attribute { type_name, is_uniform, value, connection } => {
                let rep = self.token_rep(type_name);
                fields.push(self.tables.field("typeName", rep));
                fields.push(self.variability(*is_uniform));
                fields.extend(value.as_ref().map(|value| {
                    let rep = self.rep(value);
                    self.tables.field("default", rep)
                }));
                fields.extend(connection.as_ref().map(|path| self.path_field("connectionPaths", path)));
                spec::ATTRIBUTE
            }
            Content::Relationship { target } => {
                fields.push(self.variability(true));
                fields.push(self.path_field("targetPaths", target));
                spec::RELATIONSHIP
            }
        };
        fields.extend(self.metadata_fields(&property.metadata));
        self.tables.spec(path, fields, kind);
    }

    fn variability(&mut self, is_uniform: bool) -> u32 {
        self.tables.field("variability", Rep::inlined(types::VARIABILITY, is_uniform.into()))
    }

    fn path_field(&mut self, name: &str, path: &str) -> u32 {
        let path = self.tables.path_by_text(path);
        let mut list = vec![list_op::EXPLICIT];
        push_counted(&mut list, &[path]);
        let rep = self.value(types::PATH_LIST_OP, 0, &list);
        self.tables.field(name, rep)
    }

    fn metadata_fields(&mut self, metadata: &Metadata) -> Vec<u32> {
        let mut fields = Vec::new();
        for (name, value) in metadata {
            let rep = self.rep(value);
            fields.push(self.tables.field(name, rep));
        }
        fields
    }

    /// The field with the names of children; `None` if there are none.
    fn children_field<'a>(&mut self, name: &str, children: impl Iterator<Item = &'a str>) -> Option<u32> {
        let tokens: Vec<u32> = children.map(|c| self.tables.token(c)).collect();
        if tokens.is_empty() {
            return None;
        }
        let mut bytes = Vec::new();
        push_counted(&mut bytes, &tokens);
        let rep = self.value(types::TOKEN_VECTOR, 0, &bytes);
        Some(self.tables.field(name, rep))
    }

    fn token_rep(&mut self, text: &str) -> Rep {
        Rep::inlined(types::TOKEN, self.tables.token(text))
    }

    /// Stores a value and returns its word.
    fn rep(&mut self, value: &Value) -> Rep {
        match value {
            Value::Bool(value) => Rep::inlined(types::BOOL, (*value).into()),
            Value::Ints(n) if n.is_array && n.form == Form::One => self.int_array(n),
            Value::Ints(n) => self.numbers(n, 0, |v, out| out.extend(v.to_le_bytes())),
            Value::Floats(n) => self.numbers(n, 1, |v, out| out.extend(v.to_le_bytes())),
            Value::Doubles(n) => self.numbers(n, 2, |v, out| out.extend(v.to_le_bytes())),
            Value::String(text) => Rep::inlined(types::STRING, self.tables.string(text)),
            Value::Token(text) => self.token_rep(text),
            Value::Asset(path) => Rep::inlined(types::ASSET, self.tables.token(path)),
            Value::Tokens(items) if items.is_empty() => Rep::new(types::TOKEN, Rep::ARRAY, 0),
            Value::Tokens(items) => {
                let tokens: Vec<u32> = items.iter().map(|t| self.tables.token(t)).collect();
                let mut bytes = Vec::new();
                push_counted(&mut bytes, &tokens);
                self.value(types::TOKEN, Rep::ARRAY, &bytes)
            }
            Value::Dictionary(entries) => self.dictionary(entries),
            Value::Prepended(items) => {
                let tokens: Vec<u32> = items.iter().map(|t| self.tables.token(t)).collect();
                let mut bytes = vec![list_op::PREPENDED];
                push_counted(&mut bytes, &tokens);
                self.value(types::TOKEN_LIST_OP, 0, &bytes)
            }
        }
    }

    fn dictionary(&mut self, entries: &Metadata) -> Rep {
        let mut bytes = (entries.len() as u64).to_le_bytes().to_vec();
        for (name, value) in entries {
            let rep = self.rep(value);
            bytes.extend(self.tables.string(name).to_le_bytes());
            // Offset from here to the value's word, which follows.
            bytes.extend(8_i64.to_le_bytes());
            bytes.extend(rep.0.to_le_bytes());
        }
        self.value(types::DICTIONARY, 0, &bytes)
    }

    fn int_array(&mut self, numbers: &Numbers<i32>) -> Rep {
        if numbers.values.len() < COMPRESSED_LENGTH_MIN {
            return self.numbers(numbers, 0, |v, out| out.extend(v.to_le_bytes()));
        }
        let block = codec::compress_ints(&numbers.values);
        let mut bytes = (numbers.values.len() as u64).to_le_bytes().to_vec();
        bytes.extend((block.len() as u64).to_le_bytes());
        bytes.extend(block);
        self.value(types::INT, Rep::ARRAY | Rep::COMPRESSED, &bytes)
    }

    fn numbers<T: Copy>(
        &mut self,
        numbers: &Numbers<T>,
        scalar: usize,
        push: impl Fn(T, &mut Vec<u8>),
    ) -> Rep {
        let form_type = FORM_TYPES.iter().find(|(form, _)| *form == numbers.form);
        let value_type = form_type.map_or(0, |(_, by_scalar)| by_scalar[scalar]);
        let flags = if numbers.is_array { Rep::ARRAY } else { 0 };
        if numbers.values.is_empty() {
            return Rep::new(value_type, flags, 0);
        }
        let mut bytes = Vec::with_capacity(8 + numbers.values.len() * size_of::<T>());
        if numbers.is_array {
            bytes.extend((numbers.num_elements() as u64).to_le_bytes());
        }
        if numbers.form == Form::Quaternion {
            for q in numbers.values.chunks_exact(4) {
                [q[1], q[2], q[3], q[0]].into_iter().for_each(|v| push(v, &mut bytes));
            }
        } else {
            numbers.values.iter().for_each(|&v| push(v, &mut bytes));
        }
        // Single numbers of 32 bits are held in the word.
        if let (false, Form::One, &[a, b, c, d]) = (numbers.is_array, numbers.form, bytes.as_slice()) {
            return Rep::inlined(value_type, u32::from_le_bytes([a, b, c, d]));
        }
        self.value(value_type, flags, &bytes)
    }

    /// Stores bytes, unless they are there already, and returns the word that points at them.
    fn value(&mut self, value_type: u8, flags: u64, bytes: &[u8]) -> Rep {
        let out = &mut self.out;
        let at = *self
            .value_by_content
            .entry((value_type, flags, XxHash3_128::oneshot(bytes)))
            .or_insert_with(|| {
                // The elements of an array follow its length of 8 bytes.
                let lead = if flags & Rep::ARRAY != 0 { 8 } else { 0 };
                out.resize((out.len() + lead).next_multiple_of(ALIGNMENT) - lead, 0);
                let at = out.len() as u64;
                out.extend_from_slice(bytes);
                at
            });
        Rep::new(value_type, flags, at)
    }

    fn finish(self) -> Vec<u8> {
        let mut out = self.out;
        let mut contents = (SECTIONS.len() as u64).to_le_bytes().to_vec();
        for (name, bytes) in SECTIONS.iter().zip(self.tables.sections()) {
            let mut padded = [0; 16];
            padded[..name.len()].copy_from_slice(name.as_bytes());
            contents.extend(padded);
            contents.extend((out.len() as u64).to_le_bytes());
            contents.extend((bytes.len() as u64).to_le_bytes());
            out.extend(bytes);
        }
        let at = out.len() as u64;
        out.extend(contents);
        out[..8].copy_from_slice(MAGIC);
        out[8..11].copy_from_slice(&VERSION);
        out[16..24].copy_from_slice(&at.to_le_bytes());
        out
    }
}

/// A count of 64 bits and the numbers.
fn push_counted(out: &mut Vec<u8>, values: &[u32]) {
    out.extend((values.len() as u64).to_le_bytes());
    values.iter().for_each(|v| out.extend(v.to_le_bytes()));
}
