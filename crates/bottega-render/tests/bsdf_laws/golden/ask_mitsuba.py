"""Asks Mitsuba 3 (pip install mitsuba) for values of its materials; `mitsuba.rs` compares ours with them.

    python ask_mitsuba.py > mitsuba.json

Each row: wo (towards the viewer), wi (towards the light), and f |cos| by channel, in the frame whose +z is the front.
"""

import json
import math
import random

import mitsuba as mi

mi.set_variant("scalar_rgb")

RGB = lambda r, g, b: {"type": "rgb", "value": [r, g, b]}
GOLD = {"eta": RGB(0.143, 0.375, 1.442), "k": RGB(3.983, 2.386, 1.603)}
SOME = {"base_color": RGB(0.7, 0.3, 0.1), "roughness": 0.4}

MATERIALS = {
    "diffuse": {"type": "diffuse", "reflectance": RGB(0.7, 0.3, 0.1)},
    "conductor_ggx": {"type": "roughconductor", "alpha": 0.3, "distribution": "ggx", **GOLD},
    "conductor_ggx_stretched": {
        "type": "roughconductor", "alpha_u": 0.1, "alpha_v": 0.5, "distribution": "ggx",
        "specular_reflectance": RGB(0.9, 0.8, 0.5), **GOLD,
    },
    "conductor_beckmann": {"type": "roughconductor", "alpha": 0.2, "distribution": "beckmann", **GOLD},
    "conductor_beckmann_stretched": {
        "type": "roughconductor", "alpha_u": 0.4, "alpha_v": 0.15, "distribution": "beckmann", **GOLD,
    },
    "mirror_rough": {"type": "roughconductor", "alpha": 0.5, "distribution": "ggx", "material": "none"},
    "dielectric_ggx": {"type": "roughdielectric", "alpha": 0.3, "distribution": "ggx", "int_ior": 1.5, "ext_ior": 1.0},
    "dielectric_beckmann": {
        "type": "roughdielectric", "alpha": 0.4, "distribution": "beckmann", "int_ior": 1.8, "ext_ior": 1.0,
        "specular_reflectance": RGB(0.9, 0.5, 0.2), "specular_transmittance": RGB(0.3, 0.6, 0.9),
    },
    "dielectric_stretched": {
        "type": "roughdielectric", "alpha_u": 0.5, "alpha_v": 0.2, "distribution": "ggx",
        "int_ior": 1.0, "ext_ior": 1.33,
    },
    "plastic": {"type": "plastic", "diffuse_reflectance": RGB(0.7, 0.3, 0.1), "int_ior": 1.49, "ext_ior": 1.0},
    "plastic_nonlinear": {
        "type": "plastic", "diffuse_reflectance": RGB(0.7, 0.3, 0.1), "int_ior": 1.9, "ext_ior": 1.0, "nonlinear": True,
    },
    "roughplastic_beckmann": {
        "type": "roughplastic", "diffuse_reflectance": RGB(0.7, 0.3, 0.1), "int_ior": 1.49, "ext_ior": 1.0,
        "alpha": 0.1, "distribution": "beckmann",
    },
    "roughplastic_ggx": {
        "type": "roughplastic", "diffuse_reflectance": RGB(0.9, 0.5, 0.1), "int_ior": 1.7, "ext_ior": 1.0,
        "alpha": 0.35, "distribution": "ggx", "nonlinear": True, "specular_reflectance": RGB(0.5, 0.7, 0.9),
    },
    "pplastic": {
        "type": "pplastic", "diffuse_reflectance": RGB(0.7, 0.3, 0.1), "int_ior": 1.49, "ext_ior": 1.0, "alpha": 0.1,
    },
    "pplastic_stretched": {
        "type": "pplastic", "diffuse_reflectance": RGB(0.9, 0.5, 0.1), "int_ior": 1.7, "ext_ior": 1.0,
        "alpha_u": 0.4, "alpha_v": 0.2, "distribution": "ggx", "specular_reflectance": RGB(0.5, 0.7, 0.9),
    },
    "principled": {"type": "principled", **SOME},
    "principled_metal": {
        "type": "principled", **SOME, "metallic": 0.8, "anisotropic": 0.7, "specular": 0.6, "spec_tint": 0.4,
    },
    "principled_cloth": {
        "type": "principled", **SOME, "sheen": 0.8, "sheen_tint": 0.5, "flatness": 0.6, "clearcoat": 0.9,
        "clearcoat_gloss": 0.3, "eta": 1.4,
    },
    "principled_glass": {
        "type": "principled", **SOME, "spec_trans": 0.7, "eta": 1.5, "metallic": 0.1, "spec_tint": 0.3,
        "anisotropic": 0.3,
    },
    "principledthin": {
        "type": "principledthin", **SOME, "spec_trans": 0.6, "diff_trans": 0.7, "eta": 1.33, "spec_tint": 0.3,
        "anisotropic": 0.5, "sheen": 0.5, "sheen_tint": 0.6, "flatness": 0.4,
    },
}


def direction(rng, lower=False):
    z = 0.05 + 0.95 * rng.random()
    if lower and rng.random() < 0.5:
        z = -z
    phi = 2 * math.pi * rng.random()
    r = math.sqrt(max(0.0, 1 - z * z))
    return [r * math.cos(phi), r * math.sin(phi), z]


def near(rng, w, spread=0.25):
    v = [x + spread * (2 * rng.random() - 1) for x in w]
    n = math.sqrt(sum(x * x for x in v))
    return [x / n for x in v]


def refracted(w, eta):
    """w bent at the plane z = 0, by the index above it over that below."""
    eta = eta if w[2] > 0 else 1 / eta
    k = 1 - eta * eta * (1 - w[2] * w[2])
    if k <= 0.01:
        return [-w[0], -w[1], w[2]]
    return [-eta * w[0], -eta * w[1], -math.copysign(math.sqrt(k), w[2])]


def rows(name, material):
    rng = random.Random(name)
    bsdf = mi.load_dict(material)
    transmits = "dielectric" in name or "glass" in name or "thin" in name
    context = mi.BSDFContext()
    table = []
    while len(table) < 40:
        wo = direction(rng, transmits)
        kind = rng.randrange(3)
        if kind == 0:
            wi = direction(rng, transmits)
        elif kind == 1 or not transmits:
            wi = near(rng, [-wo[0], -wo[1], wo[2]])
        elif "thin" in name:
            wi = near(rng, [-x for x in wo])
        else:
            wi = near(rng, refracted(wo, 1 / material.get("eta", material.get("int_ior", 1.5) / material.get("ext_ior", 1.0))), 0.1)
        if abs(wi[2]) < 0.02:
            continue
        si = mi.SurfaceInteraction3f()
        si.wi = mi.Vector3f(wo)
        si.sh_frame = mi.Frame3f([1, 0, 0], [0, 1, 0], [0, 0, 1])
        si.n = [0, 0, 1]
        value = bsdf.eval(context, si, mi.Vector3f(wi))
        table.append([float(f"{x:.7g}") for x in [*wo, *wi, *value]])
    return table


print("{")
names = list(MATERIALS)
for name in names:
    lines = ",\n  ".join(json.dumps(row) for row in rows(name, MATERIALS[name]))
    print(f' "{name}": [\n  {lines}\n ]{"," if name != names[-1] else ""}')
print("}")
