"""Requests as typed values. Made by `cargo xtask python-stubs` from the JSON Schema of requests; do not edit."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Mapping, Sequence, TypedDict, Union

from ._sections import BaseRequest, Section

if TYPE_CHECKING:
    from typing_extensions import Unpack


AdaptationChoice = Literal["ratio", "paper"]
"""How agents learn their speed. ratio: By the median of the last ratios of own to reference time: the
default. paper: By equation (1) of the MAGarRO paper, as printed.
"""


AuctionChoice = Literal["finishing-time", "promised", "paper", "stealing"]
"""How the winners of an auction are found. finishing-time: An agent gets the largest zone that it
finishes before the whole is expected to end, its promises weighed by how far they held before: the
default. promised: The same, but each agent is taken at its word: what it promised before, and what
came of it, counts for nothing. paper: The most complex zone goes to the bidder with the most
credit, as in the MAGarRO paper. stealing: No auction: zones are dealt out at once, each to the
agent that would finish it soonest, and agents take from each other what waits.
"""


BalanceChoice = Literal["time", "ratio"]
"""What zones of level 3 have in common. time: The expected time, so that none is waited for: the
default. ratio: The complexity/size ratio, as the MAGarRO paper says.
"""


class BandChoicePixels(TypedDict):
    """So many pixels beyond each edge of each zone."""

    pixels: int


BandChoice = Union[Literal["off", "rules"], BandChoicePixels]
"""The width of the bands in which neighboring zones are blended. With optimization off there are none:
zones agree to the last bit. off: There are none: zones meet at an edge. rules: The expert rules say
it, edge by edge.
"""


class EnvironmentLightFile(TypedDict):
    """A picture of the whole sphere: .hdr, .exr or .png."""

    file: str


class EnvironmentLightRadiance(TypedDict):
    """The same radiance from everywhere: red, green and blue."""

    radiance: tuple[float, float, float]


EnvironmentLight = Union[Literal["sky"], EnvironmentLightFile, EnvironmentLightRadiance]
"""The light from all around. sky: The neutral sky that a scene without any light gets by itself."""


Frames = str
"""Frames of an animation, in the order in which they are painted; none twice. Written as a list of
numbers and ranges, such as `1..24`, `1..9:2` (1, 3, 5, 7, 9), `9..1:-2`, `-5..5` or `1,4,7..9`.
Both ends of a range are part of it. A frame that is named twice is painted where it is named first,
so `1..100:10,1..100` paints every tenth frame before the others.
"""


GuideChoice = Literal["none", "directions", "ala"]
"""What paths learn of the light before the first sample. none: Nothing: paths go where materials send
them. directions: Where light comes from. ala: All that lighting agents can tell: as well which
lights matter, whether they are seen, and what a path is worth. The default.
"""


GuideUse = Literal["shadows", "lights", "directions", "roulette"]
"""What paths use lighting agents for. shadows: Shadow rays only where it is not known well enough
whether a light is seen. lights: Lights are chosen by what comes of them. directions: Paths go where
light was found to come from. roulette: Paths end, or go on as several, by what they are worth.
"""


ImportanceChoice = Literal["predicted", "paper", "visual"]
"""Which measure makes the importance map. predicted: Predicted cost, from what a small path-traced
look at the scene took. paper: Levels of recursion in mirrors and glass, as in the MAGarRO paper.
visual: How much an error would be seen.
"""


IntegratorChoice = Literal["path", "photon", "ala"]
"""How light is followed. path: Path tracing: no error but noise. photon: Photon mapping: photons from
the lights first, then the picture by what they know. Less noise, and light through glass that paths
hardly find; a little blurred. No fog. ala: Autonomous Lighting Agents: a few agents look the scene
over first, and answer where light is hidden and how much of it comes from all around. No fog.
"""


OptimizationChoice = Literal["off", "vs", "s", "n", "b", "vb"]
"""How far expert rules may trade quality for time. off: Every zone at exactly the settings asked for.
vs: Very small savings. s: Small savings. n: Normal savings. b: Big savings. vb: Very big savings.
"""


OracleChoice = Literal["error", "paper"]
"""By which rules lighting agents answer. error: By the error that is to be expected: they look around
more where it is great, and answer where it is small. paper: Those of Herubel, Biri and Deverly
2009.
"""


OracleQuestion = Literal["shadows", "irradiance", "radiance", "halting"]
"""What lighting agents can be asked. shadows: Which shadow rays must be traced. irradiance: Where
indirect light may be interpolated. radiance: What light comes from where to surfaces that are not
matte, with the oracle `error`. halting: Whether a path goes on that has come to where they do not
know the light well enough, with the oracle `error`.
"""


PixelFilter = Literal["blackman-harris", "gaussian", "tent", "mitchell", "box"]
"""How samples are spread over a pixel. blackman-harris: Sharp and clean: the default. gaussian:
Softer. tent: Softer still at the edges. mitchell: Sharper, with a little ringing. box: Just the
pixel itself: for comparisons.
"""


PngEncoding = Literal["srgb", "linear"]
"""How a PNG's values are stored. srgb: For screens. linear: Linear light."""


class RulesSourceFile(TypedDict):
    """A file of FCL text, or the name of rules that come with the program, such as `paper`: the
    MAGarRO paper's own set.
    """

    file: str


class RulesSourceText(TypedDict):
    """The text itself."""

    text: RulesText


RulesSource = Union[RulesSourceFile, RulesSourceText]
"""Rules of agents."""


ToneCurve = Literal["agx", "aces", "linear"]
"""How a PNG's highlights are brought into range. agx: Like film: colours fade to white. aces:
Contrasty, after the Academy's reference. linear: As it is; what is above 1 is cut off.
"""


class Fields(TypedDict, total=False):
    """Fields of a request by name: short names of those that are used most, and whole sections."""

    spp: int | None
    """`goal.samples`: Samples a pixel; with an error or a time the most that a pixel gets. None: what
    the scene file asks for, or 64.
    """

    error: float | None
    """`goal.error`: The relative error at which each cell of 32 x 32 pixels has samples enough."""

    time: float | None
    """`goal.time`: Seconds from start to written file."""

    size: tuple[int, int] | None
    """`film.size`: Width and height in pixels; none: what the scene file asks for, or 720 high and as
    wide as the camera says.
    """

    crop: tuple[int, int, int, int] | None
    """`film.crop`: The part that is painted: x0, y0, x1, y1; each pixel is the same as in the whole.
    None: what the scene file asks for.
    """

    filter: PixelFilter | None
    """`film.filter`: How samples are spread over a pixel; none: what the scene file asks for, or
    `blackman-harris`.
    """

    layers: Sequence[str] | None
    """`film.layers`: Layers beside the color, by name; `all` alone: all of them. None: as the engine
    has it, our own has none.
    """

    denoise: bool
    """`film.denoise`: Whether Open Image Denoise removes what noise is left."""

    camera: str | None
    """`view.camera`: The camera, by name or by number from 0; none: the file's first."""

    light: EnvironmentLight | None
    """`environment.light`: Where it comes from; none: what the scene file says."""

    method: IntegratorChoice | None
    """`integrator.method`: The method; none: the one that finds the light that the scene file's own
    integrator finds, or `path`.
    """

    max_depth: int | None
    """`integrator.max_depth`: Bounces of light: 0 only what shines itself, 1 direct light, and so on;
    none: what the scene file asks for, or 16.
    """

    agents: int | None
    """`work.agents`: Render Agents; none: one for every two processors."""

    optimization: OptimizationChoice
    """`work.optimization`: How far expert rules may trade quality for time, zone by zone."""

    threads: int | None
    """`devices.threads`: Processors; none: all."""

    exact: bool
    """`devices.exact`: Whether every pixel is the same to the last bit, whoever paints it: by
    processors alone.
    """

    exposure: float
    """`output.exposure`: Stops by which a PNG is brightened (+) or darkened (-)."""

    devices: DeviceOptions | Mapping[str, Any]
    """The processors and devices of this machine that paint."""

    engine: EngineOptions | Mapping[str, Any]
    """Who paints: our own engine or other renderers."""

    environment: EnvironmentOptions | Mapping[str, Any]
    """Light from all around."""

    farm: FarmOptions | Mapping[str, Any]
    """What a farm is told of the job."""

    film: FilmOptions | Mapping[str, Any]
    """Size, part, filter and layers of the picture."""

    frames: FrameOptions | None | Mapping[str, Any]
    """The frames of an animation; none: one picture."""

    goal: GoalOptions | Mapping[str, Any]
    """When the picture is good enough."""

    guide: GuideOptions | Mapping[str, Any]
    """What paths learn of the light before the first sample."""

    integrator: IntegratorOptions | Mapping[str, Any]
    """How light is followed."""

    lighting_agents: LightingAgentOptions | Mapping[str, Any]
    """Autonomous Lighting Agents."""

    output: OutputOptions | Mapping[str, Any] | str | os.PathLike[str]
    """The file that the picture is written to."""

    photons: PhotonOptions | Mapping[str, Any]
    """Photon mapping."""

    seed: int
    """The seed: another one gives other noise, the same one the same picture, bit for bit."""

    view: ViewOptions | Mapping[str, Any]
    """The camera."""

    work: WorkOptions | Mapping[str, Any]
    """How the work is shared out among agents."""


KEYWORDS: Mapping[str, str] = {'spp': 'goal.samples',
 'error': 'goal.error',
 'time': 'goal.time',
 'size': 'film.size',
 'crop': 'film.crop',
 'filter': 'film.filter',
 'layers': 'film.layers',
 'denoise': 'film.denoise',
 'camera': 'view.camera',
 'light': 'environment.light',
 'method': 'integrator.method',
 'max_depth': 'integrator.max_depth',
 'agents': 'work.agents',
 'optimization': 'work.optimization',
 'threads': 'devices.threads',
 'exact': 'devices.exact',
 'exposure': 'output.exposure'}
"""Short names of fields."""


@dataclass(kw_only=True, slots=True)
class CameraPose(Section):
    """The place of a camera, in the coordinates of the scene file."""

    eye: tuple[float, float, float]
    """Where it stands."""
    fov: float | None = None
    """The full angle between the upper and the lower edge, in degrees; none: as the camera has it."""
    target: tuple[float, float, float]
    """At what it looks."""
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    """The direction of the picture's upper edge; none: +y."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset(['eye', 'target', 'up'])


@dataclass(kw_only=True, slots=True)
class DeviceOptions(Section):
    """The processors and devices of this machine that paint. Another machine has its own."""

    exact: bool = False
    """Whether every pixel is the same to the last bit, whoever paints it: by processors alone."""
    memory_mb: int | None = None
    """Memory that scenes may take on each GPU, in MiB; none: nearly all that it has."""
    names: Sequence[str] = field(default_factory=lambda: ['auto'])
    """`auto` alone (the processors, and the best GPU if there is one), or `cpu` and parts of GPUs'
    names.
    """
    threads: int | None = None
    """Processors; none: all."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class EngineOptions(Section):
    """Who paints: our own engine or other renderers."""

    frame: int | None = None
    """Which frame, for engines that know of frames; none: the one that the scene is at."""
    manifests: Sequence[str] = field(default_factory=lambda: [])
    """Folders with more manifests of engines."""
    names: Sequence[str] = field(default_factory=lambda: ['builtin'])
    """`builtin`, the name of another renderer, or both: the one named first takes simple zones."""
    options: Mapping[str, str] = field(default_factory=lambda: {})
    """Parameters of the engine's own, by name."""
    rules: RulesSource | None = None
    """Rules for which of two engines suits a zone; none: those that come with the program."""
    trust: bool = False
    """Whether scripts run that are in the scene."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class EnvironmentOptions(Section):
    """Light from all around."""

    light: EnvironmentLight | None = None
    """Where it comes from; none: what the scene file says."""
    rotate: float = 0.0
    """Degrees by which it is turned about the vertical axis."""
    strength: float = 1.0
    """A factor of its radiance."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class FarmOptions(Section):
    """What a farm is told of the job."""

    priority: int = 10
    """How urgent the picture is: jobs have machines in proportion to their priorities."""
    require: Sequence[str] = field(default_factory=lambda: [])
    """Tags that a machine must have to paint it (`bottega join --tag`); the one who asks paints in any
    case.
    """
    strangers: bool = False
    """Whether agents of other platforms may paint zones, with engines of their own (FIPA). The picture
    then depends on who painted it.
    """
    verify: int | None = None
    """So many different machines must have painted the same before a zone counts; none: each is
    trusted.
    """

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class FilmOptions(Section):
    """Size, part, filter and layers of the picture."""

    crop: tuple[int, int, int, int] | None = None
    """The part that is painted: x0, y0, x1, y1; each pixel is the same as in the whole. None: what the
    scene file asks for.
    """
    denoise: bool = False
    """Whether Open Image Denoise removes what noise is left."""
    filter: PixelFilter | None = None
    """How samples are spread over a pixel; none: what the scene file asks for, or `blackman-harris`."""
    layers: Sequence[str] | None = None
    """Layers beside the color, by name; `all` alone: all of them. None: as the engine has it, our own
    has none.
    """
    size: tuple[int, int] | None = None
    """Width and height in pixels; none: what the scene file asks for, or 720 high and as wide as the
    camera says.
    """

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset(['crop', 'size'])


@dataclass(kw_only=True, slots=True)
class FrameOptions(Section):
    """The frames of an animation."""

    fps: float = 24.0
    """Frames a second: frame N shows the scene at N / `fps` seconds."""
    list: Frames
    """Which frames."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class GoalOptions(Section):
    """When the picture is good enough. At most one of error and time is given."""

    error: float | None = None
    """The relative error at which each cell of 32 x 32 pixels has samples enough."""
    samples: int | None = None
    """Samples a pixel; with an error or a time the most that a pixel gets. None: what the scene file
    asks for, or 64.
    """
    time: float | None = None
    """Seconds from start to written file."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class GuideOptions(Section):
    """What paths learn of the light before the first sample. It changes the noise, not what the
    picture shows.
    """

    by: GuideChoice | None = None
    """How; none: `ala`, without a word where it is of no use."""
    uses: Sequence[GuideUse] = field(default_factory=lambda: [])
    """What lighting agents are used for, with `ala`; none of them: all."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class IntegratorOptions(Section):
    """How light is followed."""

    light_samples: int = 1
    """Light samples at each bounce."""
    max_depth: int | None = None
    """Bounces of light: 0 only what shines itself, 1 direct light, and so on; none: what the scene
    file asks for, or 16.
    """
    method: IntegratorChoice | None = None
    """The method; none: the one that finds the light that the scene file's own integrator finds, or
    `path`.
    """
    wavefront: bool = False
    """Whether rays are units of work of their own, which any device may follow, and shading is
    another: the way of the HRA paper. Without it a unit is samples of a block of pixels. The
    picture has the same bits.
    """

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class LightingAgentOptions(Section):
    """Autonomous Lighting Agents."""

    cast: int = 50000
    """Agents that the lights cast; their clones come on top."""
    decides: Sequence[OracleQuestion] = field(default_factory=lambda: ['shadows', 'irradiance', 'radiance'])
    """What they are asked; the rest is computed everywhere."""
    error: float = 0.1
    """Greatest relative error of indirect light that is interpolated, with the oracle `error`."""
    memory_mb: int = 4
    """Megabytes that they may take, with the oracle `error`."""
    network: bool = False
    """Whether the median of an agent and its neighbors in the network answers which shadow rays must
    be traced.
    """
    oracle: OracleChoice = 'error'
    """By which rules they answer."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class OutputOptions(Section):
    """The file that the picture is written to."""

    alpha: bool = False
    """Whether a PNG has alpha where the scene file does not ask for it."""
    encoding: PngEncoding = 'srgb'
    """How a PNG's values are stored."""
    exposure: float = 0.0
    """Stops by which a PNG is brightened (+) or darkened (-)."""
    file: str | None = None
    """.exr (linear light, all values) or .png (tone-mapped); none: no file, the picture is a value."""
    half: bool = False
    """Whether an EXR file has 16-bit values."""
    tiled: bool = False
    """Whether an EXR file is written in tiles."""
    tonemap: ToneCurve = 'agx'
    """How a PNG's highlights are brought into range."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class PhotonOptions(Section):
    """Photon mapping."""

    count: int | None = None
    """Photons that leave the lights; with `progressive` in each pass. None: 500,000, progressive
    100,000.
    """
    final_rays: int | None = None
    """Rays of each sample that gather indirect light; 0 takes the photons at the point itself. None:
    4.
    """
    gather: int | None = None
    """Photons from which the light at a point is estimated; none: 60."""
    gather_directions: bool | None = None
    """Whether gathering rays go where indirect photons came from; none: unless indirect light is taken
    from places near by.
    """
    indirect: bool = True
    """Whether there is indirect light, but for that over mirrors and through glass alone; for lighting
    agents, too.
    """
    irradiance_cache: float | None = None
    """Greatest error of indirect light on matte surfaces that is taken from places near by; none:
    gathered anew.
    """
    lookouts: bool = True
    """Whether photons for caustics are sent where agents that the camera casts look out for them; else
    to all mirrors and glass alike. For lighting agents, too.
    """
    progressive: bool = False
    """Whether each sample has photons of its own, within a radius that shrinks."""
    radius: float | None = None
    """How far such photons may lie, as a share of the radius of what the camera sees; none: 0.1."""
    separate_maps: bool = False
    """Whether direct and indirect photons are kept in maps of their own, and counted wherever a
    gathering ray ends.
    """
    shadow_photons: bool = False
    """Whether shadow rays are traced only where photons behind lit surfaces have not settled what is
    lit.
    """

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class RulesText(Section):
    """A text of rules, and what people call it."""

    name: str
    """What people call it: the file that it was read from."""
    text: str
    """FCL."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class SceneOptions(Section):
    """The scene file, and how it is read."""

    allow_outside: bool = False
    """Whether the scene may read files outside of its own folder."""
    animation: str | None = None
    """The animation to show, by name or by number from 0; none: all of them."""
    asset_roots: Sequence[str] = field(default_factory=lambda: [])
    """Folders below which the scene may read files, too."""
    cull_backfaces: bool = False
    """Whether the camera sees through the backs of a glTF scene's materials that are not double-sided."""
    defines: Mapping[str, str] = field(default_factory=lambda: {})
    """Parameters of a Mitsuba scene (its `<default>`s), by name."""
    file: str
    """The scene: glTF (.glb, .gltf), Mitsuba 3 (.xml), pbrt-v4 (.pbrt), a mesh (.obj, .ply), or what
    another engine reads.
    """
    strict: bool = False
    """Whether the scene is refused when something in it is not supported, instead of painting a
    substitute.
    """
    time: float | None = None
    """The time in seconds at which a glTF scene's animations are shown; none: the scene as its file
    describes it.
    """
    variant: str | None = None
    """Which of a glTF file's variants of materials to show, by name or by number from 0."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class ViewOptions(Section):
    """The camera."""

    camera: str | None = None
    """The camera, by name or by number from 0; none: the file's first."""
    focus_distance: float | None = None
    """Distance from the camera at which things are sharp, in scene units."""
    lens_radius: float | None = None
    """Radius of the lens in scene units: what is not at the focus distance blurs; 0: all is sharp."""
    pose: CameraPose | None = None
    """Where it stands and at what it looks; none: as the file says. Its lens stays the file's."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {"pose": CameraPose}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class WorkOptions(Section):
    """How the work is shared out among agents."""

    adaptation: AdaptationChoice = 'ratio'
    """How agents learn their speed."""
    agents: int | None = None
    """Render Agents; none: one for every two processors."""
    auction: AuctionChoice = 'finishing-time'
    """How the winners of an auction are found."""
    bands: BandChoice = 'rules'
    """How wide the bands are in which neighboring zones are blended."""
    channels: Sequence[str] | None = None
    """What the measure knows of a place; none: everything."""
    importance: ImportanceChoice = 'predicted'
    """Which measure makes the importance map."""
    level: int = 3
    """How the picture is cut: 0 not at all, 1 by importance, 2 joined, 3 balanced."""
    optimization: OptimizationChoice = 'off'
    """How far expert rules may trade quality for time, zone by zone."""
    rules: Sequence[RulesSource] = field(default_factory=lambda: [])
    """The expert rules, which agents carry in turn; none: those that come with the program or the
    engine.
    """
    zone_balance: BalanceChoice = 'time'
    """What zones of level 3 have in common."""
    zone_max_complexity: float | None = None
    """Level 1 cuts zones that are more complex than this share of the picture's complexity; none: than
    one part in `zones`.
    """
    zone_min_size: int = 8
    """The least width and height of a zone, in pixels."""
    zone_similarity: float = 0.15
    """Level 2 joins neighbors whose complexities a pixel differ by at most this share of the greater
    one.
    """
    zones: int | None = None
    """About so many zones; none: by `zone_max_complexity`, or else by the number of agents."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class Request(BaseRequest):
    """A picture asked for: plain data with documented defaults. Two requests that are equal give the
    same picture, whoever paints it and whatever door they came through. What is left out has its
    default. How a program tells of the work (progress, previews, traces) is no part of it.
    """

    devices: DeviceOptions = field(default_factory=DeviceOptions)
    """The processors and devices of this machine that paint."""
    engine: EngineOptions = field(default_factory=EngineOptions)
    """Who paints: our own engine or other renderers."""
    environment: EnvironmentOptions = field(default_factory=EnvironmentOptions)
    """Light from all around."""
    farm: FarmOptions = field(default_factory=FarmOptions)
    """What a farm is told of the job."""
    film: FilmOptions = field(default_factory=FilmOptions)
    """Size, part, filter and layers of the picture."""
    frames: FrameOptions | None = None
    """The frames of an animation; none: one picture."""
    goal: GoalOptions = field(default_factory=GoalOptions)
    """When the picture is good enough."""
    guide: GuideOptions = field(default_factory=GuideOptions)
    """What paths learn of the light before the first sample."""
    integrator: IntegratorOptions = field(default_factory=IntegratorOptions)
    """How light is followed."""
    lighting_agents: LightingAgentOptions = field(default_factory=LightingAgentOptions)
    """Autonomous Lighting Agents."""
    output: OutputOptions = field(default_factory=OutputOptions)
    """The file that the picture is written to."""
    photons: PhotonOptions = field(default_factory=PhotonOptions)
    """Photon mapping."""
    scene: SceneOptions
    """Which scene file, and how it is read."""
    seed: int = 0
    """The seed: another one gives other noise, the same one the same picture, bit for bit."""
    version: int = 1
    """The version of this vocabulary."""
    view: ViewOptions = field(default_factory=ViewOptions)
    """The camera."""
    work: WorkOptions = field(default_factory=WorkOptions)
    """How the work is shared out among agents."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {"devices": DeviceOptions, "engine": EngineOptions, "environment": EnvironmentOptions, "farm": FarmOptions, "film": FilmOptions, "frames": FrameOptions, "goal": GoalOptions, "guide": GuideOptions, "integrator": IntegratorOptions, "lighting_agents": LightingAgentOptions, "output": OutputOptions, "photons": PhotonOptions, "scene": SceneOptions, "view": ViewOptions, "work": WorkOptions}
    _tuples: ClassVar[frozenset[str]] = frozenset([])

    @classmethod
    def of(cls, scene: str | os.PathLike[str], **fields: Unpack[Fields]) -> Request:
        """A picture of a scene file; fields by their short names (`spp=64`) or by section (`goal={"samples": 64}`).

        Raises `RequestError` for a value that is not allowed, `TypeError` for a field that there is not.
        """
        return cls(scene=SceneOptions(file=os.fspath(scene))).changed(**fields)

    def changed(self, **fields: Unpack[Fields]) -> Request:
        """The same request with some fields set, checked as a whole."""
        return self._with(KEYWORDS, dict(fields))
