//! Random numbers, directions, textures and points.

use bottega_render::bsdf::{LiftedNormal, MappingPoint, SurfacePoint};
use bottega_scene::{Channel, ColorParam, Image, ImageId, ScalarParam, Spectrum, TextureMap, Wrap};
use glam::{Affine2, Vec2, Vec3, Vec4};

/// Random numbers from a seed.
pub(super) struct Numbers(pub(super) u64);

impl Numbers {
    /// In [0, 1).
    pub(super) fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }

    pub(super) fn within(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.next()
    }

    /// In [0, 1), and often at one of its ends.
    pub(super) fn unit(&mut self) -> f32 {
        match self.below(5) {
            0 => 0.0,
            1 => 1.0,
            _ => self.next(),
        }
    }

    pub(super) fn below(&mut self, count: u32) -> u32 {
        ((self.next() * count as f32) as u32).min(count - 1)
    }

    pub(super) fn chance(&mut self, share: f32) -> bool {
        self.next() < share
    }

    pub(super) fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len() as u32) as usize]
    }

    pub(super) fn color(&mut self) -> Spectrum {
        Spectrum::new(self.unit(), self.next(), self.next())
    }

    /// Uniform over the sphere.
    pub(super) fn direction(&mut self) -> Vec3 {
        loop {
            let v = Vec3::new(self.within(-1.0, 1.0), self.within(-1.0, 1.0), self.within(-1.0, 1.0));
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }

    pub(super) fn above(&mut self) -> Vec3 {
        let v = self.direction();
        Vec3::new(v.x, v.y, v.z.abs().max(1e-3)).normalize()
    }

    pub(super) fn map(&mut self, images: u32) -> TextureMap {
        let wraps = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];
        let size = Vec2::new(self.within(0.3, 3.0), self.within(-3.0, 3.0));
        TextureMap {
            image: ImageId(self.below(images)),
            uv_set: self.below(2) as u8,
            picture_from_uv: match self.below(3) {
                0 => Affine2::IDENTITY,
                _ => Affine2::from_scale_angle_translation(size, self.within(-3.0, 3.0), Vec2::new(0.3, -0.2)),
            },
            wrap_u: self.pick(&wraps),
            wrap_v: self.pick(&wraps),
            smooth: self.chance(0.7),
        }
    }

    /// A factor, sometimes with a texture.
    pub(super) fn color_param(&mut self, images: u32) -> ColorParam {
        let texture = self.chance(0.2).then(|| self.map(images));
        ColorParam { factor: self.color(), texture }
    }

    /// A factor in that range, sometimes with a texture.
    pub(super) fn scalar_param(&mut self, images: u32, low: f32, high: f32) -> ScalarParam {
        let channel = self.pick(&[Channel::R, Channel::G, Channel::B, Channel::A]);
        let texture = self.chance(0.2).then(|| (self.map(images), channel));
        ScalarParam { factor: low + (high - low) * self.unit(), texture }
    }

    /// A point, and the arguments of its `lifted`.
    pub(super) fn point(&mut self) -> (SurfacePoint, Option<(Vec3, bool)>) {
        let uv = |numbers: &mut Self| Vec2::new(numbers.within(-3.0, 3.0), numbers.within(-3.0, 3.0));
        let lifted = self.chance(0.1).then(|| ((Vec3::Z + 0.7 * self.direction()).normalize(), self.chance(0.5)));
        let point = SurfacePoint {
            lets_in: false,
            uvs: [uv(self), uv(self)],
            mapping_point: MappingPoint::default(),
            footprint: if self.chance(0.3) { 0.0 } else { 2.0_f32.powf(self.within(-9.0, 1.0)) },
            vertex_color: if self.chance(0.7) { Vec4::ONE } else { self.color().extend(self.next()) },
            front: self.chance(0.6),
            coat_normal: if self.chance(0.5) { Vec3::Z } else { (Vec3::Z + 0.4 * self.direction()).normalize() },
            lifted: lifted.map(|(normal, shadows)| LiftedNormal::new(normal, shadows)),
            chance: self.next(),
        };
        (point, lifted)
    }
}

/// One image of each format, of odd sizes.
pub(super) fn images(numbers: &mut Numbers) -> Vec<Image> {
    let sizes = [(16, 16), (7, 5), (13, 1), (1, 9), (32, 8), (6, 6), (5, 3)];
    let byte = |numbers: &mut Numbers| (numbers.next() * 256.0) as u8;
    let mut images = Vec::new();
    for (kind, (width, height)) in sizes.into_iter().enumerate() {
        let count = (width * height) as usize;
        let mut many = |make: &mut dyn FnMut(&mut Numbers)| (0..count).for_each(|_| make(numbers));
        let (mut gray, mut rgb, mut rgba) = (Vec::new(), Vec::new(), Vec::new());
        let (mut rgba16, mut rgb32, mut rgba32) = (Vec::new(), Vec::new(), Vec::new());
        many(&mut |numbers| {
            gray.push(byte(numbers));
            rgb.push([byte(numbers), byte(numbers), byte(numbers)]);
            rgba.push([byte(numbers), byte(numbers), byte(numbers), byte(numbers)]);
            rgba16.push([0; 4].map(|_: u16| (numbers.next() * 65536.0) as u16));
            rgb32.push([0.0; 3].map(|_: f32| numbers.next()));
            rgba32.push([0.0; 4].map(|_: f32| numbers.next()));
        });
        images.push(match kind {
            0 => Image::from_rgb8("rgb", width, height, rgb, true),
            1 => Image::from_rgba8("rgba", width, height, rgba, true),
            2 => Image::from_gray8("gray", width, height, gray, false),
            3 => Image::from_gray8("encoded gray", width, height, gray, true),
            4 => Image::from_rgba16("16 bits", width, height, rgba16, false),
            5 => Image::from_linear_rgb("rgb of floats", width, height, rgb32),
            _ => Image::from_linear_rgba("rgba of floats", width, height, rgba32),
        });
    }
    images
}
