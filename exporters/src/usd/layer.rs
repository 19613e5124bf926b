//! A scene description in memory: what a layer of OpenUSD holds, as far as our files need it. Both writers serialise it
//! and both readers return it, so that text and binary files cannot differ.

use super::value::Value;

/// Names and values, in the order in which they are written.
pub(super) type Metadata = Vec<(String, Value)>;

/// The value of an entry, by name.
pub(super) fn entry<'a>(metadata: &'a [(String, Value)], name: &str) -> Option<&'a Value> {
    metadata.iter().find(|(n, _)| n == name).map(|(_, v)| v)
}

/// A file's scene description.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Layer {
    /// `upAxis`, `customLayerData`, ...
    pub(super) metadata: Metadata,
    pub(super) root_prims: Vec<Prim>,
}

/// A prim (`def`), or a variant: then only `name` and `children` count.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Prim {
    pub(super) name: String,
    /// Schema of the prim; empty for variants.
    pub(super) type_name: String,
    /// `apiSchemas`.
    pub(super) metadata: Metadata,
    pub(super) properties: Vec<Property>,
    pub(super) children: Vec<Prim>,
    pub(super) variant_set: Option<VariantSet>,
}

/// Alternatives of a prim.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct VariantSet {
    pub(super) name: String,
    /// Name of the variant that is shown.
    pub(super) selection: String,
    pub(super) variants: Vec<Prim>,
}

/// What a property is.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Content {
    /// An attribute with a value, with a connection to another attribute, or only declared.
    Attribute {
        /// Ends in `[]` for arrays.
        type_name: String,
        is_uniform: bool,
        value: Option<Value>,
        /// Path of the attribute that supplies the value.
        connection: Option<String>,
    },
    /// A relationship to the prim at a path.
    Relationship { target: String },
}

/// An attribute or a relationship.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Property {
    /// With namespaces: `primvars:st`.
    pub(super) name: String,
    /// Whether no schema defines it.
    pub(super) is_custom: bool,
    pub(super) content: Content,
    /// `interpolation` of primvars.
    pub(super) metadata: Metadata,
}

impl Property {
    /// An attribute with a value.
    pub(super) fn new(type_name: &str, name: &str, value: Value) -> Self {
        Self::attribute(type_name, name, Some(value), None)
    }

    /// An attribute with a value that does not change over time.
    pub(super) fn uniform(type_name: &str, name: &str, value: Value) -> Self {
        let mut property = Self::new(type_name, name, value);
        if let Content::Attribute { is_uniform, .. } = &mut property.content {
            *is_uniform = true;
        }
        property
    }

    /// An attribute without a value: an output of a shader.
    pub(super) fn declaration(type_name: &str, name: &str) -> Self {
        Self::attribute(type_name, name, None, None)
    }

    /// An attribute that takes its value from another.
    pub(super) fn connected(type_name: &str, name: &str, source: String) -> Self {
        Self::attribute(type_name, name, None, Some(source))
    }

    fn attribute(type_name: &str, name: &str, value: Option<Value>, connection: Option<String>) -> Self {
        let type_name = type_name.to_owned();
        let content = Content::Attribute { type_name, is_uniform: false, value, connection };
        Self { name: name.to_owned(), is_custom: false, content, metadata: Vec::new() }
    }

    pub(super) fn relationship(name: &str, target: String) -> Self {
        let content = Content::Relationship { target };
        Self { name: name.to_owned(), is_custom: false, content, metadata: Vec::new() }
    }

    /// The same property outside all schemas.
    pub(super) fn custom(mut self) -> Self {
        self.is_custom = true;
        self
    }

    /// The same property as a primvar with an interpolation.
    pub(super) fn interpolated(mut self, interpolation: &str) -> Self {
        self.metadata.push(("interpolation".to_owned(), Value::token(interpolation)));
        self
    }

    /// Its value, if it is an attribute that has one.
    pub(super) fn value(&self) -> Option<&Value> {
        match &self.content {
            Content::Attribute { value, .. } => value.as_ref(),
            Content::Relationship { .. } => None,
        }
    }
}

impl Prim {
    /// `def TYPE "NAME"`.
    pub(super) fn def(type_name: &str, name: &str) -> Self {
        Self { name: name.to_owned(), type_name: type_name.to_owned(), ..Self::default() }
    }

    /// Applies API schemas.
    pub(super) fn apply(&mut self, schemas: &[&str]) {
        let names = schemas.iter().map(|s| (*s).to_owned()).collect();
        self.metadata.push(("apiSchemas".to_owned(), Value::Prepended(names)));
    }

    /// Names of the applied API schemas.
    pub(super) fn applied(&self) -> &[String] {
        match entry(&self.metadata, "apiSchemas") {
            Some(Value::Prepended(names)) => names,
            _ => &[],
        }
    }

    pub(super) fn property(&self, name: &str) -> Option<&Property> {
        self.properties.iter().find(|p| p.name == name)
    }

    /// Value of an attribute, by name.
    pub(super) fn value(&self, name: &str) -> Option<&Value> {
        self.property(name)?.value()
    }
}

/// Calls `visit` with every prim of a layer and its path (`/Scene{set=variant}Child`), parents before children.
pub(super) fn for_each_prim<'a>(layer: &'a Layer, visit: &mut impl FnMut(&str, &'a Prim)) {
    fn walk<'a>(path: &str, prim: &'a Prim, visit: &mut impl FnMut(&str, &'a Prim)) {
        visit(path, prim);
        for child in &prim.children {
            walk(&format!("{path}/{}", child.name), child, visit);
        }
        let Some(set) = &prim.variant_set else { return };
        for variant in &set.variants {
            for child in &variant.children {
                walk(&format!("{path}{{{}={}}}{}", set.name, variant.name, child.name), child, visit);
            }
        }
    }
    for prim in &layer.root_prims {
        walk(&format!("/{}", prim.name), prim, visit);
    }
}
