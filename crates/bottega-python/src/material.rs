//! The Python class of materials.

use bottega::{
    glam::Vec3,
    scene::{Layered, Material},
};
use pyo3::prelude::*;

use crate::errors::wrong;

/// A material: scattering or emission of a surface. Colors are linear R G B: reflectances from 0 to 1; radiance in W·sr⁻¹·m⁻².
#[pyclass(name = "Material", module = "bottega", frozen)]
pub(crate) struct PyMaterial {
    pub(crate) material: Material,
}

/// Checks a color: three finite numbers, at least 0.
pub(crate) fn color(argument: &str, value: [f32; 3]) -> PyResult<Vec3> {
    let color = Vec3::from_array(value);
    if color.is_finite() && color.min_element() >= 0.0 {
        return Ok(color);
    }
    Err(wrong(argument, &format!("{value:?} is no color: three finite numbers from 0 are needed")))
}

/// Checks a number from 0 to 1.
fn share(argument: &str, value: f32) -> PyResult<f32> {
    if (0.0..=1.0).contains(&value) {
        return Ok(value);
    }
    Err(wrong(argument, &format!("it is {value}: from 0 to 1 is allowed")))
}

#[pymethods]
impl PyMaterial {
    /// Makes a matte surface, such as chalk (Lambert).
    #[staticmethod]
    #[pyo3(signature = (color=[0.8; 3]))]
    fn matte(color: [f32; 3]) -> PyResult<Self> {
        Ok(Self { material: Material::matte(self::color("color", color)?) })
    }

    /// Makes a black surface that emits the same radiance in all directions from its front.
    #[staticmethod]
    fn lamp(radiance: [f32; 3]) -> PyResult<Self> {
        Ok(Self { material: Material::lamp(color("radiance", radiance)?) })
    }

    /// Makes a layered surface as in glTF: plastic by default, metal with `metallic=1`, glass with `transmission=1`, lacquer
    /// with `coat=1`.
    ///
    /// `roughness` and `coat_roughness` are perceptual: 0 a mirror, 1 matte. `ior` is the index of refraction, from 1 to 100.
    /// With `thin` the surface is a sheet without volume, such as a window; otherwise the mesh bounds a solid.
    #[staticmethod]
    #[pyo3(signature = (
        color=[0.8; 3], *, metallic=0.0, roughness=0.5, transmission=0.0, ior=1.5, coat=0.0, coat_roughness=0.0, thin=false
    ))]
    fn layered(
        color: [f32; 3],
        metallic: f32,
        roughness: f32,
        transmission: f32,
        ior: f32,
        coat: f32,
        coat_roughness: f32,
        thin: bool,
    ) -> PyResult<Self> {
        if !(1.0..=100.0).contains(&ior) {
            return Err(wrong("ior", &format!("it is {ior}: from 1 to 100 is allowed")));
        }
        let layered = Layered {
            base_color: self::color("color", color)?.into(),
            metallic: share("metallic", metallic)?.into(),
            roughness: share("roughness", roughness)?.into(),
            transmission: share("transmission", transmission)?.into(),
            coat: share("coat", coat)?.into(),
            coat_roughness: share("coat_roughness", coat_roughness)?.into(),
            ior,
            thin,
            ..Layered::default()
        };
        Ok(Self { material: layered.into() })
    }
}
