//! Reads values from text.

use super::layer::Metadata;
use super::lexer::{Lexeme, Lexer, shown};
use super::text_read::DEPTH_MAX;
use super::value::{Form, Kind, Numbers, Value, kind_from_name};
use crate::Result;
use std::sync::Arc;

/// A value of a type.
pub(super) fn read_value(lexer: &mut Lexer, kind: Kind, is_array: bool) -> Result<Value> {
    if *lexer.peek()? == Lexeme::Word("None") {
        return Err(lexer.unsupported("blocked values (\"None\")"));
    }
    Ok(match kind {
        Kind::Int(form) => Value::Ints(numbers(lexer, form, is_array, int)?),
        Kind::Float(form) => Value::Floats(numbers(lexer, form, is_array, |l| Ok(float(l)? as f32))?),
        Kind::Double(form) => Value::Doubles(numbers(lexer, form, is_array, float)?),
        Kind::Token if is_array => Value::Tokens(read_list(lexer, |l| l.quoted("a token"))?),
        _ if is_array => return Err(lexer.unsupported(format!("arrays of {kind:?}"))),
        Kind::Bool => Value::Bool(boolean(lexer)?),
        Kind::String => Value::String(lexer.quoted("a text")?),
        Kind::Token => Value::Token(lexer.quoted("a token")?),
        Kind::Asset => match lexer.take()? {
            Lexeme::Asset(path) => Value::Asset(path.to_owned()),
            found => return Err(lexer.invalid(format!("{}, expected @path@", shown(&found)))),
        },
    })
}

/// `[a, b, c]`, with or without a comma at the end.
pub(super) fn read_list<T>(
    lexer: &mut Lexer,
    mut one: impl FnMut(&mut Lexer) -> Result<T>,
) -> Result<Vec<T>> {
    lexer.expect('[')?;
    let mut items = Vec::new();
    loop {
        if lexer.take_if(']')? {
            return Ok(items);
        }
        // Twice: vectors grow by doubling.
        lexer.spend(2 * size_of::<T>())?;
        items.push(one(lexer)?);
        if !lexer.take_if(',')? {
            lexer.expect(']')?;
            return Ok(items);
        }
    }
}

/// `{ TYPE NAME = VALUE ... }`
pub(super) fn read_dictionary(lexer: &mut Lexer, depth: usize) -> Result<Metadata> {
    if depth > DEPTH_MAX {
        return Err(lexer.unsupported(format!("dictionaries nested more than {DEPTH_MAX} deep")));
    }
    lexer.expect('{')?;
    let mut entries = Metadata::new();
    loop {
        if lexer.take_if('}')? {
            return Ok(entries);
        }
        if lexer.take_if(';')? {
            continue;
        }
        lexer.spend(2 * size_of::<(String, Value)>() + 64)?;
        let type_name = lexer.word("a type")?;
        let name = match lexer.take()? {
            Lexeme::Word(name) => name.to_owned(),
            Lexeme::Text(name) => name.into_owned(),
            found => return Err(lexer.invalid(format!("{}, expected a name", shown(&found)))),
        };
        lexer.expect('=')?;
        let value = if type_name == "dictionary" {
            Value::Dictionary(read_dictionary(lexer, depth + 1)?)
        } else {
            let (base, is_array) = type_name.strip_suffix("[]").map_or((type_name, false), |b| (b, true));
            let kind = kind_from_name(base)
                .ok_or_else(|| lexer.unsupported(format!("dictionary entries of type {type_name:?}")))?;
            read_value(lexer, kind, is_array)?
        };
        entries.push((name, value));
    }
}

fn boolean(lexer: &mut Lexer) -> Result<bool> {
    match lexer.take()? {
        Lexeme::Word("true" | "True" | "yes") | Lexeme::Number("1") => Ok(true),
        Lexeme::Word("false" | "False" | "no") | Lexeme::Number("0") => Ok(false),
        found => Err(lexer.invalid(format!("{}, expected true or false", shown(&found)))),
    }
}

fn int(lexer: &mut Lexer) -> Result<i32> {
    let found = lexer.take()?;
    if let Lexeme::Number(text) = found
        && let Ok(value) = text.parse()
    {
        return Ok(value);
    }
    Err(lexer.invalid(format!("{}, expected an integer of 32 bits", shown(&found))))
}

fn float(lexer: &mut Lexer) -> Result<f64> {
    let found = lexer.take()?;
    if let Lexeme::Number(text) | Lexeme::Word(text @ ("inf" | "nan")) = found
        && let Ok(value) = text.parse()
    {
        return Ok(value);
    }
    Err(lexer.invalid(format!("{}, expected a number", shown(&found))))
}

fn numbers<T>(
    lexer: &mut Lexer,
    form: Form,
    is_array: bool,
    one: impl Fn(&mut Lexer) -> Result<T>,
) -> Result<Numbers<T>> {
    let mut values = Vec::new();
    let mut element = |lexer: &mut Lexer| -> Result<()> {
        lexer.spend(2 * form.width() * size_of::<T>())?;
        if form == Form::One {
            values.push(one(lexer)?);
            return Ok(());
        }
        lexer.expect('(')?;
        for i in 0..form.width() {
            if i > 0 {
                lexer.expect(',')?;
            }
            values.push(one(lexer)?);
        }
        lexer.expect(')')
    };
    if is_array {
        read_list(lexer, element)?;
    } else {
        element(lexer)?;
    }
    Ok(Numbers { form, is_array, values: Arc::new(values) })
}
