//! Reads a layer from text (`.usda`): the grammar of prims, properties, variants and the metadata that our files have,
//! in any order and layout. Composition (references, payloads, inheritance) and time are not supported.

use super::layer::{Content, Layer, Metadata, Prim, Property, Specifier, VariantSet};
use super::lexer::{Lexeme, Lexer, shown};
use super::text_values::{read_dictionary, read_list, read_value};
use super::value::{Form, Kind, ListOp, Value, kind_from_name};
use crate::{Error, Result};
use std::path::Path;

/// Deepest nesting of prims and dictionaries.
pub(super) const DEPTH_MAX: usize = 64;

/// Memory of a prim or variant, twice for vectors that grow.
const PRIM_BYTES: usize = 2 * size_of::<Prim>();

/// Memory of a property or an entry of metadata besides its values.
const PROPERTY_BYTES: usize = 2 * size_of::<Property>() + 64;

/// A layer and what its parts weigh.
#[derive(Debug)]
pub(super) struct TextLayer {
    pub(super) layer: Layer,
    /// Path of a property and bytes of its text.
    pub(super) value_bytes: Vec<(String, u64)>,
}

/// A layer from its text; `path` is only for messages.
///
/// # Errors
/// [`Error::Invalid`] naming the line, [`Error::Unsupported`] naming the feature, [`Error::TooLarge`] beyond `budget`
/// bytes of memory.
pub(super) fn layer_from_text(text: &str, path: &Path, budget: u64) -> Result<TextLayer> {
    let first = text.lines().next().unwrap_or_default().trim_end();
    match first.strip_prefix("#usda ") {
        Some("1.0") => {}
        Some(version) => {
            let what = format!("version {version:?} of the text format; supported: 1.0");
            return Err(Error::unsupported(path, what));
        }
        None => return Err(Error::invalid(path, "does not begin with the line \"#usda 1.0\"")),
    }
    let mut lexer = Lexer::new(text, path, budget);
    let mut layer = Layer::default();
    if lexer.take_if('(')? {
        let mut sets = Vec::new();
        layer.metadata = metadata(&mut lexer, &mut sets)?;
    }
    loop {
        match lexer.take()? {
            Lexeme::End => return Ok(TextLayer { layer, value_bytes: lexer.value_bytes }),
            Lexeme::Word(word) => match specifier(word) {
                Some(specifier) => layer.prims.push(prim(&mut lexer, specifier, 0)?),
                None => return Err(lexer.unsupported(format!("{word:?} between root prims"))),
            },
            found => return Err(lexer.invalid(format!("{}, expected a prim", shown(&found)))),
        }
    }
}

fn specifier(word: &str) -> Option<Specifier> {
    Specifier::ALL.into_iter().find(|s| s.name() == word)
}

fn prim(lexer: &mut Lexer, specifier: Specifier, depth: usize) -> Result<Prim> {
    if depth > DEPTH_MAX {
        return Err(lexer.unsupported(format!("prims nested more than {DEPTH_MAX} deep")));
    }
    let mut prim = Prim { specifier, ..Prim::default() };
    if let Lexeme::Word(_) = lexer.peek()? {
        prim.type_name = lexer.word("a type")?.to_owned();
    }
    prim.name = lexer.quoted("a prim's name")?;
    // With its path, which is told for each.
    let outer = lexer.place.len();
    lexer.spend(PRIM_BYTES + outer + prim.name.len() + 1)?;
    lexer.place.push('/');
    lexer.place.push_str(&prim.name);
    if lexer.take_if('(')? {
        prim.metadata = metadata(lexer, &mut prim.variant_sets)?;
    }
    body(lexer, &mut prim, depth)?;
    lexer.place.truncate(outer);
    Ok(prim)
}

/// What stands in braces, of a prim or a variant.
fn body(lexer: &mut Lexer, prim: &mut Prim, depth: usize) -> Result<()> {
    lexer.expect('{')?;
    loop {
        if lexer.take_if('}')? {
            return Ok(());
        }
        if lexer.take_if(';')? {
            continue;
        }
        let word = lexer.word("a prim, a property or \"}\"")?;
        match word {
            "variantSet" => variant_set(lexer, prim, depth)?,
            "reorder" => return Err(lexer.unsupported("\"reorder\"")),
            _ => match specifier(word) {
                Some(specifier) => prim.children.push(self::prim(lexer, specifier, depth + 1)?),
                None => {
                    let start = lexer.offset().saturating_sub(word.len());
                    property(lexer, word, &mut prim.properties)?;
                    count(lexer, prim, start)?;
                }
            },
        }
    }
}

/// Notes the text of the property that was read last.
fn count(lexer: &mut Lexer, prim: &Prim, start: usize) -> Result<()> {
    let name = prim.properties.last().map_or("", |p| p.name.as_str());
    lexer.spend(2 * (lexer.place.len() + name.len() + size_of::<(String, u64)>()))?;
    let num_bytes = lexer.offset().saturating_sub(start) as u64;
    lexer.value_bytes.push((format!("{}.{name}", lexer.place), num_bytes));
    Ok(())
}

fn variant_set(lexer: &mut Lexer, prim: &mut Prim, depth: usize) -> Result<()> {
    if depth > DEPTH_MAX {
        return Err(lexer.unsupported(format!("variants nested more than {DEPTH_MAX} deep")));
    }
    let name = lexer.quoted("a variant set's name")?;
    lexer.spend(PRIM_BYTES + name.len())?;
    lexer.expect('=')?;
    lexer.expect('{')?;
    let mut variants = Vec::new();
    while !lexer.take_if('}')? {
        let mut variant =
            Prim { name: lexer.quoted("a variant's name")?, specifier: Specifier::Over, ..Prim::default() };
        let outer = lexer.place.len();
        lexer.spend(PRIM_BYTES + outer + name.len() + variant.name.len())?;
        lexer.place.extend(["{", &name, "=", &variant.name, "}"]);
        if lexer.take_if('(')? {
            variant.metadata = metadata(lexer, &mut variant.variant_sets)?;
        }
        body(lexer, &mut variant, depth + 1)?;
        lexer.place.truncate(outer);
        variants.push(variant);
    }
    set_named(&mut prim.variant_sets, &name).variants.extend(variants);
    Ok(())
}

/// A variant set by name, made if need be.
fn set_named<'a>(sets: &'a mut Vec<VariantSet>, name: &str) -> &'a mut VariantSet {
    let at = sets.iter().position(|s| s.name == name).unwrap_or_else(|| {
        sets.push(VariantSet { name: name.to_owned(), ..VariantSet::default() });
        sets.len() - 1
    });
    &mut sets[at]
}

/// Metadata after `(`, up to and with `)`.
fn metadata(lexer: &mut Lexer, sets: &mut Vec<VariantSet>) -> Result<Metadata> {
    let mut metadata = Metadata::new();
    loop {
        match lexer.take()? {
            Lexeme::Mark(')') => return Ok(metadata),
            Lexeme::Mark(';') => {}
            Lexeme::Text(comment) => {
                lexer.spend(PROPERTY_BYTES + comment.len())?;
                metadata.push(("comment".to_owned(), Value::String(comment.into_owned())));
            }
            Lexeme::Word(edit @ ("prepend" | "append")) => {
                let name = lexer.word("a name of metadata")?;
                metadata_entry(lexer, Some(edit), name, &mut metadata, sets)?;
            }
            Lexeme::Word(edit @ ("add" | "delete" | "reorder")) => {
                return Err(lexer.unsupported(format!("list edit {edit:?}")));
            }
            Lexeme::Word(name) => metadata_entry(lexer, None, name, &mut metadata, sets)?,
            found => return Err(lexer.invalid(format!("{}, expected metadata", shown(&found)))),
        }
    }
}

fn metadata_entry(
    lexer: &mut Lexer,
    edit: Option<&str>,
    name: &str,
    metadata: &mut Metadata,
    sets: &mut Vec<VariantSet>,
) -> Result<()> {
    lexer.expect('=')?;
    lexer.spend(PROPERTY_BYTES + name.len())?;
    let mut push = |value| metadata.push((name.to_owned(), value));
    match (name, edit) {
        ("apiSchemas", edit) => {
            let items = strings(lexer)?;
            push(Value::TokenList(match edit {
                Some("prepend") => ListOp::Prepend(items),
                Some(_) => ListOp::Append(items),
                None => ListOp::Explicit(items),
            }));
        }
        ("variantSets", _) => {
            for set in strings(lexer)? {
                set_named(sets, &set);
            }
        }
        ("variants", None) => {
            for (set, selection) in read_dictionary(lexer, 0)? {
                let selection = selection.as_text().unwrap_or_default().to_owned();
                set_named(sets, &set).selection = selection;
            }
        }
        (_, None) => {
            let kind = metadata_kind(name).ok_or_else(|| lexer.unsupported(format!("metadata {name:?}")))?;
            push(match kind {
                Some(kind) => read_value(lexer, kind, false)?,
                None => Value::Dictionary(read_dictionary(lexer, 0)?),
            });
        }
        (_, Some(edit)) => return Err(lexer.unsupported(format!("metadata \"{edit} {name}\""))),
    }
    Ok(())
}

/// Type of metadata by name: `Some(None)` is a dictionary; `None`: not known.
fn metadata_kind(name: &str) -> Option<Option<Kind>> {
    Some(Some(match name {
        "customLayerData" | "customData" | "assetInfo" | "sdrMetadata" => return Some(None),
        "active" | "hidden" | "instanceable" => Kind::Bool,
        "elementSize" => Kind::Int(Form::One),
        "metersPerUnit" | "kilogramsPerUnit" | "timeCodesPerSecond" | "framesPerSecond" | "startTimeCode"
        | "endTimeCode" => Kind::Double(Form::One),
        "doc" | "documentation" | "comment" | "displayName" | "displayGroup" => Kind::String,
        "upAxis" | "defaultPrim" | "interpolation" | "kind" | "colorSpace" => Kind::Token,
        _ => return None,
    }))
}

/// A text or a list of texts.
fn strings(lexer: &mut Lexer) -> Result<Vec<String>> {
    if *lexer.peek()? == Lexeme::Mark('[') {
        return read_list(lexer, |lexer| lexer.quoted("a name"));
    }
    Ok(vec![lexer.quoted("a name")?])
}

fn property(lexer: &mut Lexer, first: &str, properties: &mut Vec<Property>) -> Result<()> {
    lexer.spend(PROPERTY_BYTES + first.len())?;
    let mut word = first.to_owned();
    let (mut is_custom, mut is_uniform) = (false, false);
    loop {
        match word.as_str() {
            "custom" => is_custom = true,
            "uniform" => is_uniform = true,
            "varying" => {}
            "prepend" | "append" | "add" | "delete" => {
                return Err(lexer.unsupported(format!("list edit {word:?} of a property")));
            }
            _ => break,
        }
        word = lexer.word("a type")?.to_owned();
    }
    if word == "rel" {
        let name = lexer.word("a name")?.to_owned();
        let targets = if lexer.take_if('=')? { paths(lexer)? } else { Vec::new() };
        let content = Content::Relationship { targets };
        let metadata = property_metadata(lexer)?;
        properties.push(Property { name, is_custom, content, metadata });
        return Ok(());
    }
    let type_name = word;
    let full = lexer.word("a name")?;
    let (name, suffix) = full.split_once('.').unwrap_or((full, ""));
    let mut attribute = Property::declaration(&type_name, name);
    attribute.is_custom = is_custom;
    let mut found = None;
    match suffix {
        "" if lexer.take_if('=')? => found = Some(attribute_value(lexer, &type_name)?),
        "" => {}
        "connect" => {
            lexer.expect('=')?;
            let paths = paths(lexer)?;
            if let Content::Attribute { connections, .. } = &mut attribute.content {
                *connections = paths;
            }
        }
        other => return Err(lexer.unsupported(format!("\".{other}\" of an attribute"))),
    }
    if let Content::Attribute { value, is_uniform: uniform, .. } = &mut attribute.content {
        (*value, *uniform) = (found, is_uniform);
    }
    attribute.metadata = property_metadata(lexer)?;
    add_attribute(properties, attribute);
    Ok(())
}

/// An attribute may stand twice: with its value and with its connection.
fn add_attribute(properties: &mut Vec<Property>, new: Property) {
    // Both lines follow each other; looking further would be quadratic.
    let old = properties.last_mut().filter(|p| p.name == new.name);
    match (old.map(|p| (&mut p.content, &mut p.metadata)), new.content) {
        (
            Some((Content::Attribute { value, connections, .. }, metadata)),
            Content::Attribute { value: new_value, connections: new_connections, .. },
        ) => {
            *value = new_value.or(value.take());
            connections.extend(new_connections);
            metadata.extend(new.metadata);
        }
        (_, content) => properties.push(Property { content, ..new }),
    }
}

fn attribute_value(lexer: &mut Lexer, type_name: &str) -> Result<Value> {
    let (base, is_array) = match type_name.strip_suffix("[]") {
        Some(base) => (base, true),
        None => (type_name, false),
    };
    let kind =
        kind_from_name(base).ok_or_else(|| lexer.unsupported(format!("attributes of type {type_name:?}")))?;
    read_value(lexer, kind, is_array)
}

fn property_metadata(lexer: &mut Lexer) -> Result<Metadata> {
    if lexer.take_if('(')? { metadata(lexer, &mut Vec::new()) } else { Ok(Metadata::new()) }
}

fn paths(lexer: &mut Lexer) -> Result<Vec<String>> {
    let one = |lexer: &mut Lexer| match lexer.take()? {
        Lexeme::Path(path) => Ok(path.to_owned()),
        found => Err(lexer.invalid(format!("{}, expected a path", shown(&found)))),
    };
    if *lexer.peek()? == Lexeme::Mark('[') { read_list(lexer, one) } else { Ok(vec![one(lexer)?]) }
}
