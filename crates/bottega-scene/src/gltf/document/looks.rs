//! Materials, textures and images of the document.

use serde::Deserialize;
use serde::de::IgnoredAny;

object!(Material {
    name: String,
    pbr_metallic_roughness: Option<Box<MetallicRoughness>>,
    normal_texture: Option<Box<TextureInfo>>,
    emissive_texture: Option<Box<TextureInfo>>,
    emissive_factor: [f32; 3],
    alpha_mode: Option<String>,
    alpha_cutoff: Option<f32>,
    double_sided: bool,
    extensions: Option<Box<MaterialExtensions>>,
});

object!(MetallicRoughness {
    base_color_factor: Option<[f32; 4]>,
    base_color_texture: Option<Box<TextureInfo>>,
    metallic_factor: Option<f32>,
    roughness_factor: Option<f32>,
    metallic_roughness_texture: Option<Box<TextureInfo>>,
});

strict_object!(TextureInfo {
    index: usize,
    #[serde(default)]
    tex_coord: u64,
    /// Scale of a normal texture.
    scale: Option<f32>,
    #[serde(default)]
    extensions: TextureInfoExtensions,
});

object!(TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    transform: Option<Box<TextureTransform>>,
});

object!(TextureTransform {
    offset: [f32; 2],
    rotation: f32,
    scale: Option<[f32; 2]>,
    tex_coord: Option<u64>,
});

object!(MaterialExtensions {
    #[serde(rename = "KHR_materials_transmission")]
    transmission: Option<Box<Transmission>>,
    #[serde(rename = "KHR_materials_volume")]
    volume: Option<Box<Volume>>,
    #[serde(rename = "KHR_materials_ior")]
    ior: Option<Ior>,
    #[serde(rename = "KHR_materials_clearcoat")]
    clearcoat: Option<Box<Clearcoat>>,
    #[serde(rename = "KHR_materials_sheen")]
    sheen: Option<Box<Sheen>>,
    #[serde(rename = "KHR_materials_specular")]
    specular: Option<Box<Specular>>,
    #[serde(rename = "KHR_materials_emissive_strength")]
    emissive_strength: Option<EmissiveStrength>,
    #[serde(rename = "KHR_materials_anisotropy")]
    anisotropy: Option<Box<Anisotropy>>,
    #[serde(rename = "KHR_materials_iridescence")]
    iridescence: Option<Box<Iridescence>>,
    #[serde(rename = "KHR_materials_dispersion")]
    dispersion: Option<Dispersion>,
    #[serde(rename = "KHR_materials_diffuse_transmission")]
    diffuse_transmission: Option<Box<DiffuseTransmission>>,
    #[serde(rename = "KHR_materials_unlit")]
    unlit: Option<IgnoredAny>,
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    specular_glossiness: Option<Box<SpecularGlossiness>>,
});

object!(Transmission {
    transmission_factor: f32,
    transmission_texture: Option<Box<TextureInfo>>,
});

object!(Volume {
    thickness_factor: f32,
    attenuation_distance: Option<f32>,
    attenuation_color: Option<[f32; 3]>,
});

object!(Ior {
    ior: Option<f32>,
});

object!(Clearcoat {
    clearcoat_factor: f32,
    clearcoat_texture: Option<Box<TextureInfo>>,
    clearcoat_roughness_factor: f32,
    clearcoat_roughness_texture: Option<Box<TextureInfo>>,
    clearcoat_normal_texture: Option<Box<TextureInfo>>,
});

object!(Sheen {
    sheen_color_factor: [f32; 3],
    sheen_color_texture: Option<Box<TextureInfo>>,
    sheen_roughness_factor: f32,
    sheen_roughness_texture: Option<Box<TextureInfo>>,
});

object!(Specular {
    specular_factor: Option<f32>,
    specular_texture: Option<Box<TextureInfo>>,
    specular_color_factor: Option<[f32; 3]>,
    specular_color_texture: Option<Box<TextureInfo>>,
});

object!(EmissiveStrength {
    emissive_strength: Option<f32>,
});

object!(Anisotropy {
    anisotropy_strength: f32,
    anisotropy_rotation: f32,
    anisotropy_texture: Option<Box<TextureInfo>>,
});

object!(Iridescence {
    iridescence_factor: f32,
    iridescence_texture: Option<Box<TextureInfo>>,
    iridescence_ior: Option<f32>,
    iridescence_thickness_minimum: Option<f32>,
    iridescence_thickness_maximum: Option<f32>,
    iridescence_thickness_texture: Option<Box<TextureInfo>>,
});

object!(Dispersion { dispersion: f32 });

object!(DiffuseTransmission {
    diffuse_transmission_factor: f32,
    diffuse_transmission_texture: Option<Box<TextureInfo>>,
    diffuse_transmission_color_factor: Option<[f32; 3]>,
    diffuse_transmission_color_texture: Option<Box<TextureInfo>>,
});

object!(SpecularGlossiness {
    diffuse_factor: Option<[f32; 4]>,
    diffuse_texture: Option<Box<TextureInfo>>,
    specular_factor: Option<[f32; 3]>,
    glossiness_factor: Option<f32>,
    specular_glossiness_texture: Option<Box<TextureInfo>>,
});

object!(Texture {
    sampler: Option<usize>,
    source: Option<usize>,
    extensions: TextureExtensions,
});

object!(TextureExtensions {
    #[serde(rename = "KHR_texture_basisu")]
    basisu: Option<TextureSource>,
    #[serde(rename = "EXT_texture_webp")]
    webp: Option<TextureSource>,
});

object!(TextureSource {
    source: Option<usize>,
});

impl Texture {
    /// Returns the image index; that of an extension takes precedence over the fallback. `None`: there is no image.
    pub(in crate::gltf) fn picture(&self) -> Option<usize> {
        let extensions = [&self.extensions.basisu, &self.extensions.webp];
        extensions.into_iter().flatten().find_map(|extension| extension.source).or(self.source)
    }
}

object!(Image {
    name: String,
    uri: Option<String>,
    mime_type: Option<String>,
    buffer_view: Option<usize>,
});

object!(Sampler {
    mag_filter: Option<u64>,
    wrap_s: Option<u64>,
    wrap_t: Option<u64>,
});
