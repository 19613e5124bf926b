//! Values of a scene description: the types that our files need, with their names in text.

use std::sync::Arc;

/// How many numbers make an element of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Form {
    One,
    Vec2,
    Vec3,
    Vec4,
    /// Stored **wxyz** as in text; binary files hold xyzw.
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

/// Numbers of one type: an element or an array of elements. Shared, because variants repeat whole arrays.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Numbers<T> {
    pub(super) form: Form,
    pub(super) is_array: bool,
    /// All numbers; their count is a multiple of the form's width.
    pub(super) values: Arc<Vec<T>>,
}

impl<T> Numbers<T> {
    pub(super) fn element(form: Form, values: Vec<T>) -> Self {
        debug_assert_eq!(values.len(), form.width());
        Self { form, is_array: false, values: Arc::new(values) }
    }

    pub(super) fn array(form: Form, values: Vec<T>) -> Self {
        debug_assert_eq!(values.len() % form.width(), 0);
        Self { form, is_array: true, values: Arc::new(values) }
    }

    pub(super) fn num_elements(&self) -> usize {
        self.values.len() / self.form.width()
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
    /// A list edit that prepends these tokens to those of weaker layers: `apiSchemas`.
    Prepended(Vec<String>),
    Asset(String),
    Dictionary(Vec<(String, Value)>),
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

    /// The integer, if it is a single one.
    pub(super) fn as_int(&self) -> Option<i32> {
        match self {
            Self::Ints(n) if n.form == Form::One && !n.is_array => n.values.first().copied(),
            _ => None,
        }
    }

    /// The double, if it is a single one.
    pub(super) fn as_double(&self) -> Option<f64> {
        match self {
            Self::Doubles(n) if n.form == Form::One && !n.is_array => n.values.first().copied(),
            _ => None,
        }
    }

    /// Text of a string or token.
    pub(super) fn as_text(&self) -> Option<&str> {
        match self {
            Self::String(text) | Self::Token(text) => Some(text),
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

impl Kind {
    /// By its name in text without `[]`; `None`: a type that our files do not have.
    pub(super) fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "bool" => Self::Bool,
            "int" => Self::Int(Form::One),
            "int2" => Self::Int(Form::Vec2),
            "int4" => Self::Int(Form::Vec4),
            "float" => Self::Float(Form::One),
            "float2" | "texCoord2f" => Self::Float(Form::Vec2),
            "float3" | "point3f" | "color3f" => Self::Float(Form::Vec3),
            "float4" => Self::Float(Form::Vec4),
            "quatf" => Self::Float(Form::Quaternion),
            "double" => Self::Double(Form::One),
            "double3" => Self::Double(Form::Vec3),
            "quatd" => Self::Double(Form::Quaternion),
            "string" => Self::String,
            "token" => Self::Token,
            "asset" => Self::Asset,
            _ => return None,
        })
    }
}
