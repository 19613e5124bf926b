//! Writes a layer as text (`.usda`). Every number is written so that it comes back bit for bit.

use super::layer::{Content, Layer, Metadata, Prim, Property, VariantSet};
use super::value::{Form, ListOp, Numbers, Value};
use std::fmt::Write;

/// First line of a text file.
pub(super) const MAGIC: &str = "#usda 1.0";

/// The text of a layer.
pub(super) fn text_from_layer(layer: &Layer) -> String {
    let mut writer = Writer { text: format!("{MAGIC}\n"), depth: 0 };
    if !layer.metadata.is_empty() {
        writer.text.push('(');
        writer.metadata(&layer.metadata);
        writer.line(")");
    }
    for prim in &layer.prims {
        writer.text.push('\n');
        writer.prim(prim);
    }
    writer.text.push('\n');
    writer.text
}

struct Writer {
    text: String,
    depth: usize,
}

impl Writer {
    /// Begins a line.
    fn indent(&mut self) {
        self.text.push('\n');
        for _ in 0..self.depth {
            self.text.push_str("    ");
        }
    }

    fn line(&mut self, text: &str) {
        self.indent();
        self.text.push_str(text);
    }

    fn metadata(&mut self, metadata: &Metadata) {
        self.depth += 1;
        for (name, value) in metadata {
            self.indent();
            if let Value::TokenList(list) = value {
                self.list_op(name, list);
            } else {
                self.text.push_str(name);
                self.text.push_str(" = ");
                self.value(value);
            }
        }
        self.depth -= 1;
    }

    fn list_op(&mut self, name: &str, list: &ListOp) {
        self.text.push_str(match list {
            ListOp::Prepend(_) => "prepend ",
            ListOp::Append(_) => "append ",
            ListOp::Explicit(_) => "",
        });
        self.text.push_str(name);
        self.text.push_str(" = ");
        self.strings(list.items());
    }

    fn prim(&mut self, prim: &Prim) {
        self.line(prim.specifier.name());
        if !prim.type_name.is_empty() {
            self.text.push(' ');
            self.text.push_str(&prim.type_name);
        }
        self.text.push(' ');
        self.quoted(&prim.name);
        if !(prim.metadata.is_empty() && prim.variant_sets.is_empty()) {
            self.text.push_str(" (");
            self.metadata(&prim.metadata);
            self.variant_metadata(&prim.variant_sets);
            self.line(")");
        }
        self.line("{");
        self.body(prim);
        self.line("}");
    }

    /// Names of the variant sets and what is chosen.
    fn variant_metadata(&mut self, sets: &[VariantSet]) {
        if sets.is_empty() {
            return;
        }
        self.depth += 1;
        self.line("variants = {");
        for set in sets.iter().filter(|s| !s.selection.is_empty()) {
            self.depth += 1;
            self.indent();
            self.key("string", &set.name);
            self.quoted(&set.selection);
            self.depth -= 1;
        }
        self.line("}");
        self.line("prepend variantSets = ");
        self.strings(&sets.iter().map(|s| s.name.clone()).collect::<Vec<_>>());
        self.depth -= 1;
    }

    fn body(&mut self, prim: &Prim) {
        self.depth += 1;
        for property in &prim.properties {
            self.property(property);
        }
        for child in &prim.children {
            self.text.push('\n');
            self.prim(child);
        }
        for set in &prim.variant_sets {
            self.line("variantSet ");
            self.quoted(&set.name);
            self.text.push_str(" = {");
            self.depth += 1;
            for variant in &set.variants {
                self.indent();
                self.quoted(&variant.name);
                self.text.push_str(" {");
                self.body(variant);
                self.line("}");
            }
            self.depth -= 1;
            self.line("}");
        }
        self.depth -= 1;
    }

    fn property(&mut self, property: &Property) {
        self.indent();
        if property.is_custom {
            self.text.push_str("custom ");
        }
        match &property.content {
            Content::Attribute { type_name, is_uniform, value, connections } => {
                let start = self.text.len();
                if *is_uniform {
                    self.text.push_str("uniform ");
                }
                self.text.push_str(type_name);
                self.text.push(' ');
                self.text.push_str(&property.name);
                let declaration = self.text[start..].to_owned();
                if let Some(value) = value {
                    self.text.push_str(" = ");
                    self.value(value);
                }
                let has_own_line = value.is_some() || !property.metadata.is_empty() || connections.is_empty();
                if has_own_line {
                    self.property_metadata(&property.metadata);
                }
                if !connections.is_empty() {
                    if has_own_line {
                        self.line(&declaration);
                    }
                    self.text.push_str(".connect = ");
                    self.paths(connections);
                }
            }
            Content::Relationship { targets } => {
                self.text.push_str("rel ");
                self.text.push_str(&property.name);
                self.text.push_str(" = ");
                self.paths(targets);
                self.property_metadata(&property.metadata);
            }
        }
    }

    fn property_metadata(&mut self, metadata: &Metadata) {
        if !metadata.is_empty() {
            self.text.push_str(" (");
            self.metadata(metadata);
            self.line(")");
        }
    }

    fn paths(&mut self, paths: &[String]) {
        if let [path] = paths {
            let _ = write!(self.text, "<{path}>");
            return;
        }
        self.text.push('[');
        for (i, path) in paths.iter().enumerate() {
            let _ = write!(self.text, "{}<{path}>", if i > 0 { ", " } else { "" });
        }
        self.text.push(']');
    }

    fn value(&mut self, value: &Value) {
        match value {
            Value::Bool(value) => self.text.push_str(if *value { "true" } else { "false" }),
            Value::Ints(numbers) => self.numbers(numbers, |text, v| {
                let _ = write!(text, "{v}");
            }),
            Value::Floats(numbers) => self.numbers(numbers, |text, v| push_f32(text, *v)),
            Value::Doubles(numbers) => self.numbers(numbers, |text, v| {
                let _ = write!(text, "{v:?}");
            }),
            Value::String(text) | Value::Token(text) => self.quoted(text),
            Value::Tokens(items) => self.strings(items),
            Value::Asset(path) if path.contains('@') => {
                let _ = write!(self.text, "@@@{path}@@@");
            }
            Value::Asset(path) => {
                let _ = write!(self.text, "@{path}@");
            }
            Value::Dictionary(entries) => self.dictionary(entries),
            Value::TokenList(list) => self.strings(list.items()),
        }
    }

    fn dictionary(&mut self, entries: &Metadata) {
        self.text.push('{');
        self.depth += 1;
        for (name, value) in entries {
            self.indent();
            self.key(type_of(value), name);
            self.value(value);
        }
        self.depth -= 1;
        self.line("}");
    }

    /// `TYPE NAME = ` of a dictionary's entry.
    fn key(&mut self, type_name: &str, name: &str) {
        self.text.push_str(type_name);
        self.text.push(' ');
        let is_plain = !name.starts_with(|c: char| c.is_ascii_digit())
            && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
            && !name.is_empty();
        if is_plain {
            self.text.push_str(name);
        } else {
            self.quoted(name);
        }
        self.text.push_str(" = ");
    }

    fn numbers<T>(&mut self, numbers: &Numbers<T>, push: impl Fn(&mut String, &T)) {
        if numbers.is_array {
            self.text.push('[');
        }
        for (i, element) in numbers.values.chunks(numbers.form.width()).enumerate() {
            if i > 0 {
                self.text.push_str(", ");
            }
            if numbers.form != Form::One {
                self.text.push('(');
            }
            for (j, value) in element.iter().enumerate() {
                if j > 0 {
                    self.text.push_str(", ");
                }
                push(&mut self.text, value);
            }
            if numbers.form != Form::One {
                self.text.push(')');
            }
        }
        if numbers.is_array {
            self.text.push(']');
        }
    }

    fn strings(&mut self, items: &[String]) {
        self.text.push('[');
        for (i, item) in items.iter().enumerate() {
            if i > 0 {
                self.text.push_str(", ");
            }
            self.quoted(item);
        }
        self.text.push(']');
    }

    fn quoted(&mut self, text: &str) {
        self.text.push('"');
        for c in text.chars() {
            match c {
                '"' => self.text.push_str("\\\""),
                '\\' => self.text.push_str("\\\\"),
                '\n' => self.text.push_str("\\n"),
                '\r' => self.text.push_str("\\r"),
                '\t' => self.text.push_str("\\t"),
                // No text of ours ends in a zero: strings with one are refused before.
                c if c < ' ' || c == '\u{7f}' => {
                    let _ = write!(self.text, "\\x{:02x}", c as u32);
                }
                c => self.text.push(c),
            }
        }
        self.text.push('"');
    }
}

/// The shortest text that comes back as the same f32, also where it is read as f64 and rounded then.
fn push_f32(text: &mut String, value: f32) {
    let start = text.len();
    let _ = write!(text, "{value:?}");
    let is_exact = text[start..].parse::<f64>().is_ok_and(|v| (v as f32).to_bits() == value.to_bits());
    if !is_exact {
        text.truncate(start);
        let _ = write!(text, "{:?}", f64::from(value));
    }
}

/// Name of a value's type in a dictionary.
fn type_of(value: &Value) -> &'static str {
    fn of_numbers<T>(numbers: &Numbers<T>, names: [&'static str; 10]) -> &'static str {
        let form = match numbers.form {
            Form::One => 0,
            Form::Vec2 => 1,
            Form::Vec3 => 2,
            Form::Vec4 => 3,
            Form::Quaternion => 4,
        };
        names[2 * form + usize::from(numbers.is_array)]
    }
    match value {
        Value::Bool(_) => "bool",
        Value::Ints(n) => of_numbers(
            n,
            ["int", "int[]", "int2", "int2[]", "int3", "int3[]", "int4", "int4[]", "int4", "int4[]"],
        ),
        Value::Floats(n) => of_numbers(
            n,
            [
                "float", "float[]", "float2", "float2[]", "float3", "float3[]", "float4", "float4[]",
                "quatf", "quatf[]",
            ],
        ),
        Value::Doubles(n) => of_numbers(
            n,
            [
                "double",
                "double[]",
                "double2",
                "double2[]",
                "double3",
                "double3[]",
                "double4",
                "double4[]",
                "quatd",
                "quatd[]",
            ],
        ),
        Value::String(_) => "string",
        Value::Token(_) => "token",
        Value::Tokens(_) | Value::TokenList(_) => "token[]",
        Value::Asset(_) => "asset",
        Value::Dictionary(_) => "dictionary",
    }
}
