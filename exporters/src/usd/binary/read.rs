//! Reads a binary file into a layer.

use super::read_tables::{ReadTables, Spec};
use super::read_values::Values;
use super::{END_OF_SET, Rep, spec, types};
use crate::usd::layer::{Content, Layer, Metadata, Prim, Property, Specifier, VariantSet};
use crate::usd::text_read::DEPTH_MAX;
use crate::usd::value::Value;
use crate::{Error, ReadLimits, Result};
use std::collections::HashMap;
use std::path::Path;

/// Values may decode to so many times the file's bytes (only integers are compressed) and [`SMALL_BYTES`].
const EXPANSION_MAX: u64 = 16;

/// See [`EXPANSION_MAX`].
const SMALL_BYTES: u64 = 32 << 20;

/// A layer and what its parts weigh.
pub(in crate::usd) struct BinaryLayer {
    pub(in crate::usd) layer: Layer,
    /// Bytes of the tables and the header.
    pub(in crate::usd) table_bytes: u64,
    /// Path of a property and bytes of its value in the file.
    pub(in crate::usd) value_bytes: Vec<(String, u64)>,
}

/// A layer from a binary file; `path` is only for messages.
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
            return Err(Error::invalid(path, format!("two specs of path {}", spec.path)));
        }
    }
    let mut child_by_name = HashMap::new();
    for (i, node) in tables.paths.iter().enumerate().filter(|(_, n)| n.is_known) {
        child_by_name
            .insert((node.parent, tables.token(node.token).unwrap_or_default(), node.is_property), i as u32);
    }
    let budget = (bytes.len() as u64).saturating_mul(EXPANSION_MAX).saturating_add(SMALL_BYTES);
    let values = Values::new(bytes, &tables, path, budget.min(limits.decoded_bytes));
    let mut reader =
        Reader { tables: &tables, values, path, spec_by_path, child_by_name, value_bytes: Vec::new() };
    let root = tables.specs.iter().find(|s| s.kind == spec::PSEUDO_ROOT);
    let root = root.ok_or_else(|| Error::invalid(path, "no root"))?.path;
    let root_prim = reader.prim(root, "", "", spec::PSEUDO_ROOT, 0)?;
    let layer = Layer { metadata: root_prim.metadata, prims: root_prim.children };
    Ok(BinaryLayer { layer, table_bytes: tables.num_bytes, value_bytes: reader.value_bytes })
}

struct Reader<'a> {
    tables: &'a ReadTables,
    values: Values<'a>,
    path: &'a Path,
    /// Specs that nobody has taken yet.
    spec_by_path: HashMap<u32, Spec>,
    /// By parent, name and whether it is a property.
    child_by_name: HashMap<(u32, &'a str, bool), u32>,
    value_bytes: Vec<(String, u64)>,
}

impl<'a> Reader<'a> {
    fn invalid(&self, name: &str, what: impl std::fmt::Display) -> Error {
        Error::invalid(self.path, format!("{name}: {what}"))
    }

    /// Fields of a path's spec, which must be of a kind. Each spec is taken once.
    fn fields(&mut self, path: u32, name: &str, kind: u32) -> Result<Vec<(&'a str, Rep)>> {
        let spec =
            self.spec_by_path.remove(&path).ok_or_else(|| self.invalid(name, "no spec, or listed twice"))?;
        if spec.kind != kind {
            return Err(self.invalid(name, format!("spec of kind {}, expected {kind}", spec.kind)));
        }
        let set = self.tables.field_sets.get(spec.set as usize..);
        let set = set.ok_or_else(|| self.invalid(name, format!("set of fields {}", spec.set)))?;
        let mut fields = Vec::new();
        for &index in set.iter().take_while(|&&i| i != END_OF_SET) {
            let field = self.tables.fields.get(index as usize);
            let &(token, rep) = field.ok_or_else(|| self.invalid(name, format!("field {index}")))?;
            let text = self.tables.token(token).map_err(|what| self.invalid(name, what))?;
            fields.push((text, rep));
            if fields.len() > 1024 {
                return Err(self.invalid(name, "more than 1024 fields"));
            }
        }
        Ok(fields)
    }

    fn child(&self, parent: u32, element: &str, is_property: bool) -> Result<u32> {
        let child = self.child_by_name.get(&(parent, element, is_property)).copied();
        child.ok_or_else(|| self.invalid(element, "listed as a child, but there is no such path"))
    }

    /// A prim, a variant or the root. `path` is its index, `name` its text.
    fn prim(&mut self, path: u32, place: &str, name: &str, kind: u32, depth: usize) -> Result<Prim> {
        if depth > DEPTH_MAX {
            let what = format!("{place}: prims nested more than {DEPTH_MAX} deep");
            return Err(Error::unsupported(self.path, what));
        }
        // Paths are told for each prim and property.
        self.values.spend(2 * size_of::<Prim>() + place.len() + name.len())?;
        let mut prim = Prim { name: name.to_owned(), ..Prim::default() };
        let (mut properties, mut children, mut sets, mut chosen) = (vec![], vec![], vec![], vec![]);
        for (field, rep) in self.fields(path, place, kind)? {
            match field {
                "specifier" => {
                    let specifier = Specifier::ALL.get(rep.payload() as usize).copied();
                    prim.specifier = specifier
                        .filter(|_| rep.value_type() == types::SPECIFIER)
                        .ok_or_else(|| self.invalid(place, format!("specifier {}", rep.payload())))?;
                }
                "typeName" => prim.type_name = self.text(rep, place)?,
                "properties" => properties = self.names(rep, place)?,
                "primChildren" => children = self.names(rep, place)?,
                "variantSetChildren" => sets = self.names(rep, place)?,
                "variantSetNames" => {}
                "variantSelection" => chosen = self.values.variant_selection(rep)?,
                "primOrder" | "propertyOrder" => {
                    return Err(Error::unsupported(self.path, format!("{place}: {field}")));
                }
                _ => {
                    let value = self.values.read(rep, &format!("{place} {field}"), 0)?;
                    self.count(place, field)?;
                    prim.metadata.push((field.to_owned(), value));
                }
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
        for name in sets {
            let selection = chosen.iter().find(|(set, _)| *set == name).map(|(_, v)| v.clone());
            let variants = self.variants(path, place, &name, depth)?;
            prim.variant_sets.push(VariantSet { name, selection: selection.unwrap_or_default(), variants });
        }
        Ok(prim)
    }

    fn variants(&mut self, prim: u32, place: &str, set: &str, depth: usize) -> Result<Vec<Prim>> {
        let path = self.child(prim, &format!("{{{set}=}}"), false)?;
        let mut names = Vec::new();
        for (field, rep) in self.fields(path, place, spec::VARIANT_SET)? {
            if field == "variantChildren" {
                names = self.names(rep, place)?;
            }
        }
        let mut variants = Vec::new();
        for name in names {
            let element = format!("{{{set}={name}}}");
            let path = self.child(prim, &element, false)?;
            variants.push(self.prim(path, &format!("{place}{element}"), &name, spec::VARIANT, depth + 1)?);
        }
        Ok(variants)
    }

    fn property(&mut self, path: u32, prim: &str, name: String) -> Result<Property> {
        self.values.spend(2 * size_of::<Property>() + prim.len() + 2 * name.len())?;
        let place = format!("{prim}.{name}");
        let kind = self.spec_by_path.get(&path).map_or(spec::ATTRIBUTE, |s| s.kind);
        let is_relationship = kind == spec::RELATIONSHIP;
        let fields = self.fields(path, &place, if is_relationship { kind } else { spec::ATTRIBUTE })?;
        let (mut is_custom, mut is_uniform) = (false, false);
        let (mut type_name, mut value, mut paths) = (String::new(), None, Vec::new());
        let mut metadata = Metadata::new();
        for (field, rep) in fields {
            match field {
                "custom" => is_custom = rep.payload() != 0,
                "variability" => is_uniform = rep.payload() != 0,
                "typeName" => type_name = self.text(rep, &place)?,
                "default" => {
                    value = Some(self.values.read(rep, &place, 0)?);
                    self.count(&place, "")?;
                }
                "connectionPaths" | "targetPaths" => paths = self.path_texts(rep, &place)?,
                "timeSamples" | "spline" => {
                    return Err(Error::unsupported(
                        self.path,
                        format!("{place}: values over time ({field})"),
                    ));
                }
                _ => {
                    let value = self.values.read(rep, &format!("{place} {field}"), 0)?;
                    self.count(&place, field)?;
                    metadata.push((field.to_owned(), value));
                }
            }
        }
        let content = if is_relationship {
            Content::Relationship { targets: paths }
        } else {
            Content::Attribute { type_name, is_uniform, value, connections: paths }
        };
        Ok(Property { name, is_custom, content, metadata })
    }

    /// Notes the bytes of the value that was read last.
    fn count(&mut self, place: &str, field: &str) -> Result<()> {
        if self.values.last_bytes > 0 {
            let name = if field.is_empty() { place.to_owned() } else { format!("{place} {field}") };
            self.values.spend(name.len() + 64)?;
            self.value_bytes.push((name, self.values.last_bytes));
        }
        Ok(())
    }

    fn text(&mut self, rep: Rep, place: &str) -> Result<String> {
        match self.values.read(rep, place, 0)? {
            Value::Token(text) | Value::String(text) => Ok(text),
            other => Err(self.invalid(place, format!("{other:?}, expected a token"))),
        }
    }

    fn names(&mut self, rep: Rep, place: &str) -> Result<Vec<String>> {
        match self.values.read(rep, place, 0)? {
            Value::Tokens(names) if rep.value_type() == types::TOKEN_VECTOR => Ok(names),
            _ => Err(self.invalid(place, "names of children that are no vector of tokens")),
        }
    }

    /// Texts of the paths in a list.
    fn path_texts(&mut self, rep: Rep, place: &str) -> Result<Vec<String>> {
        let indices = self.values.path_indices(rep, place)?;
        let mut texts = Vec::new();
        for index in indices {
            let elements = self.path_elements(index).map_err(|what| self.invalid(place, what))?;
            self.values.spend(elements.iter().map(|e| e.len() + 1).sum::<usize>() + size_of::<String>())?;
            texts.push(path_text(&elements));
        }
        Ok(texts)
    }

    /// Tokens from the root to a path; with what stands before each.
    fn path_elements(&self, path: u32) -> Result<Vec<Element<'a>>, String> {
        let (mut elements, mut at) = (Vec::new(), path);
        loop {
            let node = self.tables.paths.get(at as usize).filter(|n| n.is_known);
            let node = node.ok_or_else(|| format!("path {at} of {}", self.tables.paths.len()))?;
            if node.parent == at {
                break;
            }
            if elements.len() > DEPTH_MAX {
                return Err(format!("path {path} is nested more than {DEPTH_MAX} deep"));
            }
            let token = self.tables.token(node.token)?;
            elements.push(match (node.is_property, token.starts_with('{')) {
                (true, _) => Element { separator: ".", token },
                (false, true) => Element { separator: "", token },
                (false, false) => Element { separator: "/", token },
            });
            at = node.parent;
        }
        elements.reverse();
        Ok(elements)
    }
}

/// A step of a path.
struct Element<'a> {
    separator: &'static str,
    token: &'a str,
}

impl Element<'_> {
    fn len(&self) -> usize {
        self.token.len()
    }
}

fn path_text(elements: &[Element<'_>]) -> String {
    elements.iter().flat_map(|e| [e.separator, e.token]).collect()
}
