//! Values of a scene description: the types that our files need, with their names in text.

use std::sync::Arc;

/// How many numbers make an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Form {
    /// A number.
    One,
    /// Two.
    Vec2,
    /// Three.
    Vec3,
    /// Four.
    Vec4,
    /// Four: **wxyz**, as in text; binary files hold xyzw.
    Quaternion,
}

impl Form {
    /// Numbers of an element.
    pub(super) const fn width(self) -> usize {
        match self {
            Self::One => 1,
            Self::Vec2 => 2,
            Self::Vec3 => 3,
            Self::Vec4 | Self::Quaternion => 4,
        }
    }
}

/// Numbers of one type: an element or an array of elements. Shared, for the same array stands in several places.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Numbers<T> {
    /// Form of an element.
    pub(super) form: Form,
    /// Whether it is an array.
    pub(super) is_array: bool,
    /// All numbers; a multiple of the form's width.
    pub(super) values: Arc<Vec<T>>,
}

impl<T> Numbers<T> {
    /// A single element.
    pub(super) fn element(form: Form, values: Vec<T>) -> Self {
        debug_assert_eq!(values.len(), form.width());
        Self { form, is_array: false, values: Arc::new(values) }
    }

    /// An array.
    pub(super) fn array(form: Form, values: Vec<T>) -> Self {
        debug_assert_eq!(values.len() % form.width(), 0);
        Self { form, is_array: true, values: Arc::new(values) }
    }

    /// Number of elements.
    pub(super) fn num_elements(&self) -> usize {
        self.values.len() / self.form.width()
    }
}

/// Edits of a list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum ListOp {
    /// Put before what weaker layers say.
    Prepend(Vec<String>),
    /// Put behind it.
    Append(Vec<String>),
    /// Instead of it.
    Explicit(Vec<String>),
}

impl ListOp {
    /// What is listed.
    pub(super) fn items(&self) -> &[String] {
        match self {
            Self::Prepend(items) | Self::Append(items) | Self::Explicit(items) => items,
        }
    }
}

/// A value of a property or of metadata.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Bool(bool),
    Ints(Numbers<i32>),
    Floats(Numbers<f32>),
    Doubles(Numbers<f64>),
    String(String),
    Token(String),
    Tokens(Vec<String>),
    Asset(String),
    Dictionary(Vec<(String, Value)>),
    TokenList(ListOp),
}

impl Value {
    pub(super) fn int(value: i32) -> Self {
        Self::Ints(Numbers::element(Form::One, vec![value]))
    }

    pub(super) fn float(value: f32) -> Self {
        Self::Floats(Numbers::element(Form::One, vec![value]))
    }

    pub(super) fn double(value: f64) -> Self {
        Self::Doubles(Numbers::element(Form::One, vec![value]))
    }

    pub(super) fn token(value: &str) -> Self {
        Self::Token(value.to_owned())
    }

    pub(super) fn string(value: &str) -> Self {
        Self::String(value.to_owned())
    }

    /// The integer, if it is one.
    pub(super) fn as_int(&self) -> Option<i32> {
        match self {
            Self::Ints(n) if n.form == Form::One && !n.is_array => n.values.first().copied(),
            _ => None,
        }
    }

    /// The double, if it is one.
    pub(super) fn as_double(&self) -> Option<f64> {
        match self {
            Self::Doubles(n) if n.form == Form::One && !n.is_array => n.values.first().copied(),
            _ => None,
        }
    }

    /// Text of a string, token or asset.
    pub(super) fn as_text(&self) -> Option<&str> {
        match self {
            Self::String(text) | Self::Token(text) | Self::Asset(text) => Some(text),
            _ => None,
        }
    }
}

/// Type of a property's value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Bool,
    Int(Form),
    Float(Form),
    Double(Form),
    String,
    Token,
    Asset,
}

/// Type by its name in text without `[]`; `None`: not one of those that we need.
pub(super) fn kind_from_name(name: &str) -> Option<Kind> {
    Some(match name {
        "bool" => Kind::Bool,
        "int" => Kind::Int(Form::One),
        "int2" => Kind::Int(Form::Vec2),
        "int3" => Kind::Int(Form::Vec3),
        "int4" => Kind::Int(Form::Vec4),
        "float" => Kind::Float(Form::One),
        "float2" | "texCoord2f" => Kind::Float(Form::Vec2),
        "float3" | "point3f" | "vector3f" | "normal3f" | "color3f" | "texCoord3f" => Kind::Float(Form::Vec3),
        "float4" | "color4f" => Kind::Float(Form::Vec4),
        "quatf" => Kind::Float(Form::Quaternion),
        "double" => Kind::Double(Form::One),
        "double2" | "texCoord2d" => Kind::Double(Form::Vec2),
        "double3" | "point3d" | "vector3d" | "normal3d" | "color3d" => Kind::Double(Form::Vec3),
        "double4" | "color4d" => Kind::Double(Form::Vec4),
        "quatd" => Kind::Double(Form::Quaternion),
        "string" => Kind::String,
        "token" => Kind::Token,
        "asset" => Kind::Asset,
        _ => return None,
    })
}
