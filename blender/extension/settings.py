# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of a scene and of a view layer. No secret is kept in the .blend file."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty


class BottegaSceneSettings(bpy.types.PropertyGroup):
    """Settings of a scene: `scene.bottega`."""

    goal: EnumProperty(
        name="Finish at",
        items=[
            ("ERROR", "Noise", "Stop where the estimated relative error is small enough"),
            ("SAMPLES", "Samples", "Take the same number of samples everywhere"),
            ("TIME", "Time", "Use a given time, from the start to the picture"),
        ],
        default="SAMPLES",
    )
    error: FloatProperty(name="Noise", description="Relative error at which a part of the picture is finished", default=0.05, min=0.002, max=1.0, precision=3)
    samples: IntProperty(name="Samples", description="Samples per pixel; with noise or time at most so many", default=128, min=1, max=65536)
    seconds: FloatProperty(name="Time", description="Seconds", default=60.0, min=1.0, soft_max=3600.0, subtype="TIME_ABSOLUTE")
    view_samples: IntProperty(name="Viewport Samples", description="Samples per pixel after which the viewport rests", default=256, min=1, max=65536)
    max_depth: IntProperty(name="Bounces", description="Maximum number of bounces", default=12, min=0, max=1024)
    denoise: BoolProperty(name="Denoise", description="Denoise the picture with Open Image Denoise, if it is installed", default=False)
    view_denoise: BoolProperty(name="Denoise Viewport", default=False)
    guide: EnumProperty(
        name="Guiding",
        items=[
            ("AUTO", "Automatic", "Learn where the light comes from"),
            ("OFF", "Off", "Plain paths"),
        ],
        default="AUTO",
    )
    threads: IntProperty(name="Threads", description="Processors to use; 0: all", default=0, min=0, max=1024)
    seed: IntProperty(name="Seed", description="Another seed has other noise", default=0, min=0)
    optimization: EnumProperty(
        name="Optimization",
        description="Expert rules lower the quality of parts that are hardly looked at, to save time",
        items=[
            ("OFF", "Off", "The same quality everywhere"),
            ("VS", "Very Small", "Hardly visible"),
            ("S", "Small", "Little is lost"),
            ("N", "Normal", "Less light and fewer reflections in unimportant parts"),
            ("B", "Big", "For tests"),
            ("VB", "Very Big", "For the fastest look"),
        ],
        default="OFF",
    )
    priority: IntProperty(name="Priority", description="Jobs of a farm get machines in proportion to their priority", default=10, min=1, max=1000)
    use_farm: BoolProperty(name="Render on the Farm", description="F12 renders with all machines of the farm, this one among them", default=False)
    view_farm: BoolProperty(name="Viewport on the Farm", description="Free machines of the farm render samples of the viewport, too", default=False)
    use_albedo: BoolProperty(name="Albedo", description="The color of surfaces, as a pass", default=False)
    use_sample_count: BoolProperty(name="Samples", description="The number of samples per pixel, as a pass", default=False)
    use_shadow_catcher: BoolProperty(
        name="Shadow Catcher", description="The share of their light that shadow catchers keep, as a pass", default=False
    )
    use_cost: BoolProperty(name="Cost", description="The time per pixel, as a pass", default=False)


def register() -> None:
    bpy.utils.register_class(BottegaSceneSettings)
    bpy.types.Scene.bottega = PointerProperty(type=BottegaSceneSettings)


def unregister() -> None:
    del bpy.types.Scene.bottega
    bpy.utils.unregister_class(BottegaSceneSettings)
