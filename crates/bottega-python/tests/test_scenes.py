"""Scenes of arrays, and arrays that are none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import bottega
from bottega import Material, Scene, SceneError

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
FACES = np.array([[0, 1, 2]], np.uint32)
MATTE = Material.matte()


def test_a_scene_of_arrays_is_painted(pyramid: Scene) -> None:
    assert "8 triangles" in repr(pyramid)
    picture = bottega.render(pyramid, spp=8, size=(48, 32), exact=True, layers=["albedo"])
    assert picture.color.mean() > 0.02
    # The pyramid is in the middle, in its own color; the floor is gray.
    red, green, blue = picture["albedo"][14, 24]
    assert red > 2 * green > 2 * blue
    again = bottega.render(pyramid, spp=8, size=(48, 32), exact=True, layers=["albedo"])
    assert (picture.values.view(np.uint32) == again.values.view(np.uint32)).all()


def painted(vertices: Any, faces: Any, **more: Any) -> Any:
    scene = Scene()
    scene.mesh(vertices, faces, MATTE, **more)
    scene.environment((1, 1, 1))
    scene.camera((0.3, 0.3, 3), (0.3, 0.3, 0))
    return bottega.render(scene, spp=2, size=(16, 16), exact=True).color


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        (CORNERS.astype(np.float64), FACES.astype(np.int64)),
        (np.asfortranarray(CORNERS), FACES.astype(np.uint8)),
        (np.repeat(CORNERS, 2, axis=0)[::2], FACES),
        (np.hstack([CORNERS, CORNERS])[:, :3], np.vstack([FACES, FACES])[::2]),
        (CORNERS.tolist(), FACES.tolist()),
        (CORNERS.astype(">f4"), FACES),
    ],
)
def test_arrays_of_other_layout_are_the_same_scene(vertices: Any, faces: Any) -> None:
    assert (painted(vertices, faces) == painted(CORNERS, FACES)).all()


def test_instances_and_transformations() -> None:
    moved = np.eye(4)
    moved[0, 3] = 10
    assert (painted(CORNERS, FACES, transform=moved) != painted(CORNERS, FACES)).any()
    back = CORNERS - [10, 0, 0]
    assert np.allclose(painted(back, FACES, transform=moved), painted(CORNERS, FACES), atol=1e-3)
    scene = Scene()
    assert scene.mesh(CORNERS, FACES, MATTE) == 0 and scene.mesh(CORNERS, FACES, MATTE) == 1
    scene.instance(1, moved)
    with pytest.raises(SceneError, match="no mesh 2"):
        scene.instance(2, moved)


def with_bad_row(row: Any) -> Any:
    vertices = CORNERS.copy()
    vertices[1] = row
    return vertices


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"vertices": CORNERS[:, :2]}, r"`vertices`: its shape is \[3, 2\]: \(N, 3\)"),
        ({"vertices": CORNERS.ravel()}, r"its shape is \[9\]"),
        ({"vertices": CORNERS.astype(complex)}, "`vertices`: its dtype is complex128: real numbers"),
        ({"vertices": [["a", "b", "c"]]}, "`vertices`: its dtype is <U1"),
        ({"vertices": with_bad_row(np.nan)}, r"`vertices`: row 1 is \[NaN"),
        ({"vertices": with_bad_row(np.inf)}, "finite"),
        ({"vertices": with_bad_row(1).astype(np.float64) * 1e300}, "finite"),
        ({"vertices": np.zeros((0, 3))}, "there are none"),
        ({"triangles": [[0, 1, 3]]}, r"`triangles`: row 0 is .*there are vertices 0 to 2"),
        ({"triangles": [[0, 1, -1]]}, "vertices 0 to 2"),
        ({"triangles": FACES.astype(np.float32)}, "`triangles`: its dtype is float32: whole numbers"),
        ({"triangles": [[0, 1]]}, r"\(N, 3\)"),
        ({"normals": CORNERS[:2]}, "`normals`: it has 2 rows, and there are 3 vertices"),
        ({"normals": np.zeros((3, 3))}, "`normals`: it has no length"),
        ({"uvs": CORNERS}, r"`uvs`: .*\(N, 2\)"),
        ({"colors": CORNERS}, r"`colors`: .*\(N, 4\)"),
        ({"transform": np.eye(3)}, r"`transform`: .*\(N, 4\)"),
        ({"transform": np.zeros((4, 4))}, "`transform`: its last row"),
        ({"transform": np.diag([-1.0, 1, 1, 1])}, "mirrors"),
    ],
)
def test_arrays_that_are_none_are_refused(arguments: dict[str, Any], said: str) -> None:
    whole = {"vertices": CORNERS, "triangles": FACES, **arguments}
    with pytest.raises(SceneError, match=said):
        Scene().mesh(material=MATTE, **whole)


def test_values_that_cannot_be_are_refused() -> None:
    scene = Scene()
    for wrong in (
        lambda: scene.sphere((0, 0, 0), 0, MATTE),
        lambda: scene.sphere((0, float("nan"), 0), 1, MATTE),
        lambda: scene.camera((0, 0, 0), (0, 0, 0)),
        lambda: scene.camera((0, 0, 0), (0, 1, 0)),
        lambda: scene.camera((0, 0, 0), (0, 0, 1), fov=180),
        lambda: scene.point_light((0, 0, 0), (-1, 0, 0)),
        lambda: scene.sun((0, 0, 0), (1, 1, 1)),
        lambda: Material.matte((0, 0, float("inf"))),
        lambda: Material.layered(roughness=2),
        lambda: Material.layered(ior=0.5),
    ):
        with pytest.raises(SceneError):
            wrong()
    with pytest.raises(TypeError):
        scene.mesh(CORNERS, FACES, "matte")  # type: ignore[arg-type]
    with pytest.raises(bottega.Error, match="no camera"):
        bottega.render(Scene())
    with pytest.raises((bottega.Error, ValueError)):
        bottega.render(Scene(), engine={"names": ["povray"]})
