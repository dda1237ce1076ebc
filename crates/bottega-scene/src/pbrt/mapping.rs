//! Texture mappings: from surface points to texture coordinates.

use glam::{Affine2, Affine3A, DAffine3, DMat3, DVec3, Mat3A, Vec2, Vec3A};

use super::context::Context;
use super::params::Params;
use super::world::Entity;
use crate::import::text_place::ImportResult;
use crate::text::shortened;
use crate::texture::{Mapping, MappingKind, SURFACE_UV_SETS};

/// The mapping of a texture: a coordinate set and its transformation (v downwards).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlacedMapping {
    /// Coordinate set, as in [`TextureMap`](crate::TextureMap).
    pub(super) uv_set: u8,
    /// Maps coordinates of the set to those of the picture.
    pub(super) picture_from_uv: Affine2,
}

/// The distinct mappings of a scene.
#[derive(Debug, Default)]
pub(super) struct Mappings(Vec<Mapping>);

/// Maps coordinates of a picture to those of the same picture with a border of one texel.
pub(super) fn within_frame((width, height): (u32, u32)) -> Affine2 {
    let size = Vec2::new(width as f32, height as f32);
    Affine2::from_scale_angle_translation(size / (size + 2.0), 0.0, 1.0 / (size + 2.0))
}

impl Mappings {
    /// Returns the mapping of a texture.
    pub(super) fn of_texture(&mut self, context: &mut Context<'_>, texture: &Entity) -> ImportResult<PlacedMapping> {
        let params = &texture.params;
        let space = match params.text("mapping")?.unwrap_or("uv") {
            "uv" => return on_surface(params),
            "planar" => MappingKind::Planar,
            "spherical" => MappingKind::Spherical,
            "cylindrical" => MappingKind::Cylindrical,
            kind => {
                params.mark_reported(&["v1", "v2"]);
                let message =
                    format!("the mapping \"{}\" is replaced by the surface's own coordinates", shortened(kind));
                context.unsupported(params.place_of("mapping"), message);
                return on_surface(params);
            }
        };
        self.in_space(context, texture, space)
    }

    /// Returns the mapping of 3D cells, which depends only on the current transformation.
    pub(super) fn cells(&mut self, context: &mut Context<'_>, texture: &Entity) -> ImportResult<PlacedMapping> {
        self.in_space(context, texture, MappingKind::Cells)
    }

    /// Returns the mapping of a texture that is a function of the position, scaled by `scale`.
    pub(super) fn of_position(
        &mut self,
        context: &mut Context<'_>,
        texture: &Entity,
        kind: MappingKind,
        scale: f64,
    ) -> ImportResult<PlacedMapping> {
        let texture_from_world = texture_from_world(texture)?;
        self.placed(context, texture, kind, DAffine3::from_scale(DVec3::splat(scale)) * texture_from_world, Vec2::ZERO)
    }

    /// Returns the mapping of the angle between the surface's normal and a direction of the texture's space.
    pub(super) fn of_direction(
        &mut self,
        context: &mut Context<'_>,
        texture: &Entity,
        direction: DVec3,
    ) -> ImportResult<PlacedMapping> {
        let direction = texture.ctm.transform_vector3(direction).normalize_or_zero();
        let cosine = DAffine3::from_mat3(DMat3::from_cols(DVec3::ZERO, DVec3::ZERO, direction).transpose());
        self.placed(context, texture, MappingKind::Facing, cosine, Vec2::ZERO)
    }

    /// Returns the mapping of dots; `None`: they lie on a sphere or a cylinder.
    pub(super) fn of_dots(
        &mut self,
        context: &mut Context<'_>,
        texture: &Entity,
    ) -> ImportResult<Option<PlacedMapping>> {
        let params = &texture.params;
        let (on_surface, dots) = match params.text("mapping")?.unwrap_or("uv") {
            "planar" => {
                let (mapping, delta) = planar(params, texture_from_world(texture)?)?;
                // t = 1 − v of the picture, so its offset is the opposite
                (false, DAffine3::from_translation(DVec3::new(f64::from(delta.x), f64::from(-delta.y), 0.0)) * mapping)
            }
            "uv" => {
                let Affine2 { matrix2, translation } = on_surface(params)?.picture_from_uv;
                let upwards = |v: Vec2| DVec3::new(f64::from(v.x), f64::from(-v.y), 0.0);
                let linear = DMat3::from_cols(upwards(matrix2.x_axis), upwards(matrix2.y_axis), DVec3::Z);
                (true, DAffine3::from_mat3_translation(linear, upwards(translation) + DVec3::Y))
            }
            _ => return Ok(None),
        };
        self.placed(context, texture, MappingKind::Dots { on_surface }, dots, Vec2::ZERO).map(Some)
    }

    fn in_space(
        &mut self,
        context: &mut Context<'_>,
        texture: &Entity,
        space: MappingKind,
    ) -> ImportResult<PlacedMapping> {
        let texture_from_world = texture_from_world(texture)?;
        let (mapping, delta) = match space {
            MappingKind::Planar => planar(&texture.params, texture_from_world)?,
            _ => (texture_from_world, Vec2::ZERO),
        };
        self.placed(context, texture, space, mapping, delta)
    }

    fn placed(
        &mut self,
        context: &mut Context<'_>,
        texture: &Entity,
        kind: MappingKind,
        mapping: DAffine3,
        delta: Vec2,
    ) -> ImportResult<PlacedMapping> {
        let place = texture.params.place_of("mapping");
        let mapping_from_world = Affine3A {
            matrix3: Mat3A::from(mapping.matrix3.as_mat3()),
            translation: Vec3A::from(mapping.translation.as_vec3()),
        };
        if !mapping_from_world.is_finite() || !delta.is_finite() {
            return Err(place.fault("the mapping exceeds all bounds").into());
        }
        let picture_from_uv = Affine2::from_translation(delta);
        match self.set_of(Mapping { kind, mapping_from_world }) {
            Some(uv_set) => Ok(PlacedMapping { uv_set, picture_from_uv }),
            None => {
                let message = "there are too many mappings: here the surface's own coordinates replace it";
                context.unsupported(place, message);
                Ok(PlacedMapping { uv_set: 0, picture_from_uv })
            }
        }
    }

    /// Returns the list for [`Scene::mappings`](crate::Scene::mappings).
    pub(super) fn into_inner(self) -> Vec<Mapping> {
        self.0
    }

    /// Returns the kind of a coordinate set; `None` for the surface's own.
    pub(super) fn kind(&self, uv_set: u8) -> Option<MappingKind> {
        let index = uv_set.checked_sub(SURFACE_UV_SETS)?;
        Some(self.0[usize::from(index)].kind)
    }

    fn set_of(&mut self, mapping: Mapping) -> Option<u8> {
        let index = self.0.iter().position(|known| *known == mapping).unwrap_or_else(|| {
            self.0.push(mapping);
            self.0.len() - 1
        });
        let set = u8::try_from(index + usize::from(SURFACE_UV_SETS)).ok();
        if set.is_none() {
            self.0.pop();
        }
        set
    }
}

fn texture_from_world(texture: &Entity) -> ImportResult<DAffine3> {
    let texture_from_world = texture.ctm.inverse();
    if texture_from_world.is_finite() {
        return Ok(texture_from_world);
    }
    let place = texture.params.place_of("mapping");
    Err(place.fault("the transformation in force at this texture is singular").into())
}

fn on_surface(params: &Params) -> ImportResult<PlacedMapping> {
    let scale = |name| params.float(name).map(|scale| scale.unwrap_or(1.0));
    let delta = |name| params.float(name).map(|delta| delta.unwrap_or(0.0));
    let (scale_u, scale_v, delta_u, delta_v) = (scale("uscale")?, scale("vscale")?, delta("udelta")?, delta("vdelta")?);
    // t = scale_v · (1 − v) + delta_v, upwards; 1 − t, downwards.
    let mapping = Affine2::from_cols_array(&[
        scale_u as f32,
        0.0,
        0.0,
        scale_v as f32,
        delta_u as f32,
        (1.0 - scale_v - delta_v) as f32,
    ]);
    if mapping.is_finite() {
        Ok(PlacedMapping { uv_set: 0, picture_from_uv: mapping })
    } else {
        Err(params.at.fault("the mapping exceeds all bounds").into())
    }
}

/// Returns the transformation to the space with x = s and y = t, and the offset of u and v.
fn planar(params: &Params, texture_from_world: DAffine3) -> ImportResult<(DAffine3, Vec2)> {
    let along_s = params.point3("v1", "vector3")?.unwrap_or(DVec3::X);
    let along_t = params.point3("v2", "vector3")?.unwrap_or(DVec3::Y);
    let (delta_s, delta_t) = (params.float("udelta")?.unwrap_or(0.0), params.float("vdelta")?.unwrap_or(0.0));
    // The height above the plane is not used.
    let plane_from_texture = DMat3::from_cols(along_s, along_t, DVec3::ZERO).transpose();
    let mapping = DAffine3::from_mat3(plane_from_texture) * texture_from_world;
    Ok((mapping, Vec2::new(delta_s as f32, -delta_t as f32)))
}
