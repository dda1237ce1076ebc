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
from ._farm import Farm, Job
from ._native import Analysis, ImageFile, Material, Picture, Scene, __version__, read, stop_all
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

__all__ = [
    "Analysis",
    "DeviceOptions",
    "EngineError",
    "EngineOptions",
    "EnvironmentOptions",
    "Error",
    "Farm",
    "FarmError",
    "FarmOptions",
    "FilmOptions",
    "ForkError",
    "FrameOptions",
    "GoalOptions",
    "GuideOptions",
    "ImageFile",
    "IntegratorOptions",
    "Interrupted",
    "Job",
    "LightingAgentOptions",
    "Material",
    "OutputOptions",
    "PhotonOptions",
    "Picture",
    "PictureError",
    "Progress",
    "RenderWarning",
    "Request",
    "RequestError",
    "RulesError",
    "Scene",
    "SceneError",
    "SceneOptions",
    "Session",
    "ViewOptions",
    "WorkOptions",
    "__version__",
    "analyze",
    "diff",
    "read",
    "render",
    "rules",
]

# Stop rendering at the end of the interpreter: Python threads that wait for a picture are otherwise cut off.
atexit.register(stop_all)
