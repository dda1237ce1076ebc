//! Scenes far from the origin of their coordinates.
//!
//! Scenes are stored in single precision, which resolves positions to a sixteen-millionth of their distance from the
//! origin: 8 mm at 100 km. If a camera and its surroundings are much farther from the origin than from each other, the
//! file is read a second time, and the camera's position is subtracted from all others while they are still in double
//! precision.

use glam::{Affine3A, DVec3, Vec3};

use crate::model::{Mesh, Scene};

/// Ratio of the distance from the origin to the extent from which a scene or mesh counts as far.
const FAR: f32 = 256.0;

/// Returns the offset to subtract from all positions if the scene is far from the origin: the position of its first
/// camera, rounded to whole units. `None`: it is not far.
pub(crate) fn far_origin(scene: &Scene) -> Option<DVec3> {
    let eye = match scene.cameras.first() {
        Some(camera) => Vec3::from(camera.world_from_camera.translation),
        // Without a camera, the framing camera is placed in front of the scene.
        None => {
            let (min, max) = scene.bounds();
            0.5 * (min + max)
        }
    };
    let bounds: Vec<(Vec3, Vec3)> = scene.meshes.iter().map(Mesh::bounds).collect();
    let instances = scene.instances.iter().map(|instance| {
        let (min, max) = bounds[instance.mesh as usize];
        let Affine3A { matrix3, .. } = instance.world_from_object;
        let scale = matrix3.x_axis.length() + matrix3.y_axis.length() + matrix3.z_axis.length();
        let center = instance.world_from_object.transform_point3(0.5 * (min + max));
        center.distance(eye) + 0.5 * scale * (max - min).length()
    });
    let spheres = scene.spheres.iter().map(|sphere| sphere.center.distance(eye) + sphere.radius);
    let mut lengths: Vec<f32> = instances.chain(spheres).filter(|length| length.is_finite()).collect();
    let middle = lengths.len() / 2;
    let (_, &mut median, _) = (!lengths.is_empty()).then(|| lengths.select_nth_unstable_by(middle, f32::total_cmp))?;
    let is_far = eye.is_finite() && eye.length() > FAR * median;
    is_far.then(|| eye.as_dvec3().round())
}

/// Returns the centre of a mesh that is far from the origin of its own space; `None`: it is not far.
pub(crate) fn far_center(mesh: &Mesh) -> Option<DVec3> {
    let (min, max) = mesh.bounds();
    let (center, size) = (0.5 * (min + max), max - min);
    let is_far = center.is_finite() && center.length() > FAR * size.length();
    is_far.then(|| center.as_dvec3())
}

/// Moves a mesh that is far from the origin of its own space to that origin. Returns its former centre; `None`: the
/// mesh is not far, and stays.
pub(crate) fn centered(mesh: &mut Mesh) -> Option<DVec3> {
    let center = far_center(mesh)?;
    let moved = |p: Vec3| (p.as_dvec3() - center).as_vec3();
    let keys = mesh.motion.iter_mut().flat_map(|key| &mut key.positions);
    mesh.positions.iter_mut().chain(keys).for_each(|p| *p = moved(*p));
    if let Some(curves) = &mut mesh.curves {
        curves.map(moved, |tangent| tangent);
    }
    Some(center)
}

/// Returns the warning about the vertices of a mesh that was far from the origin of its own space.
///
/// - `center`: former centre of the mesh.
pub(crate) fn rounding(center: DVec3) -> String {
    let far = center.abs().max_element();
    let step = f64::from((far as f32).next_up()) - f64::from(far as f32);
    format!(
        "the vertices lie some {far:.0} units from the origin of their mesh, where single precision rounds to {step:.2e}; \
         move them to the origin of the mesh, and the mesh by its transformation"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::light::LightKind;
    use crate::load::{Loaded, load};
    use crate::options::LoadOptions;

    fn scene(eye: Vec3, things: &[(Vec3, f32)]) -> Scene {
        let world_from_camera = Affine3A::from_translation(eye);
        let mut scene = Scene { cameras: vec![Camera { world_from_camera, ..Camera::default() }], ..Scene::default() };
        things.iter().for_each(|&(center, radius)| scene.push_sphere(center, radius, 0));
        scene
    }

    #[test]
    fn scenes_are_far_by_the_surfaces_around_the_camera() {
        let far = Vec3::new(1e5, 0.0, -1e5);
        let near = [(Vec3::X, 1.0), (Vec3::Y * 3.0, 0.5), (Vec3::ZERO, 10.0)];
        assert_eq!(far_origin(&scene(Vec3::Z * 6.0, &near)), None);
        let moved = near.map(|(center, radius)| (center + far, radius));
        assert_eq!(far_origin(&scene(far, &moved)), Some(far.as_dvec3()));
        // No origin: the scene is as large as it is far.
        assert_eq!(far_origin(&scene(far, &[(far, 1e5)])), None);
        // A ground plane that reaches back to the origin does not count.
        let with_ground = [moved[0], moved[1], (far, 1e6)];
        assert!(far_origin(&scene(far, &with_ground)).is_some());
        assert_eq!(far_origin(&scene(far, &[])), None);
    }

    #[test]
    fn meshes_far_from_their_origin_are_centered() {
        let mut mesh = Mesh::cuboid(Vec3::new(1e5, 0.0, 0.0), Vec3::new(1e5 + 2.0, 2.0, 2.0));
        assert_eq!(centered(&mut mesh), Some(DVec3::new(1e5 + 1.0, 1.0, 1.0)));
        assert_eq!(mesh.bounds(), (Vec3::NEG_ONE, Vec3::ONE));
        assert_eq!(centered(&mut mesh), None);
    }

    /// Loads a scene from its text.
    fn loaded(name: &str, text: &str) -> Loaded {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        load(&path, &LoadOptions::default()).unwrap()
    }

    /// All places of a scene as its camera sees them.
    fn places(scene: &Scene) -> Vec<Vec3> {
        let eye = Vec3::from(scene.cameras[0].world_from_camera.translation);
        let mut places = Vec::new();
        for instance in &scene.instances {
            let mesh = &scene.meshes[instance.mesh as usize];
            places.extend(mesh.positions.iter().map(|&p| instance.world_from_object.transform_point3(p)));
        }
        places.extend(scene.spheres.iter().map(|sphere| sphere.center));
        places.extend(scene.lights.iter().filter_map(|light| match light.kind {
            LightKind::Point { position, .. } | LightKind::Spot { position, .. } => Some(position),
            LightKind::Projector { world_from_light, .. } => Some(world_from_light.translation.into()),
            _ => None,
        }));
        let portals = scene.environment.iter().flat_map(|environment| &environment.portals);
        places.extend(portals.map(|portal| portal.corner));
        let laid = scene.mappings.iter().map(|mapping| mapping.mapping_from_world.transform_point3(eye) + eye);
        places.extend(laid);
        places.iter().map(|p| p - eye).collect()
    }

    fn gltf(at: DVec3) -> String {
        let corners = [[0.0_f32, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.5, 0.0]];
        let bytes: Vec<u8> = corners.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        let buffer = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, bytes);
        format!(
            r#"{{"asset": {{"version": "2.0"}}, "extensionsUsed": ["KHR_lights_punctual"],
            "extensions": {{"KHR_lights_punctual": {{"lights": [{{"type": "point"}}]}}}},
            "buffers": [{{"byteLength": 36, "uri": "data:application/octet-stream;base64,{buffer}"}}],
            "bufferViews": [{{"buffer": 0, "byteLength": 36}}],
            "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                "min": [0, 0, 0], "max": [2, 2.5, 0]}}],
            "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
            "cameras": [{{"type": "perspective", "perspective": {{"yfov": 0.8, "znear": 0.01}}}}],
            "nodes": [{{"translation": [{}, {}, {}], "children": [1, 2, 3, 4]}},
                {{"camera": 0, "translation": [0.3, 1.7, 6.1]}}, {{"mesh": 0, "translation": [0.1, 1.0, 0.2]}},
                {{"mesh": 0, "rotation": [0.6, 0, 0, 0.8], "scale": [0.5, -1, 2]}},
                {{"translation": [0, 3.3, 0.7], "extensions": {{"KHR_lights_punctual": {{"light": 0}}}}}}],
            "scenes": [{{"nodes": [0]}}], "scene": 0}}"#,
            at.x, at.y, at.z
        )
    }

    fn mitsuba(at: DVec3) -> String {
        let there = |x: f64, y: f64, z: f64| format!("{}, {}, {}", at.x + x, at.y + y, at.z + z);
        let point = |x: f64, y: f64, z: f64| format!(r#"x="{}" y="{}" z="{}""#, at.x + x, at.y + y, at.z + z);
        format!(
            r#"<scene version="3.0.0">
            <sensor type="perspective"><transform name="to_world"><lookat origin="{}" target="{}" up="0, 1, 0"/></transform></sensor>
            <shape type="sphere"><point name="center" {}/><float name="radius" value="0.7"/></shape>
            <shape type="cube"><transform name="to_world"><scale value="0.4"/><translate {}/></transform></shape>
            <shape type="cylinder"><point name="p0" {}/><point name="p1" {}/><float name="radius" value="0.2"/></shape>
            <shape type="shapegroup" id="group"><shape type="cube"><transform name="to_world"><translate x="0.1"/></transform></shape></shape>
            <shape type="instance"><ref id="group"/><transform name="to_world"><rotate y="1" angle="30"/><translate {}/></transform></shape>
            <emitter type="point"><point name="position" {}/></emitter>
            <emitter type="spot"><transform name="to_world"><lookat origin="{}" target="{}" up="0, 1, 0"/></transform></emitter>
            </scene>"#,
            there(0.3, 1.7, 6.1),
            there(0.0, 1.0, 0.0),
            point(0.1, 0.2, 0.3),
            point(-2.0, 0.5, 0.25),
            point(1.0, 0.0, 1.0),
            point(1.5, 2.0, 1.0),
            point(3.0, 0.0, -1.0),
            point(0.0, 4.1, 0.0),
            there(1.0, 3.0, 1.0),
            there(0.0, 0.0, 0.0),
        )
    }

    fn pbrt(at: DVec3) -> String {
        let DVec3 { x, y, z } = at;
        format!(
            r#"LookAt {} {} {}  {x} {y} {z}  0 1 0
            Camera "perspective"
            WorldBegin
            ObjectBegin "ball" Translate 0.5 0 0 Shape "sphere" "float radius" 0.25 ObjectEnd
            LightSource "infinite" "rgb L" [1 1 1] "point3 portal" [{x} {y} {z} {} {y} {z} {} {} {z} {x} {} {z}]
            Translate {x} {y} {z}
            Texture "laid" "spectrum" "checkerboard" "string mapping" "planar" "vector3 v1" [1 0 0] "vector3 v2" [0 0 1]
            Material "diffuse" "texture reflectance" "laid"
            Shape "sphere" "float radius" 0.7
            ObjectInstance "ball"
            AttributeBegin
            Translate 0 1 -2
            Shape "trianglemesh" "point3 P" [0 0 0 2 0 0 0 2.5 0] "integer indices" [0 1 2]
            AttributeEnd
            LightSource "point" "point3 from" [0.1 3.3 0.2]"#,
            x + 0.3,
            y + 1.7,
            z + 6.1,
            x + 1.0,
            x + 1.0,
            y + 1.0,
            y + 1.0,
        )
    }

    #[test]
    fn distant_vertices_keep_their_precision() {
        let far = DVec3::new(100_000.123, -20.0, 400_000.456);
        type SceneText = fn(DVec3) -> String;
        for (name, text) in [("scene.gltf", gltf as SceneText), ("scene.xml", mitsuba), ("scene.pbrt", pbrt)] {
            let (near, away) = (loaded(name, &text(DVec3::ZERO)), loaded(name, &text(far)));
            assert_eq!(near.scene.origin, DVec3::ZERO, "{name}");
            assert!((away.scene.origin - far).length() < 8.0, "{name}: {}", away.scene.origin);
            assert!(
                away.warnings.iter().any(|warning| warning.to_string().contains("units from the origin")),
                "{name}"
            );
            let (expected, found) = (places(&near.scene), places(&away.scene));
            assert!(expected.len() > 5 && expected.len() == found.len(), "{name}: {expected:?} {found:?}");
            for (expected, found) in expected.iter().zip(&found) {
                assert!(expected.distance(*found) < 2e-5, "{name}: {expected} {found}");
            }
        }
    }

    #[test]
    fn rounded_vertices_are_reported() {
        let text = "v 100000 0 0\nv 100001 0 0\nv 100000 1 0\nf 1 2 3\n";
        let loaded = loaded("scene.obj", text);
        assert!(loaded.scene.origin.x > 99_999.0);
        let (min, max) = loaded.scene.bounds();
        assert!((max - min).distance(Vec3::new(1.0, 1.0, 0.0)) < 1e-6 && max.abs().max_element() < 2.0);
        let warnings = loaded.warnings.iter().map(ToString::to_string).collect::<String>();
        assert!(warnings.contains("rounds to 7.81e-3"), "{warnings}");
    }
}
