"""Scenes in memory: edits, what they refuse, and pictures that do not depend on the edits before."""

from __future__ import annotations

import math
import os
import random
import warnings
from pathlib import Path
from typing import Any, Callable

import numpy as np
import pytest

import bottega
from bottega import Camera, Image, Material, Mesh, Object, Scene, SceneError, Texture

POSITIONS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
SEEN = Camera.looking((0.5, 0.5, 3), (0.5, 0.5, 0))
SMALL: Any = {"spp": 2, "size": (16, 12), "exact": True}
LARGER: Any = {"spp": 2, "size": (64, 48), "exact": True}
# Pixels of the larger pictures in the four quarters of the square.
UPPER_LEFT, LOWER_RIGHT, LEFT, RIGHT = (18, 26), (29, 37), (24, 26), (24, 37)


def square(**more: Any) -> Scene:
    """A white square before a camera, under an even sky."""
    scene = Scene()
    scene.materials["white"] = Material.matte()
    scene.meshes["square"] = Mesh(POSITIONS, TRIANGLES, materials="white", **more)
    scene.objects["square"] = Object("square")
    scene.environment = bottega.Environment(1.0)
    scene.cameras["main"] = SEEN
    return scene


def bits(scene: Scene, **more: Any) -> Any:
    return bottega.render(scene, **{**SMALL, **more}).values.view(np.uint32)


def same(a: Scene, b: Scene) -> bool:
    return bool((bits(a) == bits(b)).all())


def test_a_scene_of_arrays_is_painted(pyramid: Scene) -> None:
    assert "8 triangles" in repr(pyramid)
    picture = bottega.render(pyramid, spp=8, size=(48, 32), exact=True, layers=["albedo"])
    assert picture.color.mean() > 0.02
    # The pyramid is in the middle, in its own color; the floor is gray.
    red, green, blue = picture["albedo"][14, 24]
    assert red > 2 * green > 2 * blue
    again = bottega.render(pyramid, spp=8, size=(48, 32), exact=True, layers=["albedo"])
    assert (picture.values.view(np.uint32) == again.values.view(np.uint32)).all()


def test_what_moves_is_blurred() -> None:
    def column(scene: Scene) -> Any:
        return bottega.render(scene, spp=256, size=(64, 48), exact=True).color[24, :, 0]

    still, by_key, by_vertex, by_camera = square(), square(), square(), square()
    for scene in (still, by_key, by_vertex, by_camera):
        scene.environment = bottega.Environment(0.0)
        scene.materials["white"] = Material.matte((0, 0, 0))
        scene.materials["white"].emission = (1, 1, 1)
        scene.cameras["main"] = Camera.looking((0.5, 0.5, 3), (0.5, 0.5, 0), fov=60)
    shift = np.eye(4, dtype=np.float32)
    shift[0, 3] = 1
    by_key.objects["square"].set_motion([(0, np.eye(4)), (2, shift)])
    moved = POSITIONS + np.array([1, 0, 0], np.float32)
    by_vertex.meshes["square"] = Mesh(POSITIONS, TRIANGLES, materials="white", motion=[(0, POSITIONS), (2, moved)])
    eye = np.array(by_camera.cameras["main"].transform, np.float64)
    by_camera.cameras.set_motion("main", [(0, eye), (2, np.linalg.inv(shift) @ eye)])
    sharp = column(still)
    assert by_key.shutter == (0, 0, 0) and (column(by_key) == sharp).all()
    for scene in (by_key, by_vertex, by_camera):
        scene.shutter = (0, 2)
        blurred = column(scene)
        # The square is 1 wide and moves by 1: nothing is bright all the time but one edge, and the sum stays
        assert abs(blurred.sum() / sharp.sum() - 1) < 0.03
        assert blurred.max() <= 1.01 and (blurred > 0.02).sum() > 1.7 * (sharp > 0.02).sum()


def test_motion_that_cannot_be_followed_is_refused() -> None:
    scene = square()
    move = scene.objects["square"].set_motion
    for keys, said in [
        ([(1, np.eye(4)), (0, np.eye(4))], "ascend"),
        ([(0, np.eye(4)), (1, np.zeros((4, 4)) + np.diag([0, 0, 0, 1]))], "singular"),
        ([(0, np.eye(4)), (1, np.diag([-1, 1, 1, 1]))], "mirror"),
        ([(0, np.stack([np.eye(4)] * 2))], "instances"),
    ]:
        with pytest.raises(SceneError, match=said):
            move(keys)
    with pytest.raises(SceneError, match="shutter"):
        scene.shutter = (1, 0)
    with pytest.raises(SceneError, match="triangles"):
        scene.meshes["bad"] = Mesh(POSITIONS, TRIANGLES, motion=[(0, POSITIONS), (1, POSITIONS[:3])])
    with pytest.raises(SceneError):
        scene.cameras.set_motion("main", [(0, np.zeros((4, 4)) + np.diag([0, 0, 0, 1]))])


def test_corners_with_equal_values_are_one_vertex() -> None:
    corners = np.array([0, 1, 2, 0, 2, 3], np.int32)
    by_corner = {"corner_vertices": corners, "triangles": np.arange(6, dtype=np.int32).reshape(2, 3)}
    scene = square()
    scene.meshes["square"] = Mesh(POSITIONS, materials="white", **by_corner)
    assert scene.meshes["square"].vertex_count == 4 and same(scene, square())
    up = np.tile(np.array([0, 0, 1], np.float32), (6, 1))
    scene.meshes["square"] = Mesh(POSITIONS, materials="white", normals=up, **by_corner)
    assert scene.meshes["square"].vertex_count == 4
    up[3] = [0.6, 0, 0.8]
    scene.meshes["square"] = Mesh(POSITIONS, materials="white", normals=up, **by_corner)
    assert scene.meshes["square"].vertex_count == 5


def test_each_triangle_has_its_material_and_each_object_may_have_others() -> None:
    scene = square()
    scene.materials["red"] = Material.matte((0.8, 0.0, 0.0))
    scene.materials["green"] = Material.matte((0.0, 0.8, 0.0))
    slots = np.array([0, 1], np.int32)
    scene.meshes["square"] = Mesh(POSITIONS, TRIANGLES, materials=["red", "green"], triangle_materials=slots)
    albedo = bottega.render(scene, **LARGER, layers=["albedo"])["albedo"]
    assert np.allclose(albedo[LOWER_RIGHT], [0.8, 0, 0]) and np.allclose(albedo[UPPER_LEFT], [0, 0.8, 0])
    # The object's own materials, by slot; those that it has not are the mesh's.
    scene.objects["square"].materials = "white"
    albedo = bottega.render(scene, **LARGER, layers=["albedo"])["albedo"]
    assert np.allclose(albedo[LOWER_RIGHT], 0.8) and np.allclose(albedo[UPPER_LEFT], [0, 0.8, 0])


def test_many_instances_are_placed_at_once_mirrored_ones_too() -> None:
    scene = square()
    scene.materials["red"] = Material.matte((0.8, 0.0, 0.0))
    left, right = np.eye(4, dtype=np.float32), np.eye(4, dtype=np.float32)
    left[0, 0], left[0, 3], right[0, 0] = -0.5, 0.5, 0.5
    right[0, 3] = 0.5
    both = np.stack([left, right])
    chosen = np.array([0, 1], np.int32)
    scene.objects["square"] = Object("square", both, ["white", "red"], chosen)
    albedo = bottega.render(scene, **LARGER, layers=["albedo"])["albedo"]
    # The mirrored one shows its front all the same, on the left.
    assert np.allclose(albedo[LEFT], 0.8) and np.allclose(albedo[RIGHT], [0.8, 0, 0])
    assert (scene.objects["square"].transforms == both).all()
    scene.objects["square"] = Object("square", both[:, :3])
    assert len(scene.objects["square"].transforms) == 2 and scene.triangle_count == 4


def test_textures_come_from_arrays() -> None:
    scene = square(uvs=np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32))
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[0, 0], pixels[1, 1] = (255, 0, 0), (0, 188, 0)
    scene.images["colors"] = Image(pixels)
    scene.materials["white"].reflectance = Texture("colors", smooth=False)
    albedo = bottega.render(scene, **LARGER, layers=["albedo"])["albedo"]
    # The upper left texel lies on the upper left, and codes of sRGB are decoded.
    assert np.allclose(albedo[UPPER_LEFT], [1, 0, 0], atol=1e-3)
    assert np.allclose(albedo[LOWER_RIGHT], [0, 0.5029, 0], atol=1e-3)
    scene.images["colors"] = Image(pixels, "linear")
    albedo = bottega.render(scene, **LARGER, layers=["albedo"])["albedo"]
    assert np.allclose(albedo[LOWER_RIGHT], [0, 188 / 255, 0], atol=1e-3)
    with pytest.raises(SceneError, match="image `colors` is used by the material `white`"):
        del scene.images["colors"]


GRAY = Texture("gray", factor=0.5, channel="g")
MEASURED = Path(__file__).parents[3] / "scenes/models/measured.bsdf"

SURFACES = [
    bottega.Null(),
    bottega.Unlit((0.2, 0.3, 0.4)),
    bottega.Diffuse(Texture("gray"), roughness=0.3),
    bottega.DiffuseTransmission(0.3, Texture("gray", factor=(0.1, 0.2, 0.3))),
    bottega.Conductor(eta=(0.2, 0.9, 1.1), k=(3.9, 2.4, 2.2), roughness=(0.1, GRAY), distribution="beckmann"),
    bottega.Dielectric(eta=1.5, roughness=0.1, roughness_scale="square", shadowing="separable"),
    bottega.Plastic(diffuse=(0.1, 0.2, 0.5), inner="nonlinear", roughness=GRAY),
    bottega.Coated(base=bottega.Conductor(eta=0.2, k=3.0, roughness=0.3), thickness=0.1, albedo=0.5, g=0.2, max_depth=20),
    bottega.Varnished(base=bottega.Ward(roughness=(0.1, GRAY), variant="duer"), absorption=(0.1, 0.2, 0.3), roughness=GRAY),
    bottega.Phong(diffuse=GRAY, specular=0.3, exponent=50.0),
    bottega.Measured(MEASURED),
    bottega.Principled(base_color=GRAY, metallic=0.2, spec_trans=0.5, clearcoat=1.0, anisotropic=0.5),
    bottega.Hair(eumelanin=GRAY, pheomelanin=0.4, beta_m=0.2, alpha=-3.0, strand="along_v"),
    bottega.Hair(reflectance=(0.7, 0.4, 0.2), eta=1.45, beta_n=GRAY),
    bottega.Hair(sigma_a=Texture("gray", factor=(0.1, 0.2, 0.3))),
    bottega.Layered(
        (0.2, 0.3, 0.4),
        metallic=GRAY,
        anisotropy=bottega.Anisotropy(0.5, 1.0, Texture("gray")),
        iridescence=bottega.Iridescence(0.5, 1.4, (100, 500), GRAY),
        coat=1.0,
        coat_normal=Texture("gray", factor=0.5),
        sheen_color=0.3,
    ),
    bottega.Layered(GRAY, subsurface=bottega.Subsurface(GRAY, radius=(1.0, 0.3, 0.1), radius_ior=1.4, g=0.8)),
    bottega.Layered(subsurface=bottega.Subsurface(absorption=(0.1, 0.2, 0.3), scattering=(2.0, 1.0, 1.0), inner_eta=1.3)),
    bottega.Blend(GRAY, bottega.Diffuse(0.2), bottega.Conductor(roughness=0.2)),
    bottega.Sum(bottega.Diffuse(GRAY), bottega.Conductor(roughness=0.2)),
    bottega.Transparent(Texture("gray", factor=(1, 0.5, 0.2))),
]


@pytest.mark.parametrize("surface", SURFACES, ids=lambda surface: type(surface).__name__)
def test_every_surface_can_be_put_painted_and_taken_out(surface: bottega.Surface) -> None:
    scene = square(uvs=POSITIONS[:, :2].copy())
    scene.images["gray"] = Image(np.full((4, 4), 128, np.uint8), "linear")
    scene.media["fog"] = bottega.Medium(absorption=(0.1, 0.2, 0.3), scattering=0.2, g=0.5)
    whole = Material(
        surface,
        back=bottega.Diffuse(0.1),
        opacity=GRAY,
        alpha="blend",
        emission=(1, 2, 3),
        emission_sides="front",
        relief=bottega.BumpMap(Texture("gray", factor=0.1)),
        displacement=bottega.Displacement(GRAY, scale=-0.01, bias=0.005, space="world", edge=0.5),
        interior="fog",
    )
    scene.materials["white"] = whole
    assert np.isfinite(bottega.render(scene, **SMALL).color).all()
    # What a fresh scene gives of the text that the first has kept is the same.
    taken = scene.materials["white"]
    again = square(uvs=POSITIONS[:, :2].copy())
    again.images["gray"] = Image(np.full((4, 4), 128, np.uint8), "linear")
    again.media["fog"] = scene.media["fog"].copied()
    again.materials["white"] = taken.copied()
    assert type(taken.surface) is type(surface) and same(scene, again)


def test_all_lights_environments_and_cameras(tmp_path: Path) -> None:
    scene = square()
    scene.images["map"] = Image(np.linspace(0, 2, 8 * 8 * 3, dtype=np.float32).reshape(8, 8, 3), "linear")
    matrix = np.eye(4)
    matrix[:3, 3] = (0.5, 0.5, 2)
    scene.lights["point"] = bottega.PointLight((0, 1, 2), (1, 2, 3))
    scene.lights["sun"] = bottega.SunLight.by_matrix(matrix, 2.0)
    scene.lights["soft sun"] = bottega.SunLight((0.6, 0, -0.8), 2.0, angle=10)
    assert scene.lights["soft sun"].angle == pytest.approx(10)
    scene.lights["spot"] = bottega.SpotLight.by_matrix(matrix, inner=10, outer=30)
    scene.lights["projector"] = bottega.ProjectorLight(Texture("map"), matrix)
    scene.lights["around"] = bottega.GoniometricLight("map", (0.5, 0.5, 1))
    scene.environment = bottega.Environment((0.1, 0.2, 0.3), image="map", rotation=np.diag([-1.0, 1.0, 1.0]))
    before = bits(scene)
    for key in scene.lights:
        assert (bits(scene) == before).all()
        scene.lights.hide(key)
        assert scene.lights.is_hidden(key) and (bits(scene) != before).any(), key
        scene.lights.hide(key, False)
        scene.lights[key] = scene.lights[key].copied()
    assert (bits(scene) == before).all(), "what was taken out and put in again is the same"
    scene.environment.radiance = 0.0
    assert (bits(scene) != before).any()
    for camera in (
        Camera(matrix, fov=60, shift=(0.5, 0), lens_radius=0.1, focus_distance=2.0),
        Camera(matrix, projection="orthographic", height=2.0, near=0.5, far=3.0),
        Camera(matrix, projection="equirectangular"),
        Camera(matrix, projection="cube", stereo="top_bottom", eye_distance=0.1, convergence=4.0),
        Camera(matrix, projection="equisolid_fisheye", fisheye_fov=190, circle_height=2.0),
        Camera(matrix, lens_radius=0.1, focus_distance=2.0, blades=5, blade_rotation=20, aperture_ratio=2.0),
        Camera(matrix, lenses=bottega.Lenses([(0.04, 0.006, 1.5, 0.012), (-0.05, 0.04, 1.0, 0.012)], 0.01, 2.0), rolling_shutter=0.5),
    ):
        scene.cameras["other"] = camera
        color = bottega.render(scene, camera="other", **SMALL).color
        assert np.isfinite(color).all() and color.max() > 0
        scene.save(tmp_path / "a.bottega")
        read = Scene.read(tmp_path / "a.bottega")
        assert (bottega.render(read, camera="other", **SMALL).color == color).all(), camera.projection
        assert read.cameras["other"].stereo == camera.stereo and read.cameras["other"].blades == camera.blades
    scene.cameras["other"].projection = "perspective"
    assert scene.cameras["other"].far == math.inf and scene.cameras.keys() == ["main", "other"]


def test_lights_with_a_shape_and_who_sees_them() -> None:
    scene = square()
    scene.environment = None
    matrix = np.eye(4)
    matrix[:3, 3] = (0.5, 0.5, 2)
    lights: dict[str, bottega.Light] = {
        "ball": bottega.PointLight((0.5, 0.5, 2), (1, 2, 3), radius=0.3),
        "spot": bottega.SpotLight.blended(matrix, size=60, blend=0.5, intensity=5, radius=0.2),
        "panel": bottega.AreaLight(matrix, (1, 0.5), 10.0, spread=90),
        "disk": bottega.AreaLight(matrix, (0.5, 0.5), 10.0, "ellipse"),
    }
    for key, light in lights.items():
        scene.lights[key] = light
        color = bottega.render(scene, **{**LARGER, "spp": 64}).color
        # The lamp is between camera and square. Seen from behind, a panel or a spot emits nothing and hides nothing.
        assert color.mean() > 1e-4, key
        kept = scene.lights[key].copied()
        before = bits(scene)
        scene.lights[key] = kept
        assert (bits(scene) == before).all() and type(kept) is type(light), "what was taken out and put in again is the same"
        scene.lights[key].visibility.camera = False
        unseen = bottega.render(scene, **{**LARGER, "spp": 64}).color
        assert (unseen[24, 32] == color[24, 32]).all() == (key != "ball"), key
        # Neither paths nor light samples find it any more
        scene.lights[key].visibility = bottega.Visibility(False, False, False, False, False)
        assert bottega.render(scene, **LARGER).color.mean() == 0.0, key
        del scene.lights[key]
    assert lights["spot"].falloff == "smooth_cosine" and lights["spot"].outer == 30  # type: ignore[attr-defined]


PROFILE = "IESNA91\nTILT=NONE\n1 100 1 3 1 1 2 0 0 0 1 1 10\n0 45 90\n0\n80 40 0\n"


def test_lamps_have_profiles_of_ies(tmp_path: Path) -> None:
    (tmp_path / "lamp.ies").write_text(PROFILE)
    profile = bottega.IesProfile(tmp_path / "lamp.ies")
    assert profile.peak == 80 and profile.candela(22.5, 10) == 60 and 100 < profile.lumens < 300
    pixels = profile.pixels()
    assert pixels.shape == (181, 1) and pixels[0, 0] == 1 and pixels[45, 0] == 0.5 and pixels[91, 0] == 0
    assert profile.pixels("cubic").shape == (721, 1)
    with pytest.raises(SceneError, match="line 4"):
        bottega.IesProfile.of_text(PROFILE.replace("0 45 90", "0 45 30"))
    scene = square()
    scene.environment = None
    scene.images["lamp"] = Image(pixels, "linear")
    matrix = np.eye(4)
    matrix[:3, 3] = (0.5, 0.5, 1)
    lights: list[bottega.Light] = [
        bottega.GoniometricLight.along("lamp", matrix, intensity=1.0),
        bottega.GoniometricLight.along("lamp", matrix, intensity=1.0, radius=0.01),
    ]
    rotation = lights[0].rotation  # type: ignore[attr-defined]
    lights.append(bottega.AreaLight(matrix, (0.01, 0.01), np.pi * 1e-4, profile="lamp", profile_rotation=rotation))
    for light in lights:
        light.visibility.camera = False
        scene.lights["lamp"] = light
        color = bottega.render(scene, **{**LARGER, "spp": 64}).color
        # The middle lies straight below, at a distance of 1: the radiance of a surface of albedo 0.8 is 0.8 I / π
        intensity = 1.0 if light is not lights[2] else 1e-4
        assert color[24, 32, 0] == pytest.approx(0.8 * intensity / np.pi, rel=0.05)
        before = bits(scene)
        scene.lights["lamp"] = scene.lights["lamp"].copied()
        assert (bits(scene) == before).all(), "what was taken out and put in again is the same"
        with pytest.raises(SceneError, match="lamp"):
            del scene.images["lamp"]
        scene.save(tmp_path / "a.bottega")
        assert same(scene, Scene.read(tmp_path / "a.bottega"))
    with pytest.raises(SceneError, match="spread"):
        scene.lights["lamp"] = bottega.AreaLight(matrix, (1, 1), 1.0, spread=90, profile="lamp")
    with pytest.raises(SceneError, match="mapping"):
        scene.lights["lamp"] = bottega.GoniometricLight("lamp", radius=0.1)


def test_a_texture_lies_upright_on_an_area_light(tmp_path: Path) -> None:
    scene = square()
    scene.environment = None
    # Only the upper left quarter is bright, where the light's -x and +y meet
    scene.images["map"] = Image(np.array([[1, 0], [0, 0]], np.float32), "linear")
    matrix = np.eye(4)
    matrix[:3, 3] = (0.5, 0.5, 0.2)
    for shape in ("rectangle", "ellipse"):
        scene.lights["panel"] = bottega.AreaLight(matrix, (1, 1), 10.0, shape, texture=Texture("map", smooth=False))  # type: ignore[arg-type]
        scene.lights["panel"].visibility.camera = False
        color = bottega.render(scene, **{**LARGER, "spp": 64}).color
        assert color[UPPER_LEFT].mean() > 3 * color[LOWER_RIGHT].mean(), shape
        before = bits(scene)
        scene.lights["panel"] = scene.lights["panel"].copied()
        assert (bits(scene) == before).all()
        scene.save(tmp_path / "a.bottega")
        assert same(scene, Scene.read(tmp_path / "a.bottega"))


def test_the_power_of_an_area_light_does_not_depend_on_size_shape_and_spread() -> None:
    scene = square()
    scene.environment = None
    scene.meshes["square"] = Mesh((POSITIONS - (0.5, 0.5, 0)).astype(np.float32) * 10, TRIANGLES, materials="white")
    matrix = np.eye(4)
    matrix[2, 3] = 1.0
    scene.cameras["main"] = Camera(((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 500), (0, 0, 0, 1)), projection="orthographic", height=10.0)
    found = []
    for light in (
        bottega.AreaLight(matrix, (0.4, 0.1), 40.0, spread=60),
        bottega.AreaLight(matrix, (0.4, 2.0), 40.0, spread=20),
        bottega.AreaLight(matrix, (0.4, 2.0), 40.0, "ellipse", spread=120),
    ):
        scene.lights["area"] = light
        color = bottega.render(scene, spp=256, size=(64, 64), exact=True).color
        # Radiance over the floor: reflected power over pi
        found.append(float(color.mean()) * 10 * 10 * math.pi / 0.8)
    assert np.allclose(found, 40.0, rtol=0.1), found


def test_objects_and_spheres_hide_from_kinds_of_ray() -> None:
    scene = square()
    scene.environment = None
    scene.lights["sun"] = bottega.SunLight((0, 0, -1), 3.0)
    matrix = np.eye(4)
    matrix[2, 3] = 1.0
    scene.objects["screen"] = Object("square", matrix, visibility=bottega.Visibility(camera=False))
    lit = lambda: float(bottega.render(scene, **LARGER).color[UPPER_LEFT].mean())  # noqa: E731
    assert lit() == 0.0, "only its shadow is seen"
    assert not scene.objects["screen"].visibility.camera
    scene.objects["screen"].visibility.shadow = False
    both = lit()
    scene.objects["screen"].visibility = bottega.Visibility(False, False, False, False, False, False)
    alone = lit()
    assert both > alone > 0.1, "what the screen reflects is missing"
    scene.objects["screen"].hidden = True
    assert abs(lit() / alone - 1.0) < 1e-5
    scene.spheres["ball"] = bottega.Sphere((0.5, 0.5, 1), 0.6, "white", visibility=bottega.Visibility(False, shadow=False))
    assert scene.spheres["ball"].visibility.bits == 30
    assert 1.0 < lit() / alone < 1.5, "it reflects, and casts no shadow"
    with pytest.raises(SceneError, match="bottega.Visibility is needed"):
        scene.spheres["ball"].visibility = True  # type: ignore[assignment]


def test_transparent_surfaces_tint_what_is_behind_them() -> None:
    scene = square()
    scene.environment = None
    scene.lights["sun"] = bottega.SunLight((0, 0, -1), 3.0)
    plain = bottega.render(scene, **LARGER).color
    scene.materials["pane"] = Material(bottega.Transparent((1.0, 0.5, 0.25)))
    matrix = np.eye(4)
    matrix[2, 3] = 1.0
    scene.objects["pane"] = Object("square", matrix, "pane")
    tinted = bottega.render(scene, **LARGER).color
    # Light passes the pane before the square and after it
    assert np.allclose(tinted[UPPER_LEFT] / plain[UPPER_LEFT], [1.0, 0.25, 0.0625], rtol=1e-3)
    assert isinstance(scene.materials["pane"].surface, bottega.Transparent) and scene.materials["pane"].see_through
    scene.materials["pane"].surface = bottega.Sum(bottega.Transparent(0.5), bottega.Transparent((0.5, 0.0, 0.0)))
    summed = bottega.render(scene, **{**LARGER, "spp": 256}).color
    assert np.allclose(summed[UPPER_LEFT] / plain[UPPER_LEFT], [1.0, 0.25, 0.25], atol=0.15)


def test_a_medium_of_a_grid_dims_what_is_behind_it() -> None:
    scene = square()
    grid = np.zeros((4, 4, 4), np.float32)
    grid[:, :, 2:] = 1.0
    scene.media["smoke"] = bottega.Medium(absorption=50.0, density=grid)
    scene.materials["air"] = Material(bottega.Null(), interior="smoke")
    scene.spheres["air"] = bottega.Sphere((0.5, 0.5, 0.5), 0.45, "air")
    scene.environment = None
    scene.lights["sun"] = bottega.SunLight((0, 0, -1), 3.0)
    color = bottega.render(scene, **LARGER).color
    assert color[LEFT].mean() > 10 * color[RIGHT].mean(), "the smoke is on the right"
    scene.media["smoke"].absorption = 0.0
    color = bottega.render(scene, **LARGER).color
    assert color[RIGHT].mean() > 0.5 * color[LEFT].mean(), "the grid has stayed, and absorbs nothing"


FIRE = Path(__file__).parents[2] / "bottega-scene/tests/voxels/data/fire.vdb"


def luminance(color: np.ndarray) -> float:
    return float((color @ (0.2126, 0.7152, 0.0722)).mean())


def test_voxels_of_a_file_fill_a_medium() -> None:
    assert ("density", "float") in bottega.Voxels.grids(FIRE)
    voxels = bottega.Voxels(FIRE, temperature="temperature")
    assert (voxels.density_max, voxels.temperature_max) == (1.0, 3000.0)
    cube = np.array(voxels.transform)
    assert (cube[:3, 3] <= (1, 2, 3)).all() and (cube[:3] @ (1, 1, 1, 1) >= (2.6, 3.6, 4.6)).all()
    # Around (0.5, 0.5, 0.3), 0.8 wide
    place = np.eye(4) * (0.5, 0.5, 0.5, 1)
    place[:3, 3] = np.array((0.5, 0.5, 0.3)) - 0.5 * np.array((1.8, 2.8, 3.8))
    scene = square()
    scene.environment = None
    scene.media["fire"] = bottega.Medium(absorption=20.0, voxels=voxels, transform=place)
    scene.materials["fire"] = Material(bottega.Null(), interior="fire")
    scene.spheres["fire"] = bottega.Sphere((0.5, 0.5, 0.3), 0.7, "fire")
    dark = bottega.render(scene, **LARGER).color
    assert dark.max() == 0.0
    scene.media["fire"] = bottega.Medium(absorption=20.0, emission=1.0, voxels=voxels, transform=place)
    by_peaks = bottega.render(scene, **LARGER).color
    middle = by_peaks[by_peaks.shape[0] // 2, by_peaks.shape[1] // 2]
    assert middle[0] > 1.5 * middle[1] > 2.0 * middle[2] > 0, "3000 K is orange"
    scene.media["fire"].g = 0.1
    assert (bottega.render(scene, **LARGER).color == by_peaks).all(), "the voxels stay"
    power = bottega.Medium(emission=1.0, voxels=voxels, transform=place, blackbody="power")
    scene.media["fire"] = power
    first = luminance(bottega.render(scene, **LARGER).color)
    power.temperature_scale = 2.0
    scene.media["fire"] = power
    assert 0.9 < luminance(bottega.render(scene, **LARGER).color) / first / 16 < 1.1, "the law of Stefan and Boltzmann"
    for wrong, said in [
        (lambda: bottega.Voxels(FIRE, "smoke"), "no voxels in a grid `smoke`"),
        (lambda: bottega.Voxels(__file__), "neither an OpenVDB nor a NanoVDB file"),
        (lambda: scene.media.add("a", bottega.Medium(voxels=voxels, density=np.ones((2, 2, 2), np.float32))), "one of them"),
        (lambda: scene.media.add("a", bottega.Medium(voxels=voxels, transform=np.zeros((4, 4)))), "transform"),
    ]:
        with pytest.raises(SceneError, match=said):
            wrong()


# The values by kind and key from which a fresh scene is made.
Wanted = dict[str, dict[str, Any]]
COLLECTIONS = ["materials", "meshes", "objects", "lights", "cameras"]
EDITS = ["materials", "meshes", "objects", "objects", "lights", "cameras", "environment", "move", "hide", "remove", "undo"]


def edit(chance: random.Random, scene: Scene, wanted: Wanted) -> None:
    """Makes one edit in the scene and in the values of a fresh one."""
    kind = chance.choice(EDITS)
    key = f"{kind} {chance.randrange(3)}"
    before = {kind: dict(values) for kind, values in wanted.items() if kind != "before"}

    def put(kind: str, key: str, value: Any) -> None:
        getattr(scene, kind)[key] = value
        wanted[kind][key] = value

    materials, objects = list(wanted["materials"]), list(wanted["objects"])
    if kind == "materials":
        color = tuple(chance.random() for _ in range(3))
        surfaces = [bottega.Diffuse(color), bottega.Conductor(roughness=0.2), bottega.Dielectric(), bottega.Layered(color)]
        emission = chance.choice([0.0, 0.0, 2.0])
        alpha = chance.choice(["opaque", "blend"])
        put(kind, key, Material(chance.choice(surfaces), emission=emission, opacity=0.5, alpha=alpha))
    elif kind == "meshes":
        slots = np.array([chance.randrange(2), chance.randrange(2)], np.int32)
        chosen = [chance.choice(materials), chance.choice(materials)]
        moved = POSITIONS + np.float32(chance.random())
        put(kind, key, Mesh(moved, TRIANGLES, materials=chosen, triangle_materials=slots))
    elif kind == "objects":
        matrices = np.array([place(chance) for _ in range(chance.randrange(1, 4))])
        own = [chance.choice(materials)] if chance.random() < 0.5 else []
        put(kind, key, Object(chance.choice(list(wanted["meshes"])), matrices, own))
    elif kind == "lights":
        put(kind, key, lamp(chance))
    elif kind == "cameras":
        put(kind, "main", Camera.looking((chance.uniform(-1, 1), 0.5, 4), (0.5, 0.5, 0), fov=chance.uniform(20, 60)))
    elif kind == "move" and objects:
        key = chance.choice(objects)
        old = wanted["objects"][key]
        matrices = np.array([place(chance) for _ in np.asarray(old.transforms)])
        scene.objects[key].transforms = matrices
        wanted["objects"][key] = Object(old.mesh, matrices, old.materials, None, old.hidden)
    elif kind == "hide" and objects:
        key = chance.choice(objects)
        old = wanted["objects"][key]
        scene.objects[key].hidden = not old.hidden
        wanted["objects"][key] = Object(old.mesh, old.transforms, old.materials, None, not old.hidden)
    elif kind == "remove" and objects:
        key = chance.choice(objects)
        del scene.objects[key], wanted["objects"][key]
    elif kind == "environment":
        scene.environment = wanted["environment"]["world"] = bottega.Environment(chance.choice([0.0, 0.3, 1.0]))
    elif kind == "undo" and "before" in wanted:
        undo(scene, wanted)
        return
    wanted["before"] = before


def undo(scene: Scene, wanted: Wanted) -> None:
    """Takes the last edit back."""
    old = wanted.pop("before")
    for kind, values in old.items():
        if kind == "environment":
            scene.environment = values["world"]
        else:
            for key in wanted[kind].keys() - values.keys():
                del getattr(scene, kind)[key]
            for key, value in values.items():
                if wanted[kind].get(key) is not value:
                    getattr(scene, kind)[key] = value
            if list(getattr(scene, kind).keys()) != list(values):
                getattr(scene, kind).arrange(list(values))
        wanted[kind] = values


def lamp(chance: random.Random) -> bottega.Light:
    at = tuple(chance.uniform(-2, 2) for _ in range(3))
    lamps = [
        bottega.PointLight(at, 1.0),
        bottega.PointLight(at, 1.0, radius=0.2),
        bottega.SunLight((0.0, -1.0, -0.3), 1.0, angle=chance.uniform(0, 20)),
        bottega.AreaLight(place(chance), (1.0, 0.5), chance.uniform(1, 9)),
    ]
    return chance.choice(lamps)


def place(chance: random.Random) -> Any:
    matrix = np.diag([chance.choice([-1, 1]) * chance.uniform(0.3, 1), 1, 1, 1])
    matrix[:3, 3] = [chance.uniform(-1, 1) for _ in range(3)]
    return matrix


def fresh(wanted: Wanted) -> Scene:
    scene = Scene()
    for kind in COLLECTIONS:
        for key, value in wanted[kind].items():
            getattr(scene, kind).add(key, value)
    scene.environment = wanted["environment"]["world"]
    return scene


def first(scene: Scene) -> Wanted:
    """Fills a scene; returns what is wanted of it."""
    wanted: Wanted = {kind: {} for kind in COLLECTIONS}
    wanted["materials"]["materials 0"] = Material.matte(0.6)
    wanted["meshes"]["meshes 0"] = Mesh(POSITIONS, TRIANGLES, materials="materials 0")
    wanted["cameras"]["main"] = SEEN
    for kind, values in wanted.items():
        for key, value in values.items():
            getattr(scene, kind)[key] = value
    scene.environment = bottega.Environment(0.3)
    wanted["environment"] = {"world": scene.environment}
    return wanted


def test_a_picture_does_not_depend_on_the_edits_before() -> None:
    """Sequences of 50 edits: after each fifth the picture is that of a fresh scene. BOTTEGA_EDIT_SEQUENCES: how many sequences."""
    for sequence in range(int(os.environ.get("BOTTEGA_EDIT_SEQUENCES", "4"))):
        chance = random.Random(7 + sequence)
        scene = Scene()
        wanted = first(scene)
        for number in range(50):
            edit(chance, scene, wanted)
            if number % 5 == 4:
                assert same(scene, fresh(wanted)), f"sequence {sequence}, edit {number}"


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="the memory of a process is read from /proc")
def test_memory_returns_to_its_level_after_edits() -> None:
    """A mesh and an image of 6 MB are replaced, hidden, removed and put back; a viewport shows each state."""

    def resident() -> float:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6

    side = 150
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side), [0.0]), -1).reshape(-1, 3)
    corners = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.concatenate([np.stack([corners, corners + a, corners + b], -1) for a, b in ((1, side + 1), (side + 1, side))])
    scene = Scene()
    first(scene)
    levels = []
    with bottega.Viewport(scene, size=(24, 16), spp=1, threads=1) as viewport:
        frame = np.empty(viewport.shape, np.float32)

        def show() -> None:
            look, seen = viewport.update(), None
            while seen is None or seen.look != look:
                viewport.wait(20)
                seen = viewport.frame_into(frame)

        for turn in range(8):
            scene.images["large"] = bottega.Image(np.full((1200, 1200, 4), turn, np.uint8))
            scene.materials["shown"] = Material(bottega.Diffuse(bottega.Texture("large")))
            scene.meshes["large"] = Mesh((grid + 0.01 * turn).astype(np.float32), faces.astype(np.int32), materials="shown")
            scene.objects["large"] = Object("large")
            show()
            scene.objects.hide("large")
            show()
            for kind in ("objects", "meshes", "materials", "images"):
                del getattr(scene, kind)["large" if kind != "materials" else "shown"]
            show()
            levels.append(resident())
    assert max(levels[4:]) < max(levels[:4]) + 12, f"{levels} MB: each turn needs some 10"


def test_a_scene_that_was_read_has_the_bits_of_its_file_and_can_be_edited(box: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = Scene.read(box)
    assert (bits(scene) == bottega.render(box, **SMALL).values.view(np.uint32)).all()
    before = bottega.render(scene, **SMALL, layers=["albedo"])["albedo"]
    keys = scene.materials.keys()
    assert keys and scene.objects.keys() and scene.cameras.keys(), "there are keys"
    for key in keys:
        scene.materials[key].base_color = (0.1, 0.2, 0.3)
        scene.materials[key].roughness = 0.2
    assert scene.materials[keys[0]].surface.roughness == pytest.approx(0.2)
    after = bottega.render(scene, **SMALL, layers=["albedo"])["albedo"]
    is_blue = after[..., 2] > 1.5 * after[..., 0]
    assert is_blue.any() and not (before[..., 2] > 1.5 * before[..., 0])[is_blue].any()
    count = scene.triangle_count
    scene.objects[scene.objects.keys()[0]].hidden = True
    assert scene.triangle_count < count
    with pytest.raises(SceneError, match=r"there is no material `glas`; the scene has"):
        scene.materials["glas"]
    with pytest.raises(SceneError, match=r"`roughness` is 2: from 0 to 1 is allowed"):
        scene.materials[keys[0]].roughness = 2
    with pytest.raises(AttributeError, match="no field `rough`"):
        scene.materials[keys[0]].rough = 0.2
    assert scene.materials[keys[0]].surface.roughness == pytest.approx(0.2), "what was refused has changed nothing"


def test_values_write_back_only_while_they_are_in_the_scene() -> None:
    scene = square()
    old = scene.materials["white"]
    scene.materials["white"] = Material.matte(0.5)
    old.reflectance = 0.1
    assert scene.materials["white"].reflectance == (0.5, 0.5, 0.5)
    shared = bottega.Diffuse(0.3)
    one, two = Material(shared), Material(shared)
    one.reflectance = 0.9
    assert two.reflectance == (0.3, 0.3, 0.3)


def wrong_row(row: Any) -> Any:
    positions = POSITIONS.copy()
    positions[1] = row
    return positions


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"positions": POSITIONS[:, :2].copy()}, r"`positions`: its shape is \[4, 2\], and \(N, 3\) is needed"),
        ({"positions": POSITIONS.astype(np.float64)}, r"`positions`: its dtype is float64, .*astype\(np.float32\)"),
        ({"positions": POSITIONS[:, ::-1]}, r"`positions`: its values are not contiguous.*np.ascontiguousarray"),
        ({"positions": POSITIONS.astype(">f4")}, r"`positions`: its dtype is >f4"),
        ({"positions": POSITIONS.tolist()}, r"`positions`: it is a list, not an array of NumPy"),
        ({"positions": wrong_row(np.nan)}, r"`positions`, row 1: it is \[NaN"),
        ({"positions": wrong_row(np.inf)}, r"`positions`, row 1: .*finite"),
        ({"positions": wrong_row(1e30)}, r"`positions`, row 1: .*1e18"),
        ({"triangles": TRIANGLES.astype(np.int64)}, r"`triangles`: its dtype is int64"),
        ({"triangles": np.array([[0, 1, 4]], np.int32)}, r"`triangles`, row 0: it is \[0, 1, 4\]; there are corners 0 to 3"),
        ({"triangles": np.array([[0, 1, -1]], np.int32)}, r"`triangles`, row 0"),
        ({"triangles": np.array([[0, 1, 2], [0, 1, 1]], np.int32)}, r"`triangles`, row 1: .*no area; .*drop_empty=True"),
        ({"corner_vertices": np.array([0, 1, 2, 9], np.int32)}, r"`corner_vertices`, row 3: it is 9; there are vertices 0 to 3"),
        ({"corner_vertices": np.zeros(2**31, np.int32)}, r"`corner_vertices`: it has 2147483648 rows.*divide the mesh"),
        ({"normals": POSITIONS[:2].copy()}, r"`normals`: it has 2 rows, and there are 4 corners"),
        ({"uvs": POSITIONS}, r"`uvs`: its shape is \[4, 3\], and \(N, 2\) is needed"),
        ({"colors": np.full((4, 4), -1, np.float32)}, r"`colors`, row 0"),
        ({"triangle_materials": np.array([0, 1], np.int32)}, r"`triangle_materials`, row 1: it is 1; there are materials 0 to 0"),
        ({"materials": ["gold"]}, r"there is no material `gold`; the scene has `white`"),
        ({"materials": [3]}, r"`materials` has 3: keys of materials are needed"),
    ],
)
def test_wrong_arrays_are_named(arguments: dict[str, Any], said: str) -> None:
    scene = square()
    before = bits(scene)
    whole = {"positions": POSITIONS, "triangles": TRIANGLES, "materials": "white", **arguments}
    with pytest.raises(SceneError, match=said):
        scene.meshes["square"] = Mesh(**whole)
    assert (bits(scene) == before).all(), "nothing has changed"


def flat() -> Any:
    return np.diag([1.0, 0.0, 1.0, 1.0])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda scene: scene.objects.add("square", Object("square")), "the object `square` exists already; choose another key"),
        (lambda scene: scene.objects.add("", Object("square")), "the object has an empty key"),
        (lambda scene: scene.objects.add("b", Object("cube")), "there is no mesh `cube`; the scene has `square`"),
        (lambda scene: scene.objects.add("b", Object("square", np.stack([np.eye(4), flat()]))), r"`transforms`, row 1: the matrix is singular"),
        (lambda scene: scene.objects.add("b", Object("square", np.full((4, 4), np.nan))), r"`transforms`"),
        (lambda scene: scene.objects.add("b", Object("square", np.eye(3))), r"`transforms`: its shape is \[3, 3\]"),
        (lambda scene: scene.objects.add("b", Object("square", np.ones((1, 4, 4)))), r"its last row is"),
        (lambda scene: scene.objects.add("b", Object("square", None, "white", np.array([1], np.int32))), r"`instance_materials`, row 0"),
        (lambda scene: scene.objects["c"], "there is no object `c`"),
        (lambda scene: scene.meshes.__delitem__("square"), "mesh `square` is used by the object `square`"),
        (lambda scene: scene.materials.__delitem__("white"), "material `white` is used by the mesh `square`"),
        (lambda scene: scene.materials.add("b", Material(interior="fog")), "there is no medium `fog`"),
        (lambda scene: scene.materials.add("b", Material(emission=Texture("sky"))), "there is no image `sky`"),
        (lambda scene: scene.materials.add("b", bottega.Diffuse()), "a material cannot be a Diffuse"),
        (lambda scene: setattr(scene.materials["white"], "reflectance", (0, 0)), "`reflectance` is .*3 numbers are needed"),
        (lambda scene: setattr(scene.materials["white"], "opacity", math.nan), "`opacity` is nan"),
        (lambda scene: setattr(scene.materials["white"], "alpha", "glass"), "`alpha` is 'glass': one of"),
        (lambda scene: scene.images.add("a", Image(np.zeros((2, 2, 2), np.uint8))), r"`pixels`: its shape is \[2, 2, 2\]"),
        (lambda scene: scene.images.add("a", Image(np.full((2, 2), np.nan, np.float32))), r"row 0, column 0 is NaN"),
        (lambda scene: scene.lights.add("a", bottega.PointLight((0, 0, 0), (-1, 0, 0))), r"`intensity\[0\]` is -1"),
        (lambda scene: scene.lights.add("a", bottega.SpotLight(inner=50, outer=40)), "`inner` must be the smaller angle"),
        (lambda scene: scene.lights.add("a", bottega.SunLight((0, 0, 0))), "a direction has a length above 0"),
        (lambda scene: scene.cameras.add("a", Camera(np.diag([2.0, 2, 2, 1]))), "the camera `a`: its matrix scales"),
        (lambda scene: scene.cameras.add("a", Camera(near=2, far=1)), "clip planes are negative or out of order"),
        (lambda scene: Camera.looking((0, 0, 0), (0, 1, 0)), "`up`"),
        (lambda scene: scene.spheres.add("a", bottega.Sphere((0, 0, 0), 0, "white")), "its radius is not above 0"),
        (lambda scene: scene.media.add("a", bottega.Medium(g=1)), "`g` is 1"),
    ],
)
def test_wrong_edits_are_refused_and_change_nothing(change: Callable[[Scene], Any], said: str) -> None:
    scene = square()
    before = bits(scene)
    with pytest.raises(SceneError, match=said):
        change(scene)
    assert (bits(scene) == before).all()


def test_scenes_that_cannot_be_painted_say_so() -> None:
    with pytest.raises(bottega.Error, match="no camera"):
        bottega.render(Scene())
    with pytest.raises((bottega.Error, ValueError)):
        bottega.render(square(), engine={"names": ["povray"]})


def test_a_session_paints_the_scene_as_it_was_opened() -> None:
    scene = square()
    before = bits(scene)
    session = bottega.Session(scene, **SMALL)
    scene.materials["white"].reflectance = 0.1
    del scene.objects["square"]
    assert (session.render().values.view(np.uint32) == before).all()


def test_lights_with_a_shape_hide_nothing() -> None:
    def mean(power: float, radius: float, sky: float) -> float:
        scene = bottega.Scene()
        scene.materials["floor"] = bottega.Material.matte(0.8)
        corners = np.array([[-5, 0, 5], [5, 0, 5], [5, 0, -5], [-5, 0, -5]], np.float32)
        scene.meshes["floor"] = bottega.Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), materials="floor")
        scene.objects["floor"] = bottega.Object("floor")
        if power:
            down = ((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 3.0), (0.0, -1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
            scene.lights["area"] = bottega.AreaLight(down, (2, 2), power)
            scene.lights["ball"] = bottega.PointLight((-2, 2, 0), power / 20, radius)
        if sky:
            scene.environment = bottega.Environment(sky)
        scene.cameras["main"] = bottega.Camera.looking((0, 2, 6), (0, 0, 0))
        return float(bottega.render(scene, spp=128, size=(48, 32), max_depth=4, guide={"by": "none"}).color.mean())

    both, sum_of_parts = mean(25.0, 0.5, 0.5), mean(25.0, 0.5, 0.0) + mean(0.0, 0.5, 0.5)
    assert abs(both / sum_of_parts - 1) < 0.003


def test_curves_are_as_wide_as_they_are_said_to_be_and_hair_loses_no_light() -> None:
    scene = bottega.Scene()
    scene.materials["black"] = bottega.Material(bottega.Diffuse(0.0))
    scene.materials["white"] = bottega.Material(bottega.Hair(sigma_a=(0.0, 0.0, 0.0)))
    scene.environment = bottega.Environment((1, 1, 1))
    scene.cameras["main"] = bottega.Camera.looking((0, 0, 4), (0, 0, 0), fov=60)
    points = np.array([[0, -5, 0], [0, 0, 0], [0, 5, 0], [1, -5, 0], [1, 5, 0]], np.float32)
    counts, radii = np.array([3, 2], np.int32), np.array([0.25, 0.25, 0.25, 0.1, 0.1], np.float32)
    for shape in ("round", "flat"):
        scene.meshes["strands"] = bottega.Curves(points, counts, radii, shape=shape, material="black")  # type: ignore[arg-type]
        scene.objects["strands"] = bottega.Object("strands")
        dark = 1 - float(bottega.render(scene, size=(64, 16), spp=64).color.mean())
        # The picture is 4 times as wide as high, and 2 x 4 tan 30° high
        assert dark == pytest.approx(0.7 / (4 * 8 * np.tan(np.pi / 6)), rel=0.02), shape
    scene.meshes["strands"] = bottega.Curves(points, counts, radii, material="white")
    assert float(bottega.render(scene, size=(32, 8), spp=64, max_depth=100).color.mean()) == pytest.approx(1, abs=0.01)
    assert scene.meshes["strands"].materials == ["white"]
    with pytest.raises(bottega.SceneError, match="counts.*sum is 4"):
        scene.meshes["strands"] = bottega.Curves(points, np.array([2, 2], np.int32), radii)
    with pytest.raises(bottega.SceneError, match="radii"):
        scene.meshes["strands"] = bottega.Curves(points, counts, radii[:3])
    with pytest.raises(bottega.SceneError, match="shape"):
        scene.meshes["strands"] = bottega.Curves(points, counts, radii, shape="square")  # type: ignore[arg-type]
    with pytest.raises(bottega.SceneError, match="Mesh or"):
        scene.meshes["strands"] = points  # type: ignore[assignment]
