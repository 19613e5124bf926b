//! JSON with what Python and C++ write into it for numbers that are not finite: `NaN`, `-Infinity`, `-nan(ind)`, `1e999`.

use super::bytes::read_text;
use crate::Result;
use litetex_exporters::parse_number;
use serde::de::{Deserializer, Error, Visitor};
use serde::{Deserialize, de};
use serde_json::Value;
use std::borrow::Cow;
use std::fmt;
use std::path::Path;

/// Reads a JSON file; `expected` says in the error what it should have been.
pub(crate) fn read<T: de::DeserializeOwned>(path: &Path, expected: &str) -> Result<T> {
    let text = read_text(path)?;
    let text = quoted_tokens(&text);
    serde_json::from_str(&text).map_err(|e| {
        let value = serde_json::from_str::<Value>(&text).ok();
        // Of JSON of another shape, the field tells more than the line.
        let named = value.and_then(|value| parsed::<T>(value).err());
        invalid!(path, "{}; expected {expected}", named.unwrap_or_else(|| e.to_string()))
    })
}

/// A number that may be NaN or infinite, which JSON cannot express: as a string, or null.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Number(pub f64);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Any;
        impl Visitor<'_> for Any {
            type Value = Number;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number")
            }

            fn visit_f64<E: Error>(self, value: f64) -> Result<Number, E> {
                Ok(Number(value))
            }

            fn visit_i64<E: Error>(self, value: i64) -> Result<Number, E> {
                Ok(Number(value as f64))
            }

            fn visit_u64<E: Error>(self, value: u64) -> Result<Number, E> {
                Ok(Number(value as f64))
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Number, E> {
                parse_number(text)
                    .map(Number)
                    .ok_or_else(|| E::invalid_value(de::Unexpected::Str(text), &self))
            }

            fn visit_unit<E: Error>(self) -> Result<Number, E> {
                Ok(Number(f64::NAN))
            }
        }
        deserializer.deserialize_any(Any)
    }
}

/// A part of a file that may be broken while the others are not, or what is wrong with it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Part<T>(pub Result<T, String>);

impl<'de, T: de::DeserializeOwned> Deserialize<'de> for Part<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Value::deserialize(deserializer).map(|value| Self(parsed(value)))
    }
}

/// A value as what it should be, or what is wrong with it and with which of its fields.
///
/// # Errors
/// See above.
pub(crate) fn parsed<T: de::DeserializeOwned>(value: Value) -> Result<T, String> {
    T::deserialize(&value).map_err(|e| {
        let problem = e.to_string();
        match field_at_fault::<T>(&value, &problem) {
            Some(field) => format!("{field}: {problem}"),
            None => problem,
        }
    })
}

/// The field without which the problem is another one, or none.
fn field_at_fault<'a, T: de::DeserializeOwned>(value: &'a Value, problem: &str) -> Option<&'a String> {
    // Frames have some 30 fields.
    const FIELDS_MAX: usize = 100;
    let fields = value.as_object().filter(|fields| fields.len() <= FIELDS_MAX)?;
    fields.keys().find(|field| {
        let mut rest = fields.clone();
        rest.remove(*field);
        let other = T::deserialize(Value::Object(rest)).err().map(|e| e.to_string());
        other.is_none_or(|other| other != problem && !other.starts_with("missing field"))
    })
}

/// The text with tokens for NaN and infinity in quotes, which makes it JSON; everything else as it is.
fn quoted_tokens(text: &str) -> Cow<'_, str> {
    let is_of_token = |b: u8| b.is_ascii_alphanumeric() || b"+-.#()_".contains(&b);
    let bytes = text.as_bytes();
    let (mut out, mut copied, mut at) = (String::new(), 0, 0);
    while at < bytes.len() {
        if bytes[at] == b'"' {
            at = end_of_string(bytes, at);
            continue;
        }
        let length = bytes[at..].iter().take_while(|&&b| is_of_token(b)).count();
        // `None` within a character of several bytes, which belongs to no token.
        let token = text.get(at..at + length).unwrap_or_default();
        if parse_number(token).is_some_and(|value| !value.is_finite()) {
            out.push_str(&text[copied..at]);
            out.extend(["\"", token, "\""]);
            copied = at + length;
        }
        at += length.max(1);
    }
    if copied == 0 {
        return Cow::Borrowed(text);
    }
    out.push_str(&text[copied..]);
    Cow::Owned(out)
}

/// The byte after the string that begins at `start`.
fn end_of_string(bytes: &[u8], start: usize) -> usize {
    let mut at = start + 1;
    while at < bytes.len() && bytes[at] != b'"' {
        at += if bytes[at] == b'\\' { 2 } else { 1 };
    }
    at + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_numbers_that_are_none_are_quoted() {
        let plain = r#"{"a": [1, -2.5e3, true, null], "NaN, \" NaN": "é NaN"}"#;
        assert!(matches!(quoted_tokens(plain), Cow::Borrowed(text) if text == plain), "negative control");
        for token in ["NaN", "-Infinity", "nan", "inf", "-nan(ind)", "1e999", "-1.#IND"] {
            let text = format!(r#"{{"NaN": ["é", {token},1.5 , {token}]}}"#);
            assert_eq!(quoted_tokens(&text), format!(r#"{{"NaN": ["é", "{token}",1.5 , "{token}"]}}"#));
        }
        for text in ["", "\"", "\"a\\", "NaN", "[é", "{NaN: \"\\"] {
            let _ = quoted_tokens(text);
        }
    }

    #[test]
    fn a_broken_part_says_what_is_wrong_and_leaves_the_others_whole() {
        #[derive(Debug, Deserialize, PartialEq)]
        struct Camera {
            name: String,
            focal: Option<Number>,
        }
        let text =
            r#"[{"name": "a", "focal": 2}, {"focal": 2}, {"name": "c", "focal": "x"}, 7, {"name": "e"}]"#;
        let read: Vec<Part<Camera>> = serde_json::from_str(text).unwrap();
        assert_eq!(read[0].0, Ok(Camera { name: "a".to_owned(), focal: Some(Number(2.0)) }));
        assert!(read[4].0.is_ok(), "negative control");
        for (index, what) in
            [(1, "missing field `name`"), (2, "focal: invalid value: string \"x\""), (3, "integer `7`")]
        {
            let problem = read[index].0.as_ref().unwrap_err();
            assert!(problem.contains(what), "{problem}");
        }
    }

    #[test]
    fn a_field_of_another_type_is_named() {
        #[derive(Debug, Deserialize)]
        struct Lists {
            #[serde(flatten)]
            _names: std::collections::BTreeMap<String, Vec<String>>,
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lists.json");
        let problem = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read::<Lists>(&path, "lists").err().map(|e| e.to_string())
        };
        assert_eq!(problem(r#"{"a": [], "b": ["x"]}"#), None, "negative control");
        let text = problem(r#"{"a": [], "b": "x"}"#).unwrap();
        assert!(
            text.contains("b: invalid type: string \"x\", expected a sequence; expected lists"),
            "{text}"
        );
        let text = problem(r#"{"a": [], "b": ["x"#).unwrap();
        assert!(text.contains("line 1 column"), "what is no JSON has a line: {text}");
    }

    #[test]
    fn numbers_are_read_from_all_that_stands_for_one() {
        let read = |text: &str| serde_json::from_str::<Vec<Number>>(text).map(|v| v[0].0);
        assert_eq!(read("[0.1]").unwrap(), 0.1);
        assert_eq!(
            (read("[3]").unwrap(), read("[-3]").unwrap(), read("[\"2.5\"]").unwrap()),
            (3.0, -3.0, 2.5)
        );
        assert!(read("[null]").unwrap().is_nan() && read("[\"-nan(ind)\"]").unwrap().is_nan());
        assert!(read("[\"x\"]").is_err() && read("[{}]").is_err(), "negative control");
        let absent: Option<Number> = serde_json::from_str("null").unwrap();
        assert_eq!(absent, None);
    }
}
