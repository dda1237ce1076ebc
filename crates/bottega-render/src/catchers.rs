//! Shadow catchers: surfaces that stand for those of a photographed plate. The picture holds how much light they lack because
//! of the other objects, and not the surfaces themselves.

use bottega_kernels::Hit;
use bottega_scene::PartNames;

use crate::{interaction::material_of, prepare::PreparedScene};

/// The surfaces of a scene that are shadow catchers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ShadowCatchers {
    /// For each instance of the scene: `true`: it is a catcher.
    instances: Box<[bool]>,
    /// For each sphere of the scene.
    spheres: Box<[bool]>,
}

impl ShadowCatchers {
    /// Finds the catchers of a scene.
    ///
    /// - `is_catcher`: returns `true` for a catcher, given the names of object, mesh and material. Called once per instance
    ///   and sphere.
    pub fn new(prepared: &PreparedScene, mut is_catcher: impl FnMut(&[&str]) -> bool) -> Self {
        let scene = prepared.scene();
        let names = PartNames::new(scene);
        let mut is_one = |[object, asset]: &[String; 2], material: u32| {
            is_catcher(&[object, asset, &names.materials[material as usize]])
        };
        let instances = scene.instances.iter().zip(&names.instances);
        let instances = instances.map(|(instance, name)| is_one(name, scene.material_of(instance))).collect();
        let spheres = scene.spheres.iter().zip(&names.spheres);
        Self { instances, spheres: spheres.map(|(sphere, name)| is_one(name, sphere.material)).collect() }
    }

    /// Returns true if there is no catcher.
    pub fn is_empty(&self) -> bool {
        !self.instances.iter().chain(&self.spheres).any(|&is_catcher| is_catcher)
    }

    /// Returns true if a catcher was hit.
    fn has(&self, hit: &Hit) -> bool {
        match hit.sphere() {
            Some(sphere) => self.spheres[sphere as usize],
            None => self.instances[hit.instance as usize],
        }
    }
}

/// The tests that only pictures with catchers need, apart from the code of all others, which they would slow down.
impl ShadowCatchers {
    /// Returns true if a surface stays without the objects that are no catchers: if it is one, or glows.
    #[cold]
    #[inline(never)]
    fn leave(&self, prepared: &PreparedScene, hit: &Hit) -> bool {
        self.has(hit) || prepared.material(material_of(prepared, hit)).1.shines
    }

    /// Returns true if a ray met the surface of a catcher.
    #[cold]
    #[inline(never)]
    fn are_met(&self, prepared: &PreparedScene, hit: &Hit) -> bool {
        hit.is_some() && self.has(hit) && !prepared.material(material_of(prepared, hit)).1.is_null
    }
}

/// The part that shadow catchers play for a path.
#[derive(Clone, Copy, Debug)]
pub(crate) enum CatcherRole<'a> {
    /// They are objects like all others.
    Objects,
    /// The camera sees neither them, nor what is behind them, nor the light at infinity.
    Unseen(&'a ShadowCatchers),
    /// They and surfaces that glow are the only ones.
    Alone(&'a ShadowCatchers),
}

impl CatcherRole<'_> {
    /// Returns true if the surface of a candidate hit exists.
    #[inline(always)]
    pub(crate) fn has(&self, prepared: &PreparedScene, hit: &Hit) -> bool {
        match self {
            Self::Alone(catchers) => catchers.leave(prepared, hit),
            Self::Objects | Self::Unseen(_) => true,
        }
    }

    /// Returns true if the camera must not see a surface that its ray hit.
    #[inline(always)]
    pub(crate) fn hides(&self, prepared: &PreparedScene, hit: &Hit) -> bool {
        matches!(self, Self::Unseen(catchers) if catchers.are_met(prepared, hit))
    }

    /// Returns true if the camera does not see the light at infinity.
    #[inline(always)]
    pub(crate) fn hides_far(&self) -> bool {
        matches!(self, Self::Unseen(_))
    }
}
