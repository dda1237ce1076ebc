"""Requests as typed values. Made by `cargo xtask python-stubs` from the JSON Schema of requests; do not edit."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Mapping, Sequence, TypedDict, Union

from ._sections import BaseRequest, Section

if TYPE_CHECKING:
    from typing_extensions import Unpack


AdaptationChoice = Literal["ratio", "paper"]
"""The rule by which agents adapt V_cp. ratio: By the median of the last ratios of own time to
reference time: the default. paper: By equation (1) of the MAGarRO paper, as printed.
"""


AuctionChoice = Literal["finishing-time", "promised", "paper", "stealing"]
"""The rule that decides auctions. finishing-time: Each agent gets the largest zone that it can finish
before the expected end of the job, with its promises weighted by its reliability: the default.
promised: Like `finishing-time`, but promises count without regard to reliability. paper: The most
complex zone goes to the bidder with the most credit, as in the MAGarRO paper. stealing: No auction:
each zone is assigned at once to the agent that finishes it soonest, and idle agents take waiting
zones from others.
"""


BalanceChoice = Literal["time", "ratio"]
"""The quantity that level 3 balances. time: The expected time, so that agents do not wait for a slow
zone: the default. ratio: The complexity/size ratio, as the MAGarRO paper says.
"""


class BandChoicePixels(TypedDict):
    """This number of pixels beyond each edge of each zone."""

    pixels: int


BandChoice = Union[Literal["off", "rules"], BandChoicePixels]
"""The width of the interpolation bands between zones. With optimization off there are none: zones
agree to the last bit. off: No bands: zones meet at an edge. rules: The expert rules choose the
width of each edge.
"""


ColorSpace = Literal["rec709", "rec2020", "p3", "acescg", "aces2065"]
"""The color space of an EXR file; all are linear. rec709: The primaries of Rec. 709 and sRGB: the
default. rec2020: The primaries of Rec. 2020. p3: The primaries of Display P3. acescg: The primaries
AP1 of ACES, in which most compositing is done. aces2065: The primaries AP0 of ACES, for
interchange.
"""


Compression = Literal["zip", "zips", "piz", "rle", "dwaa", "dwab", "none"]
"""The compression of an EXR file. zip: Lossless, in blocks of 16 rows; every program reads it: the
default. zips: Lossless, row by row: for programs that read parts of a picture, such as Nuke. piz:
Lossless; the smallest for noisy pictures, slower. rle: Lossless and fast; good for flat colors.
dwaa: Lossy, a third of the size or less; the eye sees no difference. Rounds colors: the picture,
light and albedo. Keeps all other layers, such as alpha, depth, normals and Cryptomattes, without
loss, because a rounded number or identity misleads compositing. dwab: As `dwaa`, a little smaller.
none: No compression.
"""


class EnvironmentLightFile(TypedDict):
    """An image of the whole sphere: .hdr, .exr or .png."""

    file: str


class EnvironmentLightRadiance(TypedDict):
    """The same radiance from all directions: red, green, blue."""

    radiance: tuple[float, float, float]


EnvironmentLight = Union[Literal["sky"], EnvironmentLightFile, EnvironmentLightRadiance]
"""The source of the environment light. sky: The neutral sky that scenes without light get by default."""


Frames = str
"""Frames of an animation in rendering order, each at most once. Written as a list of numbers and
ranges, such as `1..24`, `1..9:2` (1, 3, 5, 7, 9), `9..1:-2`, `-5..5` or `1,4,7..9`. Both ends of a
range are included. A repeated frame is rendered at its first position, so `1..100:10,1..100`
renders every tenth frame first.
"""


GuideChoice = Literal["none", "directions", "ala"]
"""Path guiding: knowledge of the light, learned before the first sample. none: No guiding: directions
are sampled by the materials alone. directions: The directions that light comes from. ala: All uses
of lighting agents: directions, the choice of lights, their visibility, and what a path is worth.
The default.
"""


GuideUse = Literal["shadows", "lights", "directions", "roulette"]
"""The uses of lighting agents in path tracing. shadows: Traces shadow rays only where the visibility
of the light is uncertain. lights: Chooses lights by their contribution. directions: Samples the
directions that light comes from. roulette: Russian roulette and splitting by the expected
contribution of a path.
"""


ImportanceChoice = Literal["predicted", "paper", "visual"]
"""The measure of the importance map. predicted: Predicted cost, from the cost of a small path-traced
survey of the scene. paper: Levels of recursion in mirrors and glass, as in the MAGarRO paper.
visual: The visibility of errors.
"""


IntegratorChoice = Literal["path", "photon", "ala", "auto"]
"""The integrator. path: Path tracing: unbiased; the only error is noise. photon: Photon mapping:
photons from the lights first, then the picture from their density. Less noise, and light through
glass that paths hardly find; slightly blurred. No fog. ala: Autonomous Lighting Agents: a few
agents explore the scene first, and answer which points are lit and how much indirect light they
get. No fog. auto: Paths or photons, zone by zone, whichever a trial before the picture finds better
for its time. Photons are slightly blurred, so they are tried only with an `optimization` of the
work; without it, paths render everything.
"""


OptimizationChoice = Literal["off", "vs", "s", "n", "b", "vb"]
"""Degree to which expert rules may trade quality for time. off: Every zone has exactly the requested
settings. vs: Very small savings. s: Small savings. n: Normal savings. b: Big savings. vb: Very big
savings.
"""


OracleChoice = Literal["error", "paper"]
"""The rules by which lighting agents answer. error: By the expected error: agents sample more where it
is large, and answer where it is small. paper: The rules of Herubel, Biri and Deverly 2009.
"""


OracleQuestion = Literal["shadows", "irradiance", "radiance"]
"""The questions for lighting agents. shadows: Shadow rays: the agents decide which of them must be
traced. irradiance: Indirect light: the agents decide where it is interpolated. radiance: Incident
light at surfaces that are not matte, with the oracle `error`.
"""


PixelFilter = Literal["blackman-harris", "gaussian", "tent", "mitchell", "box"]
"""The pixel filter. blackman-harris: Sharp and clean: the default. gaussian: Softer than the default.
tent: Softer still at the edges. mitchell: Sharper, with a little ringing. box: A box of one pixel:
for comparisons.
"""


PngEncoding = Literal["srgb", "linear"]
"""The encoding of PNG values. srgb: The sRGB curve, for screens. linear: Linear light, without a
curve.
"""


ProjectionChoice = Literal["equirectangular", "equal-area", "cube", "fisheye", "equisolid-fisheye"]
"""The projection of a camera. equirectangular: The whole sphere: longitude along the rows, latitude
down the columns; the view ahead is in the middle. equal-area: The whole sphere in a square, in
which equal areas cover equal solid angles; the view up is in the middle. cube: Six square pictures
side by side: towards +x, -x, +y, -y, +z and -z of the camera. fisheye: A circle in which distance
from the middle is in proportion to the angle; see `view.fisheye_fov`. equisolid-fisheye: A circle
in which equal areas cover equal solid angles; see `view.fisheye_fov`.
"""


class RulesSourceFile(TypedDict):
    """An FCL file, or the name of built-in rules, such as `paper`: the rule set of the MAGarRO paper."""

    file: str


class RulesSourceText(TypedDict):
    """The rules as text."""

    text: RulesText


RulesSource = Union[RulesSourceFile, RulesSourceText]
"""A source of expert rules."""


StereoChoice = Literal["side-by-side", "top-bottom", "left", "right"]
"""The places of the pictures for two eyes, or one of the eyes. side-by-side: The left eye's picture is
the left half. top-bottom: The left eye's picture is the upper half. left: The left eye's picture
alone. right: The right eye's picture alone.
"""


ToneCurve = Literal["agx", "aces", "linear"]
"""The tone curve of a PNG. agx: Like film: bright colors fade to white. aces: Contrasty, after the
Academy's reference. linear: Linear; values above 1 are clipped.
"""


class Fields(TypedDict, total=False):
    """Fields of a request by name: short names of those that are used most, and whole sections."""

    spp: int | None
    """`goal.samples`: Samples per pixel; with an error or a time the maximum per pixel. None: what the
    scene file asks for, or 64.
    """

    samples: int | None
    """`goal.samples`: Samples per pixel; with an error or a time the maximum per pixel. None: what the
    scene file asks for, or 64.
    """

    error: float | None
    """`goal.error`: The estimated relative error at which a cell of 32 x 32 pixels stops, such as
    0.05; the maximum of samples is then 4096 if none is given.
    """

    time: float | None
    """`goal.time`: Time limit in seconds, from the start to the written file."""

    size: tuple[int, int] | None
    """`film.size`: Width and height in pixels; none: those of the scene file, or 720 high with the
    aspect ratio of the camera.
    """

    crop: tuple[int, int, int, int] | None
    """`film.crop`: The rendered part: x0, y0, x1, y1; its pixels are the same as in the whole picture.
    None: that of the scene file.
    """

    filter: PixelFilter | None
    """`film.filter`: The pixel filter; none: that of the scene file, or `blackman-harris`."""

    layers: Sequence[str] | None
    """`film.layers`: Layers in addition to the color, by name; `all` alone: all of them. None: the
    engine's default; the built-in engine makes none.
    """

    light_groups: Mapping[str, Sequence[str]]
    """`film.light_groups`: Groups of lights whose light is kept apart, by name: each is a layer
    `light_NAME` of the light that comes from the lights that one of its patterns matches. A pattern
    is the name of a light, or of the object, mesh or material of a surface that glows, or
    `environment`; `*` stands for any characters, `?` for one.
    """

    shadow_catchers: Sequence[str]
    """`film.shadow_catchers`: Shadow catchers: objects that stand for those of a photographed plate,
    by patterns as for light groups, of the name of an object, mesh or material. The picture does
    not show them, nor the sky. Its layer `shadow-catcher` has the share of their light that the
    other objects leave to them, and its alpha grows by what they lack.
    """

    denoise: bool
    """`film.denoise`: True to denoise the picture with Intel's Open Image Denoise, which must be
    installed; `BOTTEGA_OIDN` names its file or folder. The EXR file then has the layers albedo,
    normal and noisy.
    """

    camera: str | None
    """`view.camera`: The camera, by name or by number from 0; none: the file's first."""

    light: EnvironmentLight | None
    """`environment.light`: The source of the light; none: that of the scene file."""

    method: IntegratorChoice | None
    """`integrator.method`: The integrator; none: one that finds the same light as the scene file's
    integrator, or `path`.
    """

    max_depth: int | None
    """`integrator.max_depth`: Maximum number of bounces: 0 emission only, 1 direct light, and so on;
    none: what the scene file asks for, or 16.
    """

    agents: int | None
    """`work.agents`: Number of Render Agents; none: one per two processors."""

    optimization: OptimizationChoice
    """`work.optimization`: Degree to which expert rules may trade quality for time, zone by zone."""

    threads: int | None
    """`devices.threads`: Number of CPU threads; none: all processors."""

    exact: bool
    """`devices.exact`: True to make pixels bit-identical on every machine: only processors render."""

    exposure: float
    """`output.exposure`: Exposure of a PNG in stops: positive is brighter."""

    devices: DeviceOptions | Mapping[str, Any]
    """The processors and devices of this machine that render."""

    engine: EngineOptions | Mapping[str, Any]
    """The engine: the built-in one or external renderers."""

    environment: EnvironmentOptions | Mapping[str, Any]
    """The environment light."""

    farm: FarmOptions | Mapping[str, Any]
    """Settings of the job on a farm."""

    film: FilmOptions | Mapping[str, Any]
    """Size, crop, pixel filter and layers of the picture."""

    frames: FrameOptions | None | Mapping[str, Any]
    """The frames of an animation; none: one picture."""

    goal: GoalOptions | Mapping[str, Any]
    """The goal at which the picture is finished."""

    guide: GuideOptions | Mapping[str, Any]
    """Path guiding: knowledge of the light, learned before the first sample."""

    integrator: IntegratorOptions | Mapping[str, Any]
    """The integrator."""

    lighting_agents: LightingAgentOptions | Mapping[str, Any]
    """Settings of Autonomous Lighting Agents."""

    output: OutputOptions | Mapping[str, Any] | str | os.PathLike[str]
    """The output file."""

    photons: PhotonOptions | Mapping[str, Any]
    """Settings of photon mapping."""

    seed: int
    """Seed of the random numbers: the same seed gives the same picture, bit for bit; another one gives
    other noise.
    """

    view: ViewOptions | Mapping[str, Any]
    """The camera and its pose."""

    work: WorkOptions | Mapping[str, Any]
    """Sharing the work among agents."""


KEYWORDS: Mapping[str, str] = {'spp': 'goal.samples',
 'samples': 'goal.samples',
 'error': 'goal.error',
 'time': 'goal.time',
 'size': 'film.size',
 'crop': 'film.crop',
 'filter': 'film.filter',
 'layers': 'film.layers',
 'light_groups': 'film.light_groups',
 'shadow_catchers': 'film.shadow_catchers',
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
    """The pose of a camera, in the coordinates of the scene file."""

    eye: tuple[float, float, float]
    """Position of the camera."""
    fov: float | None = None
    """Full vertical field of view, in degrees; none: that of the camera."""
    target: tuple[float, float, float]
    """Point that the camera looks at."""
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    """Up direction of the picture; none: +y."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset(['eye', 'target', 'up'])


@dataclass(kw_only=True, slots=True)
class DeviceOptions(Section):
    """The processors and devices of this machine that render. Other machines have their own."""

    bin: int | None = None
    """Largest number of work units that wait for a processor or device; none: as many as are done in a
    twentieth of a second.
    """
    exact: bool = False
    """True to make pixels bit-identical on every machine: only processors render."""
    memory_mb: int | None = None
    """Memory limit for scenes on each GPU, in MiB; none: nearly all free memory."""
    names: Sequence[str] = field(default_factory=lambda: ['auto'])
    """`auto` alone (the processors, and the best GPU if there is one), or `cpu` and parts of GPUs'
    names.
    """
    threads: int | None = None
    """Number of CPU threads; none: all processors."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class EngineOptions(Section):
    """The engine: the built-in one or external renderers."""

    frame: int | None = None
    """Number of the frame, for engines with frames; none: the scene's current frame."""
    manifests: Sequence[str] = field(default_factory=lambda: [])
    """Further folders with manifests of engines."""
    names: Sequence[str] = field(default_factory=lambda: ['builtin'])
    """`builtin`, the name of an external renderer, or both: the first one renders the simple zones."""
    options: Mapping[str, str] = field(default_factory=lambda: {})
    """Parameters of the external engine, by name."""
    rules: RulesSource | None = None
    """Rules that choose the engine of a zone; none: the built-in ones."""
    trust: bool = False
    """True to run scripts contained in the scene; only for scenes from people you trust."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class EnvironmentOptions(Section):
    """The environment light."""

    light: EnvironmentLight | None = None
    """The source of the light; none: that of the scene file."""
    rotate: float = 0.0
    """Rotation of the environment light about the vertical axis, in degrees."""
    strength: float = 1.0
    """Factor of the environment light's radiance."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class FarmOptions(Section):
    """Settings of the job on a farm."""

    priority: int = 10
    """Priority of the job: jobs get machines in proportion to it."""
    require: Sequence[str] = field(default_factory=lambda: [])
    """Tags that a machine must have (`bottega join --tag`); the submitting process always takes part."""
    strangers: bool = False
    """True to let agents of other platforms (FIPA) paint zones with their own engines. The picture
    then depends on the agents.
    """
    verify: int | None = None
    """Number of different machines that must agree on a zone before it counts; none: each machine is
    trusted.
    """

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class FilmOptions(Section):
    """Size, crop, pixel filter and layers of the picture."""

    crop: tuple[int, int, int, int] | None = None
    """The rendered part: x0, y0, x1, y1; its pixels are the same as in the whole picture. None: that
    of the scene file.
    """
    denoise: bool = False
    """True to denoise the picture with Intel's Open Image Denoise, which must be installed;
    `BOTTEGA_OIDN` names its file or folder. The EXR file then has the layers albedo, normal and
    noisy.
    """
    filter: PixelFilter | None = None
    """The pixel filter; none: that of the scene file, or `blackman-harris`."""
    layers: Sequence[str] | None = None
    """Layers in addition to the color, by name; `all` alone: all of them. None: the engine's default;
    the built-in engine makes none.
    """
    light_groups: Mapping[str, Sequence[str]] = field(default_factory=lambda: {})
    """Groups of lights whose light is kept apart, by name: each is a layer `light_NAME` of the light
    that comes from the lights that one of its patterns matches. A pattern is the name of a light,
    or of the object, mesh or material of a surface that glows, or `environment`; `*` stands for any
    characters, `?` for one.
    """
    shadow_catchers: Sequence[str] = field(default_factory=lambda: [])
    """Shadow catchers: objects that stand for those of a photographed plate, by patterns as for light
    groups, of the name of an object, mesh or material. The picture does not show them, nor the sky.
    Its layer `shadow-catcher` has the share of their light that the other objects leave to them,
    and its alpha grows by what they lack.
    """
    size: tuple[int, int] | None = None
    """Width and height in pixels; none: those of the scene file, or 720 high with the aspect ratio of
    the camera.
    """

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset(['crop', 'size'])


@dataclass(kw_only=True, slots=True)
class FrameOptions(Section):
    """The frames of an animation."""

    fps: float = 24.0
    """Frames per second: frame N shows the scene at N / `fps` seconds."""
    list: Frames
    """The list of frames."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class GoalOptions(Section):
    """The goal at which the picture is finished. At most one of error and time is given."""

    error: float | None = None
    """The estimated relative error at which a cell of 32 x 32 pixels stops, such as 0.05; the maximum
    of samples is then 4096 if none is given.
    """
    samples: int | None = None
    """Samples per pixel; with an error or a time the maximum per pixel. None: what the scene file asks
    for, or 64.
    """
    time: float | None = None
    """Time limit in seconds, from the start to the written file."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class GuideOptions(Section):
    """Path guiding: knowledge of the light, learned before the first sample. It changes the noise, not
    the expected picture.
    """

    by: GuideChoice | None = None
    """The kind of guide; none: `ala`, without a warning where it has no effect."""
    uses: Sequence[GuideUse] = field(default_factory=lambda: [])
    """The uses of lighting agents, with `ala`; empty: all."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class IntegratorOptions(Section):
    """The integrator."""

    light_samples: int = 1
    """Light samples per bounce."""
    max_depth: int | None = None
    """Maximum number of bounces: 0 emission only, 1 direct light, and so on; none: what the scene file
    asks for, or 16.
    """
    method: IntegratorChoice | None = None
    """The integrator; none: one that finds the same light as the scene file's integrator, or `path`."""
    rules: RulesSource | None = None
    """Rules that choose between paths and photons, with `auto`; none: the built-in ones."""
    wavefront: bool = False
    """True to make rays and shading separate work units, so that any device can trace the rays, as in
    the HRA paper. False: a unit is samples of a block of pixels. The picture has the same bits.
    """

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class LightingAgentOptions(Section):
    """Settings of Autonomous Lighting Agents."""

    cast: int = 50000
    """Number of agents cast from the lights, without their clones."""
    decides: Sequence[OracleQuestion] = field(default_factory=lambda: ['shadows', 'irradiance', 'radiance'])
    """The questions that the agents answer; everything else is computed."""
    error: float = 0.1
    """Largest relative error of interpolated indirect light, with the oracle `error`."""
    memory_mb: int = 4
    """Memory limit of the agents in MiB, with the oracle `error`."""
    network: bool = False
    """True if the median of an agent and its neighbors in the network decides which shadow rays are
    traced.
    """
    oracle: OracleChoice = 'error'
    """The rules by which the agents answer."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class OutputOptions(Section):
    """The output file."""

    alpha: bool = False
    """True to write alpha to a PNG even if the scene file does not ask for it."""
    colorspace: ColorSpace = 'rec709'
    """Color space of an EXR file: the primaries of the color, and of layers of light and reflectance.
    PNG files are sRGB.
    """
    compression: Compression = 'zip'
    """Compression of an EXR file."""
    encoding: PngEncoding = 'srgb'
    """Encoding of PNG values."""
    exposure: float = 0.0
    """Exposure of a PNG in stops: positive is brighter."""
    file: str | None = None
    """The file: .exr (linear light, all layers) or .png (tone-mapped); none: no file."""
    half: bool = False
    """True to write 16-bit values to an EXR file."""
    parts: bool = False
    """True to write the color and each layer as parts of their own into an EXR file, so that programs
    read only the parts that they need.
    """
    tiled: bool = False
    """True to write an EXR file in tiles."""
    tonemap: ToneCurve = 'agx'
    """Tone curve of a PNG."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class PhotonOptions(Section):
    """Settings of photon mapping."""

    count: int | None = None
    """Number of photons emitted; with `progressive` per pass. None: 500,000, progressive 100,000."""
    final_rays: int | None = None
    """Final gather rays per sample; 0: use the photons at the point itself. None: 4."""
    gather: int | None = None
    """Number of photons in a density estimate; none: 60."""
    gather_directions: bool | None = None
    """True to send gather rays in the directions that indirect photons came from; none: true unless
    indirect light is interpolated.
    """
    indirect: bool = True
    """True for indirect light; false keeps only that over mirrors and through glass. Also for lighting
    agents.
    """
    irradiance_cache: float | None = None
    """Largest error at which indirect light on matte surfaces is interpolated from nearby points;
    none: always gather.
    """
    lookouts: bool = True
    """True to send caustic photons where lookouts, agents cast from the camera, find them useful;
    false: to all mirrors and glass alike. Also for lighting agents.
    """
    progressive: bool = False
    """True to use progressive photon mapping: each pass has its own photons, in a radius that shrinks."""
    radius: float | None = None
    """Largest distance of these photons, as a share of the radius of the visible scene; none: 0.1."""
    separate_maps: bool = False
    """True to keep direct and indirect photons in separate maps, used wherever a gather ray ends."""
    shadow_photons: bool = False
    """True to trace shadow rays only where shadow photons have not decided the visibility of the
    light.
    """

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class RulesText(Section):
    """Rules as text, with a name."""

    name: str
    """Name for messages: the file that the text was read from."""
    text: str
    """The text in FCL."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class ShutterTimes(Section):
    """The span of time that a picture shows: how long a camera's shutter is open."""

    close: float
    """The time at which it is closed; equal to `open`: nothing is blurred."""
    open: float
    """The time at which the shutter opens, in seconds, or in the unit of the scene file."""
    ramp: float = 0.0
    """The share of the time that it takes to open, and again to close, from 0 (at once) to 0.5."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class SceneOptions(Section):
    """The scene file, and options for reading it."""

    allow_outside: bool = False
    """True to let the scene read files outside of its folder."""
    animation: str | None = None
    """The animation to show, by name or by number from 0; none: all of them."""
    asset_roots: Sequence[str] = field(default_factory=lambda: [])
    """Further folders below which the scene may read files."""
    cull_backfaces: bool = False
    """True to let the camera see through the backs of single-sided materials in glTF scenes, as
    viewers do.
    """
    defines: Mapping[str, str] = field(default_factory=lambda: {})
    """Parameters of a Mitsuba scene (its `<default>`s), by name."""
    displacement: int | None = None
    """Number of times that the longest edge of a mesh that a texture displaces is halved, from 0 to
    12; none: until edges are as long as a texel, or as the file says, with at most a million
    triangles per mesh. With a number, a mesh has at most 4 million.
    """
    file: str
    """The scene: glTF (.glb, .gltf), USD (.usd, .usda, .usdc, .usdz), Mitsuba 3 (.xml), pbrt-v4
    (.pbrt), a mesh (.obj, .ply), or what another engine reads.
    """
    shutter: ShutterTimes | None = None
    """The span of time that the picture shows, relative to `scene.time`; none: that of the file, which
    for glTF and USD is one moment. What moves during it is blurred.
    """
    strict: bool = False
    """True to refuse a scene with unsupported features; false to render substitutes for them."""
    subdivision: int | None = None
    """Number of times that subdivision surfaces of a USD stage are refined, from 0 (their polygons) to
    6; none: 2 for meshes that name their `subdivisionScheme`, and 0 for others. A mesh that would
    have more than 4 million faces is refined less, with a warning.
    """
    time: float | None = None
    """The time in seconds at which the animations of a glTF or USD scene are shown; none: the scene as
    its file describes it.
    """
    variant: str | None = None
    """The material variant of a glTF file, by name or by number from 0; of a USD stage variants of
    prims, as in `/Car{color=red}`.
    """

    _parts: ClassVar[Mapping[str, type[Section]]] = {"shutter": ShutterTimes}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class ViewOptions(Section):
    """The camera and its pose."""

    aperture_ratio: float | None = None
    """Height over width of the aperture; 2 for the narrow highlights of anamorphic lenses. None: that
    of the file.
    """
    blade_rotation: float = 0.0
    """Rotation of the aperture's blades, counterclockwise, in degrees."""
    blades: int | None = None
    """Number of blades of the aperture, which highlights out of focus show as corners; 0: it is round.
    None: that of the file.
    """
    camera: str | None = None
    """The camera, by name or by number from 0; none: the file's first."""
    convergence: float | None = None
    """Distance at which the pictures of the two eyes agree, in scene units; none: the eyes look in
    parallel.
    """
    eye_distance: float = 0.0625
    """Distance between the two eyes, in scene units."""
    fisheye_fov: float = 180.0
    """Full angle of the circle of a fisheye, in degrees, up to 360."""
    focus_distance: float | None = None
    """Focus distance, in scene units."""
    instant_shutter: bool = False
    """True to show everything as it is in the middle of the shutter's time, so that nothing is
    blurred. The layer `motion` still has the movement over all of the shutter's time, to blur the
    picture in compositing.
    """
    lens_radius: float | None = None
    """Radius of the lens, in scene units; 0: everything is sharp."""
    pose: CameraPose | None = None
    """The pose; none: that of the file. The lens stays that of the file."""
    projection: ProjectionChoice | None = None
    """The projection; none: that of the file."""
    rolling_shutter: float | None = None
    """Share of the shutter's time for which each row is exposed; the rows are exposed one after
    another, from the upper edge down. None: all rows at the same time.
    """
    stereo: StereoChoice | None = None
    """Pictures for two eyes in one picture, each of half its size, or that of one of them; none: one
    eye.
    """

    _parts: ClassVar[Mapping[str, type[Section]]] = {"pose": CameraPose}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class WorkOptions(Section):
    """Sharing the work among agents."""

    adaptation: AdaptationChoice = 'ratio'
    """The rule by which agents adapt V_cp."""
    agents: int | None = None
    """Number of Render Agents; none: one per two processors."""
    auction: AuctionChoice = 'finishing-time'
    """The rule that decides auctions."""
    bands: BandChoice = 'rules'
    """Width of the interpolation bands between zones."""
    channels: Sequence[str] | None = None
    """The channels that the measure uses; none: all."""
    importance: ImportanceChoice = 'predicted'
    """The measure of the importance map."""
    level: int = 3
    """Level of division into zones: 0 none, 1 by importance, 2 joined, 3 balanced."""
    optimization: OptimizationChoice = 'off'
    """Degree to which expert rules may trade quality for time, zone by zone."""
    prefetch: int = 2
    """Number of zones that an agent works on at once: the next begins while the last pixels of one are
    painted. 1, as in the MAGarRO paper: only idle agents bid.
    """
    rules: Sequence[RulesSource] = field(default_factory=lambda: [])
    """The expert rules, which agents carry in turn; none: those built in or of the engine."""
    share_tail: bool = True
    """True to cut zones near the end of the job, and to give idle agents the late zones of slow ones.
    Only agents on different machines share the tail.
    """
    zone_balance: BalanceChoice = 'time'
    """The quantity that level 3 balances."""
    zone_max_complexity: float | None = None
    """Level 1 divides zones with more than this share of the picture's complexity; none: one part in
    `zones`.
    """
    zone_min_size: int = 8
    """Smallest width and height of a zone, in pixels."""
    zone_similarity: float = 0.15
    """Level 2 joins neighbors whose complexities per pixel differ by at most this share of the greater
    one.
    """
    zones: int | None = None
    """Approximate number of zones; none: by `zone_max_complexity`, or else by the number of agents."""

    _parts: ClassVar[Mapping[str, type[Section]]] = {}
    _tuples: ClassVar[frozenset[str]] = frozenset([])


@dataclass(kw_only=True, slots=True)
class Request(BaseRequest):
    """The description of a picture: plain data with documented defaults. Equal requests give the same
    picture, on every machine and through every interface. Missing fields have their defaults.
    Settings of how a program reports its work (progress, previews, traces) are not part of a
    request.
    """

    devices: DeviceOptions = field(default_factory=DeviceOptions)
    """The processors and devices of this machine that render."""
    engine: EngineOptions = field(default_factory=EngineOptions)
    """The engine: the built-in one or external renderers."""
    environment: EnvironmentOptions = field(default_factory=EnvironmentOptions)
    """The environment light."""
    farm: FarmOptions = field(default_factory=FarmOptions)
    """Settings of the job on a farm."""
    film: FilmOptions = field(default_factory=FilmOptions)
    """Size, crop, pixel filter and layers of the picture."""
    frames: FrameOptions | None = None
    """The frames of an animation; none: one picture."""
    goal: GoalOptions = field(default_factory=GoalOptions)
    """The goal at which the picture is finished."""
    guide: GuideOptions = field(default_factory=GuideOptions)
    """Path guiding: knowledge of the light, learned before the first sample."""
    integrator: IntegratorOptions = field(default_factory=IntegratorOptions)
    """The integrator."""
    lighting_agents: LightingAgentOptions = field(default_factory=LightingAgentOptions)
    """Settings of Autonomous Lighting Agents."""
    output: OutputOptions = field(default_factory=OutputOptions)
    """The output file."""
    photons: PhotonOptions = field(default_factory=PhotonOptions)
    """Settings of photon mapping."""
    scene: SceneOptions
    """The scene file, and options for reading it."""
    seed: int = 0
    """Seed of the random numbers: the same seed gives the same picture, bit for bit; another one gives
    other noise.
    """
    version: int = 1
    """The version of the request format."""
    view: ViewOptions = field(default_factory=ViewOptions)
    """The camera and its pose."""
    work: WorkOptions = field(default_factory=WorkOptions)
    """Sharing the work among agents."""

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
