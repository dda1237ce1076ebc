//! The objects of a scene file, and access to their values. Values that are not read are reported at the end.

use std::cell::Cell;

use glam::{DAffine3, DMat4, DVec3};

use super::placement::Transform;
use super::value::Value;
use crate::import::path::TransformPath;
use crate::import::text_place::{TextFault, TextPlace};
use crate::text::shortened;

/// Index of an object in [`Document::objects`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct ObjectId(pub(super) usize);

/// The class of a plugin: its tag.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Class {
    Bsdf,
    Emitter,
    Film,
    Integrator,
    Medium,
    Phase,
    Filter,
    Sampler,
    Sensor,
    Shape,
    Texture,
    Volume,
    /// Subsurface models, random generators and other obsolete classes.
    Other,
}

impl Class {
    /// Returns the class of an XML tag; `None`: it is not a plugin's.
    pub(super) fn of_tag(tag: &str) -> Option<Self> {
        Some(match tag {
            "bsdf" => Self::Bsdf,
            "emitter" | "luminaire" => Self::Emitter,
            "film" => Self::Film,
            "integrator" => Self::Integrator,
            "medium" => Self::Medium,
            "phase" => Self::Phase,
            "rfilter" => Self::Filter,
            "sampler" => Self::Sampler,
            "sensor" | "camera" => Self::Sensor,
            "shape" => Self::Shape,
            "texture" | "spectrum" => Self::Texture,
            "volume" => Self::Volume,
            "subsurface" | "random" | "util" | "test" => Self::Other,
            _ => return None,
        })
    }

    /// Returns the name for messages.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Bsdf => "bsdf",
            Self::Emitter => "emitter",
            Self::Film => "film",
            Self::Integrator => "integrator",
            Self::Medium => "medium",
            Self::Phase => "phase",
            Self::Filter => "rfilter",
            Self::Sampler => "sampler",
            Self::Sensor => "sensor",
            Self::Shape => "shape",
            Self::Texture => "texture",
            Self::Volume => "volume",
            Self::Other => "plugin",
        }
    }
}

/// A named value of an object.
#[derive(Debug)]
pub(super) struct ObjectProperty {
    pub(super) name: String,
    pub(super) value: Value,
    /// Location in the file.
    pub(super) at: TextPlace,
    /// `true`: the property was read.
    pub(super) used: Cell<bool>,
}

/// A nested object.
#[derive(Debug)]
pub(super) struct Child {
    /// Name of the child's role; empty if only its class matters.
    pub(super) name: String,
    pub(super) object: ObjectId,
    /// Location of the child's tag or reference.
    pub(super) at: TextPlace,
    /// `true`: the child was read.
    pub(super) used: Cell<bool>,
}

/// An instance of a plugin.
#[derive(Debug)]
pub(super) struct Object {
    /// Class, by its tag.
    pub(super) class: Class,
    /// Name of the plugin.
    pub(super) plugin: String,
    /// Id in the file; may be empty.
    pub(super) id: String,
    /// Location of the object's tag.
    pub(super) at: TextPlace,
    pub(super) properties: Vec<ObjectProperty>,
    /// Nested and referenced objects.
    pub(super) children: Vec<Child>,
}

/// A scene file with all included files.
#[derive(Debug)]
pub(super) struct Document {
    /// All objects, by their [`ObjectId`].
    pub(super) objects: Vec<Object>,
    /// Objects at the top of the scene, in order.
    pub(super) roots: Vec<ObjectId>,
    /// `true`: a Mitsuba 0.x file, which has some other defaults.
    pub(super) is_old: bool,
    /// Further folders in which files are searched.
    pub(super) search_folders: Vec<String>,
}

impl Document {
    /// Returns the object of an id.
    pub(super) fn get(&self, id: ObjectId) -> &Object {
        &self.objects[id.0]
    }
}

impl Object {
    /// Returns a property by name, and marks it as read; `None`: there is none.
    pub(super) fn property(&self, name: &str) -> Option<&ObjectProperty> {
        let property = self.properties.iter().find(|property| property.name == name)?;
        property.used.set(true);
        Some(property)
    }

    /// Returns the nested object of a role, and marks it as read; `None`: there is none.
    pub(super) fn child(&self, name: &str) -> Option<&Child> {
        let child = self.children.iter().find(|child| child.name == name)?;
        child.used.set(true);
        Some(child)
    }

    /// Returns class and plugin, for messages.
    pub(super) fn describe(&self) -> String {
        format!("{} `{}`", self.class.name(), shortened(&self.plugin))
    }

    /// Returns the name for the object made of it: its id.
    pub(super) fn label(&self) -> String {
        self.id.clone()
    }

    /// Marks all the object's values as read, so that those of an unsupported object are not reported one by one.
    pub(super) fn accept_all(&self) {
        self.properties.iter().for_each(|property| property.used.set(true));
        self.children.iter().for_each(|child| child.used.set(true));
    }

    /// Returns true if the object has a value or a nested object of that name, and marks it as read.
    pub(super) fn has(&self, name: &str) -> bool {
        self.property(name).is_some() || self.child(name).is_some()
    }

    /// Returns a transformation; the identity if it is not given.
    pub(super) fn transform(&self, name: &str) -> Result<DMat4, TextFault> {
        self.full_transform(name).map(|transform| transform.matrix)
    }

    /// Returns a transformation with Mitsuba's inverse of it; of one that is animated, the first.
    pub(super) fn full_transform(&self, name: &str) -> Result<Transform, TextFault> {
        match self.property(name) {
            None => Ok(Transform::IDENTITY),
            Some(ObjectProperty { value: Value::Transform(transform), .. }) => Ok(**transform),
            Some(ObjectProperty { value: Value::Animation(keys), .. }) => Ok(keys[0].1),
            Some(property) => Err(property.wrong("a transformation")),
        }
    }

    /// Returns the path of a transformation that is animated; `None`: it is not.
    pub(super) fn animation(&self, name: &str) -> Option<TransformPath> {
        let Some(ObjectProperty { value: Value::Animation(keys), .. }) = self.property(name) else { return None };
        TransformPath::new(keys.iter().map(|(time, key)| (*time, DAffine3::from_mat4(key.matrix))).collect())
    }

    /// Returns a number property; `None`: the object lacks it.
    pub(super) fn float(&self, name: &str) -> Result<Option<f64>, TextFault> {
        match self.property(name) {
            None => Ok(None),
            Some(ObjectProperty { value: Value::Float(number), .. }) => Ok(Some(*number)),
            Some(ObjectProperty { value: Value::Integer(number), .. }) => Ok(Some(*number as f64)),
            Some(property) => Err(property.wrong("a number")),
        }
    }

    /// Returns a number that is at least `least`, or the default if it is not given.
    pub(super) fn float_at_least(&self, name: &str, least: f64, default: f64) -> Result<f64, TextFault> {
        let number = self.float(name)?.unwrap_or(default);
        if number < least {
            let at = self.property(name).map_or(self.at, |property| property.at);
            return Err(at.fault(format!("`{name}` is below {least}")));
        }
        Ok(number)
    }

    /// Returns an integer property; `None`: the object lacks it.
    pub(super) fn integer(&self, name: &str) -> Result<Option<i64>, TextFault> {
        match self.property(name) {
            None => Ok(None),
            Some(ObjectProperty { value: Value::Integer(number), .. }) => Ok(Some(*number)),
            Some(ObjectProperty { value: Value::Float(number), .. }) if number.fract() == 0.0 => {
                Ok(Some(*number as i64))
            }
            Some(property) => Err(property.wrong("a whole number")),
        }
    }

    /// Returns a boolean property, or the default if the object lacks it.
    pub(super) fn boolean(&self, name: &str, default: bool) -> Result<bool, TextFault> {
        match self.property(name) {
            None => Ok(default),
            Some(ObjectProperty { value: Value::Boolean(value), .. }) => Ok(*value),
            Some(property) => Err(property.wrong("true or false")),
        }
    }

    /// Returns a text property; `None`: the object lacks it.
    pub(super) fn string(&self, name: &str) -> Result<Option<&str>, TextFault> {
        match self.property(name) {
            None => Ok(None),
            Some(ObjectProperty { value: Value::String(text), .. }) => Ok(Some(text)),
            Some(property) => Err(property.wrong("a string")),
        }
    }

    /// Returns a point or vector by its name; `None`: there is no such property.
    pub(super) fn vector(&self, name: &str) -> Result<Option<DVec3>, TextFault> {
        match self.property(name) {
            None => Ok(None),
            Some(ObjectProperty { value: Value::Vector(vector), .. }) => Ok(Some(*vector)),
            Some(property) => Err(property.wrong("a point or a vector")),
        }
    }
}

impl ObjectProperty {
    /// Makes the error for a value of the wrong type.
    pub(super) fn wrong(&self, wanted: &str) -> TextFault {
        self.at.fault(format!("`{}` is not {wanted}", shortened(&self.name)))
    }
}
