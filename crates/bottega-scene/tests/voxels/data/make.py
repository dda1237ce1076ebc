"""Writes fire.vdb and kinds.vdb: `python make.py FOLDER`, with the module `openvdb` of Blender 5."""

import sys

import numpy as np
import openvdb

RADIUS = 8
x, y, z = np.mgrid[-RADIUS : RADIUS + 1, -RADIUS : RADIUS + 1, -RADIUS : RADIUS + 1].astype(np.float32)
r = np.sqrt(x * x + y * y + z * z)


def fog(name, values, half=False, voxel=0.1):
    """A grid around voxel (8, 8, 8); index space begins at (1, 2, 3)."""
    grid = openvdb.FloatGrid(0.0)
    grid.copyFromArray(values.astype(np.float32), ijk=(0, 0, 0), tolerance=0)
    grid.name, grid.saveFloatAsHalf, grid.gridClass = name, half, "fog volume"
    grid.transform = openvdb.createLinearTransform(voxel)
    grid.transform.postTranslate((1, 2, 3))
    return grid


folder = sys.argv[1]
# Eighths are exact in half precision.
density = np.maximum(np.floor(8 * (1 - r / 8.5)) / 8, 0)
fire = [
    fog("density", density),
    fog("temperature", np.maximum(3000 * (1 - r / 8), 0)),
    fog("half", density, half=True),
    fog("coarse", np.where(r < 4, 2000.0, 0), voxel=0.2),
]
openvdb.write(f"{folder}/fire.vdb", fire)

block = openvdb.FloatGrid(0.0)
block.name = "density"
block.fill((0, 0, 0), (255, 127, 127), 2.0)
block.transform = openvdb.createLinearTransform([[0.01, 0, 0, 0], [0, 0.02, 0, 0], [0, 0, 0.04, 0], [5, 0, 0, 1]])
color = openvdb.Vec3SGrid((0, 0, 0))
color.name = "color"
values = np.zeros((4, 4, 4, 3), np.float32)
values[1, 2, 3] = (1, 2, 3)
color.copyFromArray(values)
level_set = openvdb.createLevelSetSphere(radius=0.6, center=(1, 1, 1), voxelSize=0.1, halfWidth=2.0)
level_set.name = "surface"
mask = openvdb.BoolGrid()
mask.name = "mask"
mask.fill((0, 0, 0), (3, 3, 3), True)
openvdb.write(f"{folder}/kinds.vdb", [block, color, level_set, mask])
