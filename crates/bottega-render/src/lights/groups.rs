//! Groups of a picture's light, whose sums are kept apart: by the lights that send it, or by the kinds of paths that found it.

use bottega_kernels::Hit;
use bottega_scene::{Light, LightKind, Material, PartNames, Surface};

use super::{FarLight, Light as TreeLight, LightSample, NO_LIGHT, PathEnd, PathKind};
use crate::prepare::PreparedScene;

/// The groups of a picture's light: by the lights of the scene, or by kinds of paths. A set of groups is a bit mask: bit
/// `g` is set for members of group `g`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LightGroups {
    /// Number of groups.
    count: usize,
    by: GroupedBy,
}

/// The criterion by which light is grouped.
#[derive(Clone, Debug, PartialEq, Eq)]
enum GroupedBy {
    /// The light that sends it.
    Lights(GroupsOfLights),
    /// The path that found it: a [`PathKind`] each.
    Paths,
}

/// The groups of all lights of a scene.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct GroupsOfLights {
    environment: u16,
    /// Groups of each light in [`Lights::suns`].
    suns: Vec<u16>,
    /// Groups of each light of the tree, by its number.
    tree: Vec<u16>,
    /// Groups of each instance of the scene.
    instances: Vec<u16>,
    /// Groups of each sphere of the scene.
    spheres: Vec<u16>,
}

impl LightGroups {
    /// Largest number of groups of lights. [`Self::by_path`] makes more groups.
    pub const MAX: usize = 16;
    /// The name by which the environment is known among the lights; see [`Self::new`].
    pub const ENVIRONMENT: &str = "environment";

    /// Assigns the lights of a scene to groups. Emission inside media belongs to none.
    ///
    /// - `count`: number of groups, at most [`Self::MAX`].
    /// - `groups_of`: returns the set of groups of a light that has these names, as a bit mask: a light without extent
    ///   has one name, a glowing surface those of object, mesh and material, the environment [`Self::ENVIRONMENT`].
    ///   Called once per light.
    pub fn new(prepared: &PreparedScene, count: usize, mut groups_of: impl FnMut(&[&str]) -> u16) -> Self {
        let (scene, lights) = (prepared.scene(), prepared.lights());
        let names = PartNames::new(scene);
        let environment = scene.environment.as_ref().map_or(0, |_| groups_of(&[Self::ENVIRONMENT]));
        // Lights without extent
        let named = scene.lights.iter().zip(0..).map(|(light, index)| match &*light.name {
            "" => groups_of(&[&format!("light.{index}")]),
            name => groups_of(&[name]),
        });
        let of_lights: Vec<u16> = named.collect();
        let is_sun = |light: &Light| matches!(light.kind, LightKind::Directional { .. });
        let suns = scene.lights.iter().zip(&of_lights).filter(|(light, _)| is_sun(light)).map(|(_, &of)| of).collect();
        // Glowing surfaces
        let mut of_surface = |[object, asset]: &[String; 2], material: u32| {
            let (Material { surface, .. }, known) = prepared.material(material);
            let glows = known.shines || matches!(surface, Surface::Unlit(_));
            if glows { groups_of(&[object, asset, &names.materials[material as usize]]) } else { 0 }
        };
        let instances = scene.instances.iter().zip(&names.instances);
        let instances = instances.map(|(instance, name)| of_surface(name, scene.material_of(instance)));
        let instances: Vec<u16> = instances.collect();
        let spheres = scene.spheres.iter().zip(&names.spheres);
        let spheres: Vec<u16> = spheres.map(|(sphere, name)| of_surface(name, sphere.material)).collect();
        // Lights of the tree are some of both
        let tree = lights.lights.iter().map(|light| match light {
            TreeLight::Punctual(index) => of_lights[*index as usize],
            TreeLight::Sphere(index) => spheres[*index as usize],
            TreeLight::Surface(surface) => instances[surface.instance() as usize],
        });
        let groups = GroupsOfLights { environment, suns, tree: tree.collect(), instances, spheres };
        Self { count, by: GroupedBy::Lights(groups) }
    }

    /// Groups light by the kind of path that found it: one group per [`PathKind`], in the order of [`PathKind::ALL`].
    pub fn by_path() -> Self {
        Self { count: PathKind::ALL.len(), by: GroupedBy::Paths }
    }

    /// Returns the number of groups.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Returns the groups of a light sample.
    ///
    /// - `depth`: number of scattering events up to the vertex where the light was sampled, without it.
    #[inline(always)]
    pub(crate) fn of_sample(&self, sample: &LightSample, depth: u32) -> u32 {
        let GroupedBy::Lights(groups) = &self.by else { return PathKind::sampled(depth + 1).bit() };
        u32::from(match (sample.light, sample.sun) {
            (NO_LIGHT, NO_LIGHT) => groups.environment,
            (NO_LIGHT, sun) => groups.suns[sun as usize],
            (light, _) => groups.tree[light as usize],
        })
    }

    /// Returns the groups of a surface that was hit.
    ///
    /// - `end`: the end of the path that hit it.
    #[inline(always)]
    pub(crate) fn of_hit(&self, hit: &Hit, end: PathEnd) -> u32 {
        let GroupedBy::Lights(groups) = &self.by else { return PathKind::hit(end).bit() };
        u32::from(match hit.sphere() {
            Some(sphere) => groups.spheres[sphere as usize],
            None => groups.instances[hit.instance as usize],
        })
    }

    /// Returns the groups of a light at infinity.
    ///
    /// - `end`: the end of the path that found it.
    #[inline(always)]
    pub(crate) fn of_far(&self, light: FarLight, end: PathEnd) -> u32 {
        let GroupedBy::Lights(groups) = &self.by else { return PathKind::hit(end).bit() };
        u32::from(match light {
            FarLight::Environment => groups.environment,
            FarLight::Sun(sun) => groups.suns[sun],
        })
    }
}
