"""Writes the grids of `smoke.xml`, `smoke.pbrt` and `colored-smoke.xml`: blobs of cosines, with a rim of zeros, so that
it makes no difference what a renderer takes to be beyond the rim."""

import math
import struct


def cells(size, value):
    for z in range(size[2]):
        for y in range(size[1]):
            for x in range(size[0]):
                at = [i / (n - 1) for i, n in zip((x, y, z), size)]
                yield [0.0] if min(at) == 0 or max(at) == 1 else value(*at)


def density(x, y, z):
    wave = math.cos(9 * x + 2 * y) * math.cos(7 * z - 3 * x) * math.cos(8 * y)
    bell = 16 * x * (1 - x) * z * (1 - z)
    return [round(max(0.0, 6 * bell * (wave + 0.25)), 4)]


def colored_density(x, y, z):
    return [round(density(x, y, z)[0] * (0.2 + channel), 4) for channel in (x, y, z)]


def albedo(x, y, z):
    return [round(0.95 - 0.5 * abs(math.sin(5 * t)), 4) for t in (x + y, y - z, z + x)]


def write(name, size, channels, value):
    numbers = [number for cell in cells(size, value) for number in (cell * channels if len(cell) == 1 else cell)]
    with open(name, "wb") as file:
        file.write(b"VOL\x03" + struct.pack("<5i6f", 1, *size, channels, 0, 0, 0, 1, 1, 1))
        file.write(struct.pack(f"<{len(numbers)}f", *numbers))
    return numbers


SIZE = (12, 18, 10)
smoke = write("smoke.vol", SIZE, 1, density)
write("colored-smoke.vol", SIZE, 3, colored_density)
write("colored-albedo.vol", (9, 7, 8), 3, albedo)
with open("smoke-density.pbrt", "w") as file:
    file.write(f'MakeNamedMedium "smoke" "string type" "uniformgrid" "float g" 0.4 "float scale" 2\n')
    file.write('    "rgb sigma_a" [ 0.25 0.25 0.25 ] "rgb sigma_s" [ 0.75 0.75 0.75 ]\n')
    file.write('    "integer nx" %d "integer ny" %d "integer nz" %d\n    "float density" [\n' % SIZE)
    for i in range(0, len(smoke), SIZE[0]):
        file.write("        " + " ".join(f"{number:g}" for number in smoke[i : i + SIZE[0]]) + "\n")
    file.write("    ]\n")
