//! Writes a layer as text (`.usda`). Every number is written so that it comes back bit for bit.

use super::layer::{Content, Layer, Metadata, Prim, Property, VariantSet};
use super::value::{Form, Numbers, Value};
use std::fmt::Write;

/// First line of a text file.
pub(super) const MAGIC: &str = "#usda 1.0";

/// The text of a layer.
pub(super) fn text_from_layer(layer: &Layer) -> String {
    let mut writer = TextWriter { text: format!("{MAGIC}\n("), depth: 0 };
    writer.metadata(&layer.metadata);
    writer.line(")");
    for prim in &layer.root_prims {
        writer.text.push('\n');
        writer.prim(prim);
    }
    writer.text.push('\n');
    writer.text
}

struct TextWriter {
    text: String,
    depth: usize,
}

impl TextWriter {
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
            if matches!(value, Value::Prepended(_)) {
                self.text.push_str("prepend ");
            }
            self.text.push_str(name);
            self.text.push_str(" = ");
            self.value(value);
        }
        self.depth -= 1;
    }

    fn prim(&mut self, prim: &Prim) {
        self.line("def ");
        if !prim.type_name.is_empty() {
            self.text.push_str(&prim.type_name);
            self.text.push(' ');
        }
        self.quoted(&prim.name);
        if !prim.metadata.is_empty() || prim.variant_set.is_some() {
            self.text.push_str(" (");
            self.metadata(&prim.metadata);
            self.variant_metadata(prim.variant_set.as_ref());
            self.line(")");
        }
        self.line("{");
        self.body(prim);
        self.line("}");
    }

    /// The variant set's name and what is chosen.
    fn variant_metadata(&mut self, set: Option<&VariantSet>) {
        let Some(set) = set else { return };
        let chosen = vec![(set.name.clone(), Value::string(&set.selection))];
        self.metadata(&vec![
            ("variants".to_owned(), Value::Dictionary(chosen)),
            ("variantSets".to_owned(), Value::Prepended(vec![set.name.clone()])),
        ]);
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
        if let Some(set) = &prim.variant_set {
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
            Content::Attribute { type_name, is_uniform, value, connection } => {
                if *is_uniform {
                    self.text.push_str("uniform ");
                }
                self.text.push_str(type_name);
                self.text.push(' ');
                self.text.push_str(&property.name);
                if let Some(path) = connection {
                    let _ = write!(self.text, ".connect = <{path}>");
                }
                if let Some(value) = value {
                    self.text.push_str(" = ");
                    self.value(value);
                }
            }
            Content::Relationship { target } => {
                let _ = write!(self.text, "rel {} = <{target}>", property.name);
            }
        }
        if !property.metadata.is_empty() {
            self.text.push_str(" (");
            self.metadata(&property.metadata);
            self.line(")");
        }
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
            Value::Tokens(items) | Value::Prepended(items) => self.strings(items),
            Value::Asset(path) => {
                let _ = write!(self.text, "@{path}@");
            }
            Value::Dictionary(entries) => self.dictionary(entries),
        }
    }

    fn dictionary(&mut self, entries: &Metadata) {
        self.text.push('{');
        self.depth += 1;
        for (name, value) in entries {
            self.indent();
            let _ = write!(self.text, "{} {name} = ", entry_type(value));
            self.value(value);
        }
        self.depth -= 1;
        self.line("}");
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
                // Strings with a zero were refused before.
                c if c < ' ' || c == '\u{7f}' => {
                    let _ = write!(self.text, "\\x{:02x}", c as u32);
                }
                c => self.text.push(c),
            }
        }
        self.text.push('"');
    }
}

/// Appends the shortest text that comes back as the same f32, also where it is read as f64 and then rounded.
fn push_f32(text: &mut String, value: f32) {
    let start = text.len();
    let _ = write!(text, "{value:?}");
    let is_exact = text[start..].parse::<f64>().is_ok_and(|v| (v as f32).to_bits() == value.to_bits());
    if !is_exact {
        text.truncate(start);
        let _ = write!(text, "{:?}", f64::from(value));
    }
}

/// Type of a dictionary's entry; ours are texts, switches, integers and dictionaries.
fn entry_type(value: &Value) -> &'static str {
    match value {
        Value::Bool(_) => "bool",
        Value::Ints(_) => "int",
        Value::Floats(_) => "float",
        Value::Doubles(_) => "double",
        Value::String(_) => "string",
        Value::Token(_) => "token",
        Value::Tokens(_) | Value::Prepended(_) => "token[]",
        Value::Asset(_) => "asset",
        Value::Dictionary(_) => "dictionary",
    }
}
