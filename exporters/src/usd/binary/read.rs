//! Reads a binary file, as [`super::write`] writes it, into a layer.

use super::read_tables::{ReadTables, Spec};
use super::read_values::Values;
use super::{END_OF_SET, Rep, spec, specifier, types};
use crate::usd::layer::{Content, Layer, Prim, Property, VariantSet};
use crate::usd::text_read::DEPTH_MAX;
use crate::usd::value::Value;
use crate::{Error, ReadLimits, Result, quoted};
use std::collections::HashMap;
use std::path::Path;

/// Values may decode to this many times the file's bytes (only integers are compressed), and [`SMALL_BYTES`].
const EXPANSION_MAX: u64 = 16;

/// See [`EXPANSION_MAX`].
const SMALL_BYTES: u64 = 32 << 20;

/// Most fields of a spec; ours have ten.
const FIELDS_MAX: usize = 64;

/// A layer with the sizes of its parts.
pub(in crate::usd) struct BinaryLayer {
    pub(in crate::usd) layer: Layer,
    /// Bytes of the tables and the header.
    pub(in crate::usd) table_bytes: u64,
    /// Path of a property and bytes of its value in the file.
    pub(in crate::usd) value_bytes: Vec<(String, u64)>,
}

/// Decodes a layer; `path` is only for messages.
///
/// # Errors
/// [`Error::Invalid`], [`Error::TooLarge`], [`Error::Unsupported`] naming the feature.
pub(in crate::usd) fn layer_from_binary(
    bytes: &[u8],
    path: &Path,
    limits: &ReadLimits,
) -> Result<BinaryLayer> {
    let tables = ReadTables::read(bytes, path, limits)?;
    let mut spec_by_path = HashMap::new();
    for spec in &tables.specs {
        if spec_by_path.insert(spec.path, *spec).is_some() {
            return Err(invalid!(path, "two specs of path {}", spec.path));
        }
    }
    let mut child_by_name = HashMap::new();
    for (i, node) in tables.paths.iter().enumerate().filter(|(_, n)| n.is_known) {
        let token = tables.token(node.token).unwrap_or_default();
        child_by_name.insert((node.parent, token, node.is_property), i as u32);
    }
    let budget = (bytes.len() as u64).saturating_mul(EXPANSION_MAX).saturating_add(SMALL_BYTES);
    let values = Values::new(bytes, &tables, path, budget.min(limits.decoded_bytes));
    let mut reader = Reader { tables: &tables, values, spec_by_path, child_by_name, value_bytes: Vec::new() };
    let root = tables.specs.iter().find(|s| s.kind == spec::PSEUDO_ROOT);
    let root = root.ok_or_else(|| Error::invalid(path, "no root"))?.path;
    let root = reader.prim(root, "", "", spec::PSEUDO_ROOT, 0)?;
    let layer = Layer { metadata: root.metadata, root_prims: root.children };
    Ok(BinaryLayer { layer, table_bytes: tables.num_bytes, value_bytes: reader.value_bytes })
}

struct Reader<'a> {
    tables: &'a ReadTables,
    values: Values<'a>,
    /// Specs that were not read yet.
    spec_by_path: HashMap<u32, Spec>,
    /// By parent, name and whether it is a property.
    child_by_name: HashMap<(u32, &'a str, bool), u32>,
    value_bytes: Vec<(String, u64)>,
}

impl<'a> Reader<'a> {
    /// Fields of a path's spec, which must be of a kind. Each spec is read once.
    fn fields(&mut self, path: u32, place: &str, kind: u32) -> Result<Vec<(&'a str, Rep)>> {
        let invalid = |what: String| self.values.invalid(place, what);
        let spec = self.spec_by_path.remove(&path);
        let spec = spec.ok_or_else(|| invalid("no spec, or listed twice".to_owned()))?;
        if spec.kind != kind {
            return Err(invalid(format!("spec of kind {}, expected {kind}", spec.kind)));
        }
        let set = self.tables.field_sets.get(spec.set as usize..);
        let set = set.ok_or_else(|| invalid(format!("set of fields {}", spec.set)))?;
        let mut fields = Vec::new();
        for &index in set.iter().take_while(|&&i| i != END_OF_SET) {
            let field = self.tables.fields.get(index as usize);
            let &(token, rep) = field.ok_or_else(|| invalid(format!("field {index}")))?;
            fields.push((self.tables.token(token).map_err(invalid)?, rep));
            if fields.len() > FIELDS_MAX {
                return Err(invalid(format!("more than {FIELDS_MAX} fields")));
            }
        }
        Ok(fields)
    }

    fn child(&self, parent: u32, element: &str, is_property: bool) -> Result<u32> {
        let child = self.child_by_name.get(&(parent, element, is_property)).copied();
        child.ok_or_else(|| self.values.invalid(element, "listed as a child, but there is no such path"))
    }

    /// A prim, a variant or the root, by its path's index. `place` is the path's text.
    fn prim(&mut self, path: u32, place: &str, name: &str, kind: u32, depth: usize) -> Result<Prim> {
        if depth > DEPTH_MAX {
            return Err(self.values.unsupported(place, format!("prims nested more than {DEPTH_MAX} deep")));
        }
        // The path is kept with each property.
        self.values.spend(2 * size_of::<Prim>() + place.len() + name.len())?;
        let mut prim = Prim { name: name.to_owned(), ..Prim::default() };
        let (mut properties, mut children, mut sets) = (Vec::new(), Vec::new(), Vec::new());
        let mut chosen = None;
        for (field, rep) in self.fields(path, place, kind)? {
            match field {
                "specifier" => self.check_specifier(rep, kind, place)?,
                "typeName" => prim.type_name = self.token(rep, place)?,
                "properties" => properties = self.names(rep, place)?,
                "primChildren" => children = self.names(rep, place)?,
                "variantSetChildren" => sets = self.names(rep, place)?,
                // The same names as in `variantSetChildren`.
                "variantSetNames" if rep.value_type() == types::STRING_LIST_OP => {}
                "variantSelection" => chosen = Some(self.values.variant_selection(rep, place)?),
                "apiSchemas" | "customLayerData" | "defaultPrim" | "metersPerUnit" | "upAxis" => {
                    let value = self.values.read(rep, field, 0)?;
                    self.count(format!("{place} {field}"))?;
                    prim.metadata.push((field.to_owned(), value));
                }
                _ => return Err(self.values.unsupported(place, format!("the field {}", quoted(field)))),
            }
        }
        for name in properties {
            let property = self.child(path, &name, true)?;
            prim.properties.push(self.property(property, place, name)?);
        }
        for name in children {
            let child = self.child(path, &name, false)?;
            prim.children.push(self.prim(child, &format!("{place}/{name}"), &name, spec::PRIM, depth + 1)?);
        }
        match (sets.as_slice(), chosen) {
            ([], None) => {}
            ([set], Some((name, selection))) if *set == name => {
                let variants = self.variants(path, place, set, depth)?;
                prim.variant_set = Some(VariantSet { name, selection, variants });
            }
            _ => return Err(self.values.unsupported(place, format!("{} variant sets", sets.len()))),
        }
        Ok(prim)
    }

    fn check_specifier(&self, rep: Rep, kind: u32, place: &str) -> Result<()> {
        let expected = if kind == spec::VARIANT { specifier::OVER } else { specifier::DEF };
        if rep == Rep::inlined(types::SPECIFIER, expected) {
            return Ok(());
        }
        Err(self.values.unsupported(place, format!("the specifier {}", rep.word())))
    }

    fn variants(&mut self, prim: u32, place: &str, set: &str, depth: usize) -> Result<Vec<Prim>> {
        let path = self.child(prim, &format!("{{{set}=}}"), false)?;
        let mut variants = Vec::new();
        for (field, rep) in self.fields(path, place, spec::VARIANT_SET)? {
            if field != "variantChildren" {
                return Err(self.values.unsupported(place, format!("the field {}", quoted(field))));
            }
            for name in self.names(rep, place)? {
                let element = format!("{{{set}={name}}}");
                let path = self.child(prim, &element, false)?;
                let within = format!("{place}{element}");
                variants.push(self.prim(path, &within, &name, spec::VARIANT, depth + 1)?);
            }
        }
        Ok(variants)
    }

    fn property(&mut self, path: u32, prim: &str, name: String) -> Result<Property> {
        self.values.spend(2 * size_of::<Property>() + prim.len() + 2 * name.len())?;
        let place = format!("{prim}.{name}");
        let kind = self.spec_by_path.get(&path).map(|s| s.kind);
        let is_relationship = kind == Some(spec::RELATIONSHIP);
        let expected = if is_relationship { spec::RELATIONSHIP } else { spec::ATTRIBUTE };
        let (mut is_custom, mut is_uniform) = (false, false);
        let (mut type_name, mut value, mut connection, mut target) = (String::new(), None, None, None);
        let mut metadata = Vec::new();
        for (field, rep) in self.fields(path, &place, expected)? {
            match field {
                "custom" => is_custom = rep.word() != 0,
                "variability" => is_uniform = rep.word() != 0,
                "typeName" => type_name = self.token(rep, &place)?,
                "default" => {
                    value = Some(self.values.read(rep, &place, 0)?);
                    self.count(place.clone())?;
                }
                "connectionPaths" if !is_relationship => connection = Some(self.path_text(rep, &place)?),
                "targetPaths" if is_relationship => target = Some(self.path_text(rep, &place)?),
                "interpolation" => metadata.push((field.to_owned(), Value::Token(self.token(rep, &place)?))),
                _ => return Err(self.values.unsupported(&place, format!("the field {}", quoted(field)))),
            }
        }
        let content = match target {
            Some(target) => Content::Relationship { target },
            None if is_relationship => return Err(self.values.unsupported(&place, "no target")),
            None => Content::Attribute { type_name, is_uniform, value, connection },
        };
        Ok(Property { name, is_custom, content, metadata })
    }

    /// Notes the bytes of the value that was read last.
    fn count(&mut self, place: String) -> Result<()> {
        if self.values.last_bytes > 0 {
            self.values.spend(place.len() + 64)?;
            self.value_bytes.push((place, self.values.last_bytes));
        }
        Ok(())
    }

    fn token(&mut self, rep: Rep, place: &str) -> Result<String> {
        match self.values.read(rep, place, 0)? {
            Value::Token(text) => Ok(text),
            _ => Err(self
                .values
                .invalid(place, format!("a value of type {}, expected a token", rep.value_type()))),
        }
    }

    fn names(&mut self, rep: Rep, place: &str) -> Result<Vec<String>> {
        match self.values.read(rep, place, 0)? {
            Value::Tokens(names) if rep.value_type() == types::TOKEN_VECTOR => Ok(names),
            _ => Err(self.values.invalid(place, "names of children that are not a vector of tokens")),
        }
    }

    /// Text of the only path in a list.
    fn path_text(&mut self, rep: Rep, place: &str) -> Result<String> {
        let index = self.values.path_index(rep, place)?;
        let (mut elements, mut at) = (Vec::new(), index);
        loop {
            let node = self.tables.paths.get(at as usize).filter(|n| n.is_known);
            let node = node.ok_or_else(|| self.values.invalid(place, format!("path {at}")))?;
            if node.parent == at {
                break;
            }
            if elements.len() > 2 * DEPTH_MAX {
                return Err(self.values.invalid(place, format!("path {index} is nested too deep")));
            }
            elements.push(self.tables.token(node.token).map_err(|what| self.values.invalid(place, what))?);
            elements.push(if node.is_property { "." } else { "/" });
            at = node.parent;
        }
        self.values.spend(elements.iter().map(|e| e.len()).sum::<usize>())?;
        Ok(elements.iter().rev().copied().collect())
    }
}
