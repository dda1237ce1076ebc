"""Writes copper.bsdf, brushed.bsdf and velvet.bsdf, and values.txt, in which Mitsuba evaluates them: `python make.py FOLDER`,
with NumPy and Mitsuba 3.9. copper.bsdf is scenes/models/measured.bsdf.

All are tabulated from formulas: GGX facets (Walter and others 2007, Smith's height-correlated shadowing) with Schlick's
reflectance.
"""

import struct
import sys

import numpy as np

KINDS = {np.dtype(np.uint8): 1, np.dtype(np.float32): 10}


def write(path, fields):
    """Writes a tensor file."""
    head = b"tensor_file\0" + bytes([1, 0]) + struct.pack("<I", len(fields))
    size = len(head) + sum(2 + len(name) + 2 + 1 + 8 + 8 * values.ndim for name, values in fields.items())
    body = b""
    for name, values in fields.items():
        head += struct.pack("<H", len(name)) + name.encode() + struct.pack("<HBQ", values.ndim, KINDS[values.dtype], size + len(body))
        head += struct.pack(f"<{values.ndim}Q", *values.shape)
        body += values.tobytes()
    with open(path, "wb") as file:
        file.write(head + body)


def direction(theta, phi):
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def grid(rows, columns):
    """Directions at the points of a table, by row and column."""
    v, u = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
    return u, v, direction(u * u * np.pi / 2, (2 * v - 1) * np.pi)


class Facets:
    """GGX facets that are stretched along an axis."""

    def __init__(self, along, across, turn=0.0):
        self.alpha, self.axes = (along, across), (np.cos(turn), np.sin(turn))

    def local(self, w):
        cos, sin = self.axes
        return (cos * w[..., 0] + sin * w[..., 1], cos * w[..., 1] - sin * w[..., 0], w[..., 2])

    def density(self, m):
        x, y, z = self.local(m)
        a, b = self.alpha
        return 1 / (np.pi * a * b * ((x / a) ** 2 + (y / b) ** 2 + z * z) ** 2)

    def scaled(self, w):
        """cos θ · (1 + 2 Λ), which is finite at the horizon."""
        x, y, z = self.local(w)
        a, b = self.alpha
        return np.sqrt((a * x) ** 2 + (b * y) ** 2 + z * z)

    def area(self, w):
        """The area of the facets as seen from w: cos θ · (1 + Λ)."""
        return 0.5 * (self.scaled(w) + np.abs(w[..., 2]))

    def shadowing(self, o, i):
        """Share of the facets visible from o that are lit from i."""
        lit = o[..., 2] * i[..., 2]
        both = 0.5 * (o[..., 2] * self.scaled(i) + i[..., 2] * self.scaled(o))
        return np.where(i[..., 2] > 0, self.area(o) * i[..., 2] / np.where(both > 0, both, 1) * (lit >= 0), 0)


def warped(density, u, v):
    """Points of the square that even points become, by the marginal and conditional method."""
    rows, columns = density.shape

    def solve(first, last, whole):
        t = 2 * whole / np.maximum(first + np.sqrt(np.maximum(first**2 + 2 * whole * (last - first), 0)), 1e-300)
        return np.clip(t, 0, 1)

    in_rows = np.zeros_like(density)
    in_rows[:, 1:] = np.cumsum(0.5 * (density[:, 1:] + density[:, :-1]), axis=1)
    below = np.concatenate([[0], np.cumsum(0.5 * (in_rows[1:, -1] + in_rows[:-1, -1]))])
    out = np.zeros(u.shape + (2,))
    for at in np.ndindex(u.shape):
        y = v[at] * below[-1]
        row = min(max(np.searchsorted(below, y, "right") - 1, 0), rows - 2)
        up = solve(in_rows[row, -1], in_rows[row + 1, -1], y - below[row])
        before = (1 - up) * in_rows[row] + up * in_rows[row + 1]
        x = u[at] * before[-1]
        column = min(max(np.searchsorted(before, x, "right") - 1, 0), columns - 2)
        sides = (1 - up) * density[row] + up * density[row + 1]
        along = solve(sides[column], sides[column + 1], x - before[column])
        out[at] = ((column + along) / (columns - 1), (row + up) / (rows - 1))
    return out


def material(path, facets, phis, thetas, size, visible_size, table_size, f0, names, wavelengths=None, relative=True):
    """Writes a material. `f0`: reflectance at normal incidence of each channel; `names`: that of the channels' field."""
    isotropic = len(phis) == 1
    visible, luminance, spectra = [], [], []
    for phi in phis:
        for theta in thetas:
            o = direction(np.float64(theta), np.float64(phi))
            u, v, m = grid(visible_size, visible_size)
            if isotropic:
                m = direction(u * u * np.pi / 2, (2 * v - 1) * np.pi + phi)
            sin = np.sqrt(m[..., 0] ** 2 + m[..., 1] ** 2)
            density = np.maximum(m @ o, 0) * facets.density(m) * u * sin
            visible.append(density)
            u, v = np.meshgrid(np.linspace(0, 1, size), np.linspace(0, 1, size), indexing="xy")
            at = warped(density, u, v)
            m = direction(at[..., 0] ** 2 * np.pi / 2, (2 * at[..., 1] - 1) * np.pi + (phi if isotropic else 0))
            cos = np.maximum(m @ o, 0)
            i = 2 * cos[..., None] * m - o
            relation = facets.shadowing(o, i)
            if not relative:
                relation = relation * facets.density(m) / (4 * facets.area(o))
            schlick = [(f + (1 - f) * (1 - cos) ** 5) * relation for f in f0]
            luminance.append(np.mean(schlick, axis=0) + 0.01)
            spectra.append(schlick)

    def shaped(values, *axes):
        return np.array(values, dtype=np.float32).reshape(len(phis), len(thetas), *axes)

    rows = 2 if isotropic else table_size
    fields = {
        "description": np.frombuffer(b"Tabulated from formulas by make.py", dtype=np.uint8),
        "phi_i": np.array(phis, dtype=np.float32),
        "theta_i": np.array(thetas, dtype=np.float32),
        "ndf": facets.density(grid(rows, table_size)[2]).astype(np.float32),
        "sigma": facets.area(grid(rows, table_size)[2]).astype(np.float32),
        "vndf": shaped(visible, visible_size, visible_size),
        "luminance": shaped(luminance, size, size),
        names: shaped(spectra, len(f0), size, size),
        "jacobian": np.array([relative], dtype=np.uint8),
    }
    if wavelengths is not None:
        fields["wavelengths"] = np.array(wavelengths, dtype=np.float32)
    write(path, fields)


def directions(count):
    """Pairs of directions: even ones, and ones near to the mirror image."""
    random = np.random.default_rng(7)
    o = direction(np.arccos(1 - 0.98 * random.random(count)), 2 * np.pi * random.random(count))
    i = direction(np.arccos(1 - 0.98 * random.random(count)), 2 * np.pi * random.random(count))
    near = o * (-1, -1, 1) + 0.3 * (random.random((count, 3)) - 0.5)
    near /= np.linalg.norm(near, axis=1)[:, None]
    is_near = (np.arange(count) % 3 > 0) & (near[:, 2] > 0.02)
    return o, np.where(is_near[:, None], near, i)


def evaluate(mi, path, o, i):
    """Values without the cosine as linear Rec. 709, and densities, by Mitsuba."""
    bsdf, context = mi.load_dict({"type": "measured", "filename": path}), mi.BSDFContext()
    si = mi.SurfaceInteraction3f()
    values, densities = np.zeros_like(o), np.zeros(len(o))
    if "spectral" in mi.variant():
        nm = np.arange(360, 832).reshape(-1, 4)
        white = mi.load_dict({"type": "d65"})
        light = np.zeros(nm.shape)
        for row, wavelengths in enumerate(nm):
            si.wavelengths = wavelengths.tolist()
            light[row] = np.array(white.eval(si))
        seen = np.array([np.array(mi.cie1931_xyz(float(at))) for at in nm.ravel()]).reshape(-1, 4, 3) * light[..., None]
        rgb = np.array([[3.240479, -1.537150, -0.498535], [-0.969256, 1.875991, 0.041556], [0.055648, -0.204043, 1.057311]])
        weights = (seen @ rgb.T / seen[..., 1].sum()).reshape(-1, 3)
    for row in range(len(o)):
        si.wi, wi = o[row].tolist(), i[row].tolist()
        if "spectral" in mi.variant():
            spectrum = []
            for wavelengths in nm:
                si.wavelengths = wavelengths.tolist()
                spectrum.append(np.array(bsdf.eval(context, si, wi)))
            values[row] = np.concatenate(spectrum) @ weights
        else:
            values[row] = np.array(bsdf.eval(context, si, wi))
        densities[row] = bsdf.pdf(context, si, wi)
    return values / i[:, 2:], densities


def main(folder):
    angles = [0.0, 0.5, 1.0, 1.3, 1.5]
    copper = (0.95, 0.64, 0.54)
    material(f"{folder}/copper.bsdf", Facets(0.3, 0.3), [0.0], angles, 8, 16, 32, copper, "rgb")
    wavelengths, blue = (380, 470, 550, 630, 720), (0.6, 0.7, 0.5, 0.4, 0.45)
    half = np.linspace(-np.pi, 0, 4)
    material(f"{folder}/brushed.bsdf", Facets(0.5, 0.25, 0.6), half, angles[:4], 7, 11, 16, blue, "spectra", wavelengths)
    quarter = np.linspace(-np.pi, -np.pi / 2, 3)
    velvet = (0.5, 0.05, 0.1)
    material(f"{folder}/velvet.bsdf", Facets(0.6, 0.9), quarter, [0.1, 0.8, 1.4], 5, 9, 8, velvet, "rgb", relative=False)
    import mitsuba as mi

    o, i = directions(COUNT)
    with open(f"{folder}/values.txt", "w") as out:
        print("# By Mitsuba", mi.__version__, "file, wo, wi, f as linear Rec. 709, density of wi", file=out)
        for name, variant in [("copper", "scalar_rgb"), ("brushed", "scalar_spectral"), ("velvet", "scalar_rgb")]:
            mi.set_variant(variant)
            values, pdf = evaluate(mi, f"{folder}/{name}.bsdf", o, i)
            for row in range(COUNT):
                numbers = [*o[row], *i[row], *values[row], pdf[row]]
                print(name, *(f"{number:.7g}" for number in numbers), file=out)


COUNT = int(sys.argv[2]) if len(sys.argv) > 2 else 36
main(sys.argv[1])
