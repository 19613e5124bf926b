//! Reads a layer from text (`.usda`) as [`super::text_write`] writes it. Only white space may differ: features of USD that
//! our files do not have are refused by name as unsupported. Takes time in proportion to the text.

use super::layer::{Content, Layer, Metadata, Prim, Property, VariantSet};
use super::lexer::Lexer;
use super::text_write::MAGIC;
use super::value::{Form, Kind, Numbers, Value};
use crate::{Error, Result, quoted};
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;

/// Deepest nesting of prims and dictionaries; ours nest four deep.
pub(super) const DEPTH_MAX: usize = 16;

/// Memory of a prim or variant; twice its size, because vectors grow by doubling.
const PRIM_BYTES: usize = 2 * size_of::<Prim>();

/// Memory of a property or an entry of metadata besides its values.
const PROPERTY_BYTES: usize = 2 * size_of::<Property>() + 64;

/// A layer with the sizes of its parts.
#[derive(Debug)]
pub(super) struct TextLayer {
    pub(super) layer: Layer,
    /// Path of a property and bytes of its text.
    pub(super) value_bytes: Vec<(String, u64)>,
}

/// Parses the text of a layer; `path` is only for messages.
///
/// # Errors
/// [`Error::Invalid`] naming the line, [`Error::Unsupported`] naming the feature, [`Error::TooLarge`] beyond
/// `budget_bytes` of memory.
pub(super) fn layer_from_text(text: &str, path: &Path, budget_bytes: u64) -> Result<TextLayer> {
    let first = text.lines().next().unwrap_or_default();
    if first != MAGIC {
        return Err(match first.strip_prefix("#usda ") {
            Some(version) => {
                let what =
                    format!("version {} of the text format; supported: 1.0", quoted(version.trim_end()));
                Error::unsupported(path, what)
            }
            None => invalid!(path, "does not begin with the line {MAGIC:?}"),
        });
    }
    let lexer = Lexer::new(&text[MAGIC.len()..], path, budget_bytes);
    let mut parser = Parser { lexer, place: String::new(), value_bytes: Vec::new() };
    let mut layer = Layer::default();
    if parser.lexer.take_if(b'(') {
        layer.metadata = parser.metadata(&mut None)?;
    }
    while parser.lexer.peek().is_some() {
        match parser.lexer.word("a prim")? {
            "def" => layer.root_prims.push(parser.prim(0)?),
            other => return Err(parser.lexer.unsupported(format!("{} at the root", quoted(other)))),
        }
    }
    Ok(TextLayer { layer, value_bytes: parser.value_bytes })
}

struct Parser<'a> {
    lexer: Lexer<'a>,
    /// Path of the prim that is being read.
    place: String,
    value_bytes: Vec<(String, u64)>,
}

impl Parser<'_> {
    /// `TYPE "NAME" (METADATA) { BODY }`, behind `def`.
    fn prim(&mut self, depth: usize) -> Result<Prim> {
        if depth > DEPTH_MAX {
            return Err(self.lexer.unsupported(format!("prims nested more than {DEPTH_MAX} deep")));
        }
        let mut prim = Prim::default();
        if self.lexer.peek() != Some(b'"') {
            prim.type_name = self.lexer.word("a type")?.to_owned();
        }
        prim.name = self.lexer.quoted("a prim's name")?;
        let outer = self.place.len();
        // The path is kept with each property.
        self.lexer.spend(PRIM_BYTES + outer + prim.name.len())?;
        self.place.extend(["/", &prim.name]);
        if self.lexer.take_if(b'(') {
            prim.metadata = self.metadata(&mut prim.variant_set)?;
        }
        self.body(&mut prim, depth)?;
        self.place.truncate(outer);
        Ok(prim)
    }

    /// `{ PROPERTIES CHILDREN VARIANTS }` of a prim or a variant.
    fn body(&mut self, prim: &mut Prim, depth: usize) -> Result<()> {
        self.lexer.expect(b'{')?;
        while !self.lexer.take_if(b'}') {
            let word = self.lexer.word("a prim, a property or \"}\"")?;
            match word {
                "def" => prim.children.push(self.prim(depth + 1)?),
                "variantSet" => self.variant_set(prim, depth)?,
                _ => {
                    let start = self.lexer.offset() - word.len();
                    let property = self.property(word)?;
                    let place = format!("{}.{}", self.place, property.name);
                    self.lexer.spend(2 * place.len() + size_of::<(String, u64)>())?;
                    self.value_bytes.push((place, (self.lexer.offset() - start) as u64));
                    prim.properties.push(property);
                }
            }
        }
        Ok(())
    }

    /// `"SET" = { "VARIANT" { BODY } ... }`, for the one set that the prim's metadata declare.
    fn variant_set(&mut self, prim: &mut Prim, depth: usize) -> Result<()> {
        let name = self.lexer.quoted("a variant set's name")?;
        let Some(mut set) = prim.variant_set.take().filter(|s| s.name == name && s.variants.is_empty())
        else {
            let what =
                format!("variant set {}, which its prim does not declare as its only one", quoted(&name));
            return Err(self.lexer.unsupported(what));
        };
        self.lexer.expect(b'=')?;
        self.lexer.expect(b'{')?;
        while !self.lexer.take_if(b'}') {
            let name = self.lexer.quoted("a variant's name")?;
            let mut variant = Prim { name, ..Prim::default() };
            let outer = self.place.len();
            self.lexer.spend(PRIM_BYTES + outer + set.name.len() + variant.name.len())?;
            self.place.extend(["{", &set.name, "=", &variant.name, "}"]);
            self.body(&mut variant, depth + 1)?;
            self.place.truncate(outer);
            set.variants.push(variant);
        }
        prim.variant_set = Some(set);
        Ok(())
    }

    /// Metadata behind `(`, up to and with `)`. A variant set is declared by two entries.
    fn metadata(&mut self, set: &mut Option<VariantSet>) -> Result<Metadata> {
        let mut metadata = Metadata::new();
        while !self.lexer.take_if(b')') {
            let mut name = self.lexer.word("metadata")?;
            let is_prepended = name == "prepend";
            if is_prepended {
                name = self.lexer.word("a name of metadata")?;
            }
            self.lexer.spend(PROPERTY_BYTES + name.len())?;
            let mut push = |value| metadata.push((name.to_owned(), value));
            match (name, is_prepended) {
                ("apiSchemas", true) => push(Value::Prepended(self.assigned(Self::texts)?)),
                ("customLayerData", false) => push(Value::Dictionary(self.assigned(|p| p.dictionary(0))?)),
                ("defaultPrim" | "upAxis" | "interpolation", false) => {
                    push(self.assigned(|p| p.value(Kind::Token, false))?);
                }
                ("metersPerUnit", false) => push(self.assigned(|p| p.value(Kind::Double(Form::One), false))?),
                ("variants", false) => {
                    let mut chosen = self.assigned(|p| p.dictionary(0))?;
                    let selection = (chosen.len() == 1).then(|| chosen.remove(0));
                    let Some((name, Value::String(selection))) = selection else {
                        return Err(self.lexer.unsupported("a choice of variants that is not of one set"));
                    };
                    *set = Some(VariantSet { name, selection, variants: Vec::new() });
                }
                ("variantSets", true) => {
                    let names = self.assigned(Self::texts)?;
                    if set.as_ref().is_none_or(|set| names != [set.name.as_str()]) {
                        return Err(self
                            .lexer
                            .unsupported("variant sets other than the one that is chosen from"));
                    }
                }
                _ => {
                    let edit = if is_prepended { "prepend " } else { "" };
                    let what = format!("metadata {}", quoted(&format!("{edit}{name}")));
                    return Err(self.lexer.unsupported(what));
                }
            }
        }
        Ok(metadata)
    }

    /// `= ` and what follows.
    fn assigned<T>(&mut self, read: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        self.lexer.expect(b'=')?;
        read(self)
    }

    /// `[custom] [uniform] TYPE NAME [= VALUE] [(METADATA)]`, `TYPE NAME.connect = <PATH>` or `rel NAME = <PATH>`, of which
    /// the first word was taken.
    fn property(&mut self, first: &str) -> Result<Property> {
        self.lexer.spend(PROPERTY_BYTES + first.len())?;
        let mut word = first;
        let is_custom = word == "custom";
        if is_custom {
            word = self.lexer.word("a type")?;
        }
        let is_uniform = word == "uniform";
        if is_uniform {
            word = self.lexer.word("a type")?;
        }
        if word == "rel" {
            let name = self.lexer.word("a name")?.to_owned();
            let target = self.assigned(Self::path)?;
            let content = Content::Relationship { target };
            return Ok(Property { name, is_custom, content, metadata: Metadata::new() });
        }
        let base = word.strip_suffix("[]").unwrap_or(word);
        let Some(kind) = Kind::from_name(base) else {
            return Err(self.lexer.unsupported(format!("a property of type {}", quoted(word))));
        };
        let full = self.lexer.word("a name")?;
        let (name, suffix) = full.split_once('.').unwrap_or((full, ""));
        let (mut value, mut connection, mut metadata) = (None, None, Metadata::new());
        match suffix {
            "connect" => connection = Some(self.assigned(Self::path)?),
            "" => {
                if self.lexer.take_if(b'=') {
                    value = Some(self.value(kind, base.len() < word.len())?);
                }
                if self.lexer.take_if(b'(') {
                    metadata = self.metadata(&mut None)?;
                }
            }
            other => return Err(self.lexer.unsupported(format!("{} of an attribute", quoted(other)))),
        }
        let content = Content::Attribute { type_name: word.to_owned(), is_uniform, value, connection };
        Ok(Property { name: name.to_owned(), is_custom, content, metadata })
    }

    fn value(&mut self, kind: Kind, is_array: bool) -> Result<Value> {
        Ok(match kind {
            Kind::Int(form) => {
                Value::Ints(self.numbers(form, is_array, "an integer of 32 bits", |v: i32| v)?)
            }
            // Through f64, as OpenUSD does.
            Kind::Float(form) => Value::Floats(self.numbers(form, is_array, "a number", |v: f64| v as f32)?),
            Kind::Double(form) => Value::Doubles(self.numbers(form, is_array, "a number", |v: f64| v)?),
            Kind::Token if is_array => Value::Tokens(self.texts()?),
            _ if is_array => return Err(self.lexer.unsupported(format!("an array of {kind:?}"))),
            Kind::Bool => Value::Bool(self.boolean()?),
            Kind::String => Value::String(self.lexer.quoted("a text")?),
            Kind::Token => Value::Token(self.lexer.quoted("a token")?),
            Kind::Asset => Value::Asset(self.lexer.fenced(b'@', '@')?),
        })
    }

    /// `[A, B, C]`
    fn list<T>(&mut self, mut one: impl FnMut(&mut Self) -> Result<T>) -> Result<Vec<T>> {
        self.lexer.expect(b'[')?;
        let mut items = Vec::new();
        if self.lexer.take_if(b']') {
            return Ok(items);
        }
        loop {
            // Twice, because vectors grow by doubling.
            self.lexer.spend(2 * size_of::<T>())?;
            items.push(one(self)?);
            if !self.lexer.take_if(b',') {
                self.lexer.expect(b']')?;
                return Ok(items);
            }
        }
    }

    fn texts(&mut self) -> Result<Vec<String>> {
        self.list(|p| p.lexer.quoted("a text"))
    }

    /// `<PATH>`
    fn path(&mut self) -> Result<String> {
        if self.lexer.peek() == Some(b'[') {
            return Err(self.lexer.unsupported("a list of paths"));
        }
        self.lexer.fenced(b'<', '>')
    }

    fn boolean(&mut self) -> Result<bool> {
        match self.lexer.word("true or false")? {
            "true" => Ok(true),
            "false" => Ok(false),
            other => Err(self.lexer.invalid(format!("{}, expected true or false", quoted(other)))),
        }
    }

    /// Numbers, each converted from what the text is parsed as; elements of several in parentheses.
    fn numbers<P: FromStr, T>(
        &mut self,
        form: Form,
        is_array: bool,
        what: &str,
        convert: impl Fn(P) -> T,
    ) -> Result<Numbers<T>> {
        let mut values = Vec::new();
        let element = |parser: &mut Self| -> Result<()> {
            let lexer = &mut parser.lexer;
            lexer.spend(2 * form.width() * size_of::<T>())?;
            if form == Form::One {
                values.push(convert(lexer.number(what)?));
                return Ok(());
            }
            for i in 0..form.width() {
                lexer.expect(if i == 0 { b'(' } else { b',' })?;
                values.push(convert(lexer.number(what)?));
            }
            lexer.expect(b')')
        };
        if is_array {
            self.list(element)?;
        } else {
            let mut element = element;
            element(self)?;
        }
        Ok(Numbers { form, is_array, values: Arc::new(values) })
    }

    /// `{ TYPE NAME = VALUE ... }`
    fn dictionary(&mut self, depth: usize) -> Result<Metadata> {
        if depth > DEPTH_MAX {
            return Err(self.lexer.unsupported(format!("dictionaries nested more than {DEPTH_MAX} deep")));
        }
        self.lexer.expect(b'{')?;
        let mut entries = Metadata::new();
        while !self.lexer.take_if(b'}') {
            let type_name = self.lexer.word("a type")?;
            let name = self.lexer.word("a name")?;
            self.lexer.spend(PROPERTY_BYTES + name.len())?;
            let value = match Kind::from_name(type_name) {
                Some(kind) => self.assigned(|p| p.value(kind, false))?,
                None if type_name == "dictionary" => {
                    Value::Dictionary(self.assigned(|p| p.dictionary(depth + 1))?)
                }
                None => {
                    return Err(self.lexer.unsupported(format!("an entry of type {}", quoted(type_name))));
                }
            };
            entries.push((name.to_owned(), value));
        }
        Ok(entries)
    }
}
