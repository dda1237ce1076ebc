//! Displacement: textures that move the points of a surface.

use serde::{Deserialize, Serialize};

use crate::param::{ColorParam, ScalarParam};
use crate::texture::TextureMap;

/// A displacement of the points of meshes, before a scene is prepared. The meshes are refined until their edges resolve the
/// texture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Displacement {
    /// The texture.
    pub source: DisplacementSource,
    /// Factor of the texture's values; may be negative.
    pub scale: f32,
    /// Value that is added after `scale`.
    pub bias: f32,
    /// The space in which lengths count.
    pub space: DisplacementSpace,
    /// Longest edge after refinement, in that space; `None`: a texel of the texture.
    #[serde(default)]
    pub edge: Option<f32>,
    /// `true`: vertex normals stay as they are, because a relief has the slopes of the texture (Cycles' *Displacement and
    /// Bump*). `false`: they are those of the displaced surface.
    #[serde(default)]
    pub keeps_normals: bool,
}

/// The texture of a displacement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DisplacementSource {
    /// Heights along the shading normal.
    Heights(ScalarParam),
    /// Vectors: red along the tangent, green along the normal, blue along the bitangent.
    TangentVectors(ColorParam),
    /// Vectors in object space.
    ObjectVectors(ColorParam),
}

/// The space in which the lengths of a displacement count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DisplacementSpace {
    /// That of the mesh: a larger instance is displaced more.
    #[default]
    Object,
    /// World space.
    World,
}

impl Displacement {
    /// Returns a displacement by heights along the normal, in object space.
    pub fn heights(height: ScalarParam) -> Self {
        let space = DisplacementSpace::Object;
        Self {
            source: DisplacementSource::Heights(height),
            scale: 1.0,
            bias: 0.0,
            space,
            edge: None,
            keeps_normals: false,
        }
    }

    /// Returns the texture; `None`: the displacement is the same everywhere.
    pub fn texture(&self) -> Option<&TextureMap> {
        match &self.source {
            DisplacementSource::Heights(height) => height.texture.as_ref().map(|(map, _)| map),
            DisplacementSource::TangentVectors(vector) | DisplacementSource::ObjectVectors(vector) => {
                vector.texture.as_ref()
            }
        }
    }

    /// Returns true if the numbers are finite, and the edge is longer than 0.
    pub(crate) fn is_sound(&self) -> bool {
        let factor = match &self.source {
            DisplacementSource::Heights(height) => height.factor.abs(),
            DisplacementSource::TangentVectors(vector) | DisplacementSource::ObjectVectors(vector) => {
                vector.factor.abs().max_element()
            }
        };
        let is_sound = [factor, self.scale, self.bias].iter().all(|number| number.is_finite());
        is_sound && self.edge.is_none_or(|edge| edge > 0.0 && edge.is_finite())
    }
}
