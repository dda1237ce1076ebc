"""Bottega: a physically based renderer; agents share out the work of a picture.

>>> import bottega
>>> picture = bottega.render("scene.glb", spp=64, size=(640, 480))
>>> picture.color.shape
(480, 640, 3)
>>> picture.save("picture.png")
"""

from __future__ import annotations

import atexit

from . import rules
from ._api import Progress, Session, analyze, diff, render
from ._errors import (
    EngineError,
    Error,
    FarmError,
    ForkError,
    Interrupted,
    PictureError,
    RenderWarning,
    RequestError,
    RulesError,
    SceneError,
)
from ._farm import Farm, FarmSession, FoundFarm, Job, JobView, MachineView, farms
from ._lights import (
    AreaLight,
    Camera,
    Environment,
    GoniometricLight,
    Lenses,
    Light,
    PointLight,
    ProjectorLight,
    Sphere,
    SpotLight,
    SunLight,
)
from ._materials import BumpMap, Material, Medium, NormalMap
from ._native import Analysis, ImageFile, Picture, Voxels, __version__, read, stop_all
from ._requests import (
    DeviceOptions,
    EngineOptions,
    EnvironmentOptions,
    FarmOptions,
    FilmOptions,
    FrameOptions,
    GoalOptions,
    GuideOptions,
    IntegratorOptions,
    LightingAgentOptions,
    OutputOptions,
    PhotonOptions,
    Request,
    SceneOptions,
    ViewOptions,
    WorkOptions,
)
from ._scene import Curves, Image, Mesh, Object, Scene
from ._surfaces import (
    Anisotropy,
    Blend,
    Coated,
    Conductor,
    Dielectric,
    Diffuse,
    DiffuseTransmission,
    Hair,
    Iridescence,
    Layered,
    Null,
    Plastic,
    Principled,
    Subsurface,
    Sum,
    Surface,
    Transparent,
    Unlit,
)
from ._values import Texture, Visibility
from ._viewport import Frame, Viewport, ViewportMachine

__all__ = [
    "Analysis",
    "Anisotropy",
    "AreaLight",
    "Blend",
    "BumpMap",
    "Camera",
    "Coated",
    "Conductor",
    "DeviceOptions",
    "Curves",
    "Dielectric",
    "Diffuse",
    "DiffuseTransmission",
    "EngineError",
    "EngineOptions",
    "Environment",
    "EnvironmentOptions",
    "Error",
    "Farm",
    "FarmError",
    "FarmOptions",
    "FarmSession",
    "FilmOptions",
    "ForkError",
    "FoundFarm",
    "Frame",
    "FrameOptions",
    "GoalOptions",
    "GoniometricLight",
    "GuideOptions",
    "Hair",
    "Image",
    "ImageFile",
    "IntegratorOptions",
    "Interrupted",
    "Iridescence",
    "Job",
    "JobView",
    "Layered",
    "Lenses",
    "Light",
    "LightingAgentOptions",
    "MachineView",
    "Material",
    "Medium",
    "Mesh",
    "NormalMap",
    "Null",
    "Object",
    "OutputOptions",
    "PhotonOptions",
    "Picture",
    "PictureError",
    "Plastic",
    "PointLight",
    "Principled",
    "Progress",
    "ProjectorLight",
    "RenderWarning",
    "Request",
    "RequestError",
    "RulesError",
    "Scene",
    "SceneError",
    "SceneOptions",
    "Session",
    "Sphere",
    "SpotLight",
    "Subsurface",
    "Sum",
    "SunLight",
    "Surface",
    "Texture",
    "Transparent",
    "Unlit",
    "ViewOptions",
    "Viewport",
    "Voxels",
    "ViewportMachine",
    "Visibility",
    "WorkOptions",
    "__version__",
    "analyze",
    "diff",
    "farms",
    "read",
    "render",
    "rules",
]

# Stop rendering at the end of the interpreter: Python threads that wait for a picture are otherwise cut off.
atexit.register(stop_all)
