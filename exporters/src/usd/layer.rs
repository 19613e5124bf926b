//! A scene description in memory: what a layer of OpenUSD holds, as far as our files need it. Both writers serialise it
//! and both readers return it, so that text and binary files cannot differ.

use super::value::{ListOp, Value};

/// Whether a prim is there or only spoken about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Specifier {
    /// `def`
    #[default]
    Def,
    /// `over`
    Over,
    /// `class`
    Class,
}

impl Specifier {
    /// By number in binary files.
    pub(super) const ALL: [Self; 3] = [Self::Def, Self::Over, Self::Class];

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Def => "def",
            Self::Over => "over",
            Self::Class => "class",
        }
    }
}

/// Names and values, in the order in which they are written.
pub(super) type Metadata = Vec<(String, Value)>;

/// The entry of a name.
pub(super) fn entry<'a>(metadata: &'a [(String, Value)], name: &str) -> Option<&'a Value> {
    metadata.iter().find(|(n, _)| n == name).map(|(_, v)| v)
}

/// A file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Layer {
    /// `upAxis`, `customLayerData`, ...
    pub(super) metadata: Metadata,
    /// Root prims.
    pub(super) prims: Vec<Prim>,
}

/// A prim, or a variant: then only `name`, `properties`, `children` and `variant_sets` count.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Prim {
    pub(super) name: String,
    pub(super) specifier: Specifier,
    /// Empty: none.
    pub(super) type_name: String,
    /// `apiSchemas`, `kind`, ...
    pub(super) metadata: Metadata,
    pub(super) properties: Vec<Property>,
    pub(super) children: Vec<Prim>,
    pub(super) variant_sets: Vec<VariantSet>,
}

/// Alternatives of a prim.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct VariantSet {
    pub(super) name: String,
    /// Name of the variant that is shown; empty: none.
    pub(super) selection: String,
    pub(super) variants: Vec<Prim>,
}

/// What a property is.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Content {
    /// A value, or a connection to another attribute, or only a declaration.
    Attribute {
        /// With `[]` for arrays.
        type_name: String,
        is_uniform: bool,
        value: Option<Value>,
        /// Paths of attributes.
        connections: Vec<String>,
    },
    /// Paths of prims.
    Relationship { targets: Vec<String> },
}

/// An attribute or a relationship.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Property {
    /// With namespaces: `primvars:st`.
    pub(super) name: String,
    /// Not of any schema.
    pub(super) is_custom: bool,
    pub(super) content: Content,
    /// `interpolation`, ...
    pub(super) metadata: Metadata,
}

impl Property {
    /// An attribute with a value.
    pub(super) fn new(type_name: &str, name: &str, value: Value) -> Self {
        let content = Content::Attribute {
            type_name: type_name.to_owned(),
            is_uniform: false,
            value: Some(value),
            connections: Vec::new(),
        };
        Self { name: name.to_owned(), is_custom: false, content, metadata: Vec::new() }
    }

    /// An attribute that does not change over time.
    pub(super) fn uniform(type_name: &str, name: &str, value: Value) -> Self {
        let mut property = Self::new(type_name, name, value);
        if let Content::Attribute { is_uniform, .. } = &mut property.content {
            *is_uniform = true;
        }
        property
    }

    /// An attribute without a value: an output of a shader.
    pub(super) fn declaration(type_name: &str, name: &str) -> Self {
        Self::connected(type_name, name, Vec::new())
    }

    /// An attribute that takes its value from others.
    pub(super) fn connected(type_name: &str, name: &str, connections: Vec<String>) -> Self {
        let content = Content::Attribute {
            type_name: type_name.to_owned(),
            is_uniform: false,
            value: None,
            connections,
        };
        Self { name: name.to_owned(), is_custom: false, content, metadata: Vec::new() }
    }

    /// A relationship.
    pub(super) fn relationship(name: &str, target: String) -> Self {
        let content = Content::Relationship { targets: vec![target] };
        Self { name: name.to_owned(), is_custom: false, content, metadata: Vec::new() }
    }

    /// The same outside of all schemas.
    pub(super) fn custom(mut self) -> Self {
        self.is_custom = true;
        self
    }

    /// The same with an interpolation: a primvar.
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
        self.metadata.push(("apiSchemas".to_owned(), Value::TokenList(ListOp::Prepend(names))));
    }

    /// Names of the applied API schemas.
    pub(super) fn applied(&self) -> &[String] {
        match entry(&self.metadata, "apiSchemas") {
            Some(Value::TokenList(list)) => list.items(),
            _ => &[],
        }
    }

    /// A property by name.
    pub(super) fn property(&self, name: &str) -> Option<&Property> {
        self.properties.iter().find(|p| p.name == name)
    }

    /// Value of an attribute.
    pub(super) fn value(&self, name: &str) -> Option<&Value> {
        self.property(name)?.value()
    }
}

/// Calls with every prim of a layer and its path (`/Scene{set=variant}Child`), from the root down.
pub(super) fn for_each_prim<'a>(layer: &'a Layer, visit: &mut impl FnMut(&str, &'a Prim)) {
    fn walk<'a>(path: &str, prim: &'a Prim, visit: &mut impl FnMut(&str, &'a Prim)) {
        visit(path, prim);
        for child in &prim.children {
            walk(&format!("{path}/{}", child.name), child, visit);
        }
        for set in &prim.variant_sets {
            for variant in &set.variants {
                for child in &variant.children {
                    let within = format!("{path}{{{}={}}}{}", set.name, variant.name, child.name);
                    walk(&within, child, visit);
                }
            }
        }
    }
    for prim in &layer.prims {
        walk(&format!("/{}", prim.name), prim, visit);
    }
}
