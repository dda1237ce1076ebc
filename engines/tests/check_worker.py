#!/usr/bin/env python3
"""Drives the worker of an engine by the line protocol and checks what it answers and paints:

    python3 engines/tests/check_worker.py mitsuba|cycles|luxcore|povray [--way N] [--threads N]

`--way N` takes the manifest's N-th way to find the engine (0: the first). Needs Python 3.11 and the engine; no NumPy.
Ends with 0 when all is well, with 1 and the list of what is not.
"""

import argparse
import json
import math
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib

HERE = os.path.dirname(os.path.abspath(__file__))
ENGINES = os.path.dirname(HERE)
sys.path[:0] = [HERE, ENGINES]

import make_scenes
import plain_exr

WIDTH, HEIGHT = make_scenes.WIDTH, make_scenes.HEIGHT
WHOLE = [0, 0, WIDTH, HEIGHT]
SCENES = {"mitsuba": "room.xml", "luxcore": "room.cfg", "povray": "room.pov", "cycles": "room.blend"}
# How a window compares with the same part of the full frame, painted with the same seed.
BITS, STATISTICS = "bits", "statistics"
EQUALITY = {"mitsuba": STATISTICS, "luxcore": STATISTICS, "povray": BITS, "cycles": BITS}
# Same window, same seed: the same bits.
REPEATS = {"mitsuba": True, "luxcore": False, "povray": True, "cycles": True}
# What the engine's own words must hold when a scene names a picture that is not there, or is no scene at all.
WORDS = {"mitsuba": (r"not found|does not exist|unable to open|No such file", r"room|line|parse|unclosed|element"),
         "luxcore": (r"doesn't exist|not found|unable", r"syntax|property|undefined|line"),
         "povray": (r"cannot (open|find)|could not|not found", r"parse error.*expected|line \d+"),
         "cycles": (r"cannot find|not found", r"blend|read|file")}


class Failed(Exception):
    """A check does not hold."""


def expect(condition, text):
    if not condition:
        raise Failed(text)


class Worker:
    """A running worker. Whatever it writes to its log is kept in a file."""

    def __init__(self, name, way, scratch):
        with open(os.path.join(ENGINES, f"{name}.toml"), "rb") as file:
            manifest = tomllib.load(file)
        for script in manifest["files"]:
            expect(os.path.isfile(os.path.join(ENGINES, script)), f"the manifest names {script}, which is not there")
        find = manifest["find"][way]
        programs = [os.environ[find["variable"]]] if os.environ.get(find.get("variable", "")) else find["programs"]
        program = next((path for path in map(shutil.which, programs) if path), None)
        expect(program, f"none of {', '.join(programs)} is there: {manifest['install']['any']}")
        command = [part.format(program=program, folder=ENGINES) for part in find["command"]]
        self.program, self.manifest = program, manifest
        self.log = open(os.path.join(scratch, "worker.log"), "ab")
        self.started = time.monotonic()
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self.log)
        self.shares = []
        self.greeting = self.answer("ready")

    def answer(self, kind):
        """The next answer that is no progress; it must be of a kind."""
        while True:
            line = self.process.stdout.readline()
            expect(line, f"the worker ended with status {self.process.poll()}; its log is {self.log.name}")
            if not line.startswith(b"{"):
                expect(not hasattr(self, "greeting"), f"`{line!r}` is no answer")
                continue
            (found, fields), = json.loads(line).items()
            if found == "progress":
                self.shares.append(fields["share"])
                continue
            expect(found == kind, f"`{kind}` was awaited, and this came: {line.decode().strip()}")
            return fields

    def ask(self, kind, **request):
        self.process.stdin.write(json.dumps(request).encode() + b"\n")
        self.process.stdin.flush()
        return self.answer(kind)


class Room:
    """The room, opened by a worker, with pictures of it."""

    def __init__(self, arguments, scratch):
        self.name, self.threads, self.scratch = arguments.name, arguments.threads, scratch
        self.worker = Worker(arguments.name, arguments.way, scratch)
        self.scene = os.path.join(HERE, "scenes", SCENES[self.name])
        if self.name == "cycles":
            self.scene = self.blend("room.blend")
        self.next = 0
        self.opened = self.open(self.scene)

    def blend(self, file, *more):
        """Has the same Blender that paints make the room."""
        path = os.path.join(self.scratch, file)
        script = os.path.join(HERE, "make_scenes.py")
        blender = "blender" in os.path.basename(self.worker.program).lower()
        start = [self.worker.program] + (["-b", "--factory-startup", "--python", script, "--"] if blender else [script])
        subprocess.run(start + [path, *more], stdin=subprocess.DEVNULL, stdout=self.worker.log, stderr=self.worker.log,
                       check=True, timeout=300)
        return path

    def open(self, scene, kind="opened", **more):
        request = {"do": "open", "scene": scene, "width": None, "height": None, "frame": None, "threads": self.threads,
                   "trust": False, "scratch": self.scratch, "parameters": {}}
        return self.worker.ask(kind, **dict(request, **more))

    def request(self, window, samples, seed=1, first_sample=0, **more):
        self.next += 1
        return dict({"do": "paint", "id": self.next, "window": window, "samples": samples, "seed": seed,
                     "first_sample": first_sample, "max_depth": None, "light_samples": None, "frame": None}, **more)

    def paint(self, window, samples, **more):
        """The picture of a window, cut out of what the worker wrote."""
        self.worker.shares = []
        answer = self.worker.ask("painted", **self.request(window, samples, **more))
        expect(answer["id"] == self.next, f"`painted` has the id {answer['id']}, not {self.next}")
        expect(answer["samples"] >= 1, "no samples were taken")
        picture = plain_exr.read(answer["file"])
        os.remove(answer["file"])
        x0, y0, x1, y1 = answer["window"]
        expect((picture.width, picture.height) == (x1 - x0, y1 - y0), "the file is not of the size that is told")
        left, top = window[0] - x0, window[1] - y0
        picture = picture.cut(left, top, left + window[2] - window[0], top + window[3] - window[1])
        expect({"R", "G", "B"} <= picture.channels.keys(), f"colors are missing: {sorted(picture.channels)}")
        for name in "RGB":
            expect(all(map(math.isfinite, picture.channels[name])), f"channel {name} holds values that are not finite")
        self.samples_taken = answer["samples"]
        return picture


def mean(values):
    return sum(values) / len(values)


def bits_equal(a, b):
    return all(a.channels[name].tobytes() == b.channels[name].tobytes() for name in a.channels)


def mark_on_film():
    """Where the mark is in the frame, in pixels: left, top, right, bottom."""
    left, right, low, high = make_scenes.MARK
    distance = make_scenes.MARK_DEPTH - make_scenes.EYE[1]
    scale = WIDTH / 2 / math.tan(math.radians(make_scenes.FIELD_OF_VIEW / 2)) / distance
    eye = make_scenes.EYE[2]
    return (WIDTH / 2 + left * scale, HEIGHT / 2 - (high - eye) * scale,
            WIDTH / 2 + right * scale, HEIGHT / 2 - (low - eye) * scale)


def centroid(picture):
    """Centre and area of the mark in pixels, by its red; partly covered pixels count by their share."""
    plane, width = picture.channels["R"], picture.width
    # The wall is of no more than 1.2, in any engine.
    level, background = make_scenes.LIGHTS["mark"][0], 1.2
    shares = [min(max((value - background) / (level - background), 0.0), 1.0) for value in plane]
    total = sum(shares)
    expect(total > 1.0, "the mark is not in the picture")
    x = sum(share * (index % width + 0.5) for index, share in enumerate(shares)) / total
    y = sum(share * (index // width + 0.5) for index, share in enumerate(shares)) / total
    return x, y, total


def check_opening(room):
    opened = room.opened
    expect((opened["width"], opened["height"]) == (WIDTH, HEIGHT), f"the frame is {opened['width']}x{opened['height']}")
    greeting = room.worker.greeting
    expect(greeting["engine"] == room.name and greeting["protocol"] == 1, f"it greets as {greeting}")
    expect(re.match(r"\d+\.\d+", greeting["version"]), f"the version is {greeting['version']}")
    small = room.open(room.scene, width=64, height=48)
    expect((small["width"], small["height"]) == (64, 48), "another size is not taken")
    at_half = centroid_of_mark(room, [0, 0, 64, 48], 0.5)
    room.open(room.scene)
    return f"version {greeting['version']}, mark at half the size off by {at_half:.2f} px"


def centroid_of_mark(room, window, scale=1.0):
    """How far the mark is from its place, in pixels."""
    left, top, right, bottom = (edge * scale for edge in mark_on_film())
    margin = 4
    around = [int(left) - margin, int(top) - margin, int(right) + margin + 1, int(bottom) + margin + 1]
    around = [max(around[0], window[0]), max(around[1], window[1]), min(around[2], window[2]), min(around[3], window[3])]
    whole = room.paint(window, 64)
    picture = whole.cut(*(edge - window[index % 2] for index, edge in enumerate(around)))
    x, y, area = centroid(picture)
    off = math.hypot(x + around[0] - (left + right) / 2, y + around[1] - (top + bottom) / 2)
    expect(off < 0.25, f"the mark is at ({x + around[0]:.2f}, {y + around[1]:.2f}) instead of "
                      f"({(left + right) / 2:.2f}, {(top + bottom) / 2:.2f})")
    wanted = (right - left) * (bottom - top)
    expect(abs(area / wanted - 1) < 0.3, f"the mark has an area of {area:.1f} pixels instead of {wanted:.1f}")
    return off


def check_place(room):
    """A bright mark, neither square nor centred, must be where geometry says, in the frame and in windows."""
    left, top, right, bottom = (int(edge) for edge in mark_on_film())
    worst = centroid_of_mark(room, WHOLE)
    for window in ([left - 9, top - 7, right + 10, bottom + 5], [0, 0, right + 12, bottom + 11],
                   [left - 6, top - 5, WIDTH, HEIGHT]):
        worst = max(worst, centroid_of_mark(room, window))
    return f"off by {worst:.2f} px at most"


def windows(count):
    """Windows of all sizes, those at the frame's edges and of a single pixel among them."""
    dice = random.Random(7)
    yield [0, 0, 1, 1]
    yield [WIDTH - 1, HEIGHT - 1, WIDTH, HEIGHT]
    yield [0, HEIGHT - 3, WIDTH, HEIGHT]
    yield [WIDTH - 5, 0, WIDTH, HEIGHT]
    for _ in range(count):
        x, y = sorted(dice.sample(range(WIDTH + 1), 2)), sorted(dice.sample(range(HEIGHT + 1), 2))
        yield [x[0], y[0], x[1], y[1]]


def check_window_is_frame(room):
    if EQUALITY[room.name] == BITS:
        whole = room.paint(WHOLE, 9)
        for window in windows(4 if room.name == "povray" else 12):
            expect(bits_equal(room.paint(window, 9), whole.cut(*window)), f"window {window} has other bits than the frame")
        if room.name == "povray":
            return f"the same bits; {check_photons(room)}; {check_radiosity(room)}"
        return "the same bits"
    runs = 5
    frames = [room.paint(WHOLE, 32, seed=100 + run) for run in range(runs)]
    shares = []
    for window in list(windows(2))[-2:] + [[17, 40, 81, 90], [WIDTH - 30, 0, WIDTH, 40]]:
        pieces = [room.paint(window, 32, seed=200 + run) for run in range(runs)]
        shares.append(compare([frame.cut(*window) for frame in frames], pieces, window))
    for window in ([0, 0, 1, 1], [WIDTH - 1, HEIGHT - 1, WIDTH, HEIGHT]):
        room.paint(window, 4)
    return f"{100 * max(shares):.2f} % of the blocks beyond 3.8 standard errors at most"


def check_photons(room):
    """Photons that are shot once, saved and loaded by all later windows, light the picture as those that it shoots itself."""
    with open(room.scene) as file:
        text = file.read()
    ball = ("sphere { <0.4, 0.9, -0.3>, 0.25 pigment { rgbt 1 } interior { ior 1.5 } finish { ambient 0 diffuse 0 }"
            " photons { target refraction on reflection on } }\n")
    settings = 'assumed_gamma 1.0 /* photons { */ photons { spacing 0.02 jitter 0 %s }'
    own = os.path.join(room.scratch, "own.map")
    pictures = []
    # Scenes that name a file themselves are left as they are. The ball that moves must not be lit by the photons of before.
    keeps, moved = f'save_file "{own}"', ball.replace("0.4, 0.9", "-0.3, 1.1")
    for name, named, more in (("shared", "", ball), ("own", keeps, ball), ("none", "", ""), ("again", "", ball),
                              ("moved", "", moved), ("moved_own", keeps, moved)):
        path = os.path.join(room.scratch, f"{name}.pov")
        with open(path, "w") as file:
            file.write(text.replace("assumed_gamma 1.0", settings % named) + more)
        room.open(path)
        pictures.append(room.paint(WHOLE, 4))
        if name == "shared":
            for window in ([0, 0, 64, 48], [64, 48, 128, 96], [30, 20, 94, 68]):
                expect(bits_equal(room.paint(window, 4), pictures[0].cut(*window)), f"photons light {window} otherwise")
    expect(bits_equal(pictures[0], pictures[1]), "photons that are loaded make another picture than those that are shot")
    expect(not bits_equal(pictures[0], pictures[2]), "the ball is not in the picture")
    expect(bits_equal(pictures[4], pictures[5]), "a scene is lit by the photons of the one that was open before")
    room.open(os.path.join(room.scratch, "shared.pov"))
    saved = [name for name in os.listdir(room.scratch) if re.fullmatch(r"photons\d+\.map", name)]
    expect(saved and os.path.isfile(own), f"no photons were saved: {sorted(os.listdir(room.scratch))}")
    room.open(room.scene)
    return "photons are shot once"


def check_radiosity(room):
    """Light that POV-Ray gathers at places of its own choice: windows are alike, and not the same."""
    room.open(room.scene, parameters={"declare": "Radiosity=1"})
    whole, worst = room.paint(WHOLE, 4), 0.0
    for window in ([0, 0, 64, 48], [64, 48, 128, 96], [30, 20, 94, 68]):
        part, cut = room.paint(window, 4), whole.cut(*window)
        off = mean([abs(value) for value in residual(part, cut)])
        expect(off < 0.01, f"with radiosity, window {window} is {off:.4f} off on average")
        worst = max(worst, off)
    expect(mean(whole.channels["R"]) > 0.5, "light that is gathered adds nothing")
    before = gathered_light(room)
    room.open(room.scene, parameters={"declare": "Radiosity=1", "jitter": "on"}, threads=1)
    room.paint([0, 0, 4, 4], 1)
    expect(len(before) == 1 and gathered_light(room) == before, "one thread gathers other light than two")
    for jitter in ("on", "off"):
        # Opened in full first, as for a look at the scene; the second time nothing has been gathered for the full frame.
        room.open(room.scene, parameters={"declare": "Radiosity=1", "jitter": jitter})
        room.open(room.scene, parameters={"declare": "Radiosity=1", "jitter": jitter}, width=32, height=24)
        room.paint([0, 0, 32, 24], 1)
        expect(gathered_light(room) == before, "a smaller frame gathers light of its own")
    room.open(room.scene)
    return f"with radiosity {worst:.4f} off on average at most"


def gathered_light(room):
    """Contents of the files in which POV-Ray's worker keeps radiosity."""
    files = [os.path.join(room.scratch, name) for name in sorted(os.listdir(room.scratch)) if name.endswith(".rca")]
    return [open(path, "rb").read() for path in files]


def compare(some, others, window):
    """Blocks of 4x4 pixels of two sets of runs, by Welch's t. Returns the share beyond t = 3.8, which chance exceeds in
    half a percent of all blocks when there are 8 degrees of freedom."""
    width, height = some[0].width, some[0].height
    beyond = count = 0
    total = [0.0, 0.0]
    for channel in "RGB":
        for top in range(0, height, 4):
            for left in range(0, width, 4):
                cut = (left, top, min(left + 4, width), min(top + 4, height))
                a = [block_mean(picture, channel, cut) for picture in some]
                b = [block_mean(picture, channel, cut) for picture in others]
                error = math.sqrt(variance(a) / len(a) + variance(b) / len(b) + 1e-10)
                beyond += abs(mean(a) - mean(b)) > 3.8 * error
                count += 1
                total[0] += mean(a)
                total[1] += mean(b)
    expect(beyond / count < 0.03 + 2 / count, f"window {window}: {beyond} of {count} blocks differ from the frame")
    expect(abs(total[0] / total[1] - 1) < 0.02, f"window {window}: mean {total[1] / total[0]:.4f} times the frame's")
    return beyond / count


def block_mean(picture, channel, cut):
    left, top, right, bottom = cut
    plane, width = picture.channels[channel], picture.width
    return mean([value for y in range(top, bottom) for value in plane[y * width + left:y * width + right]])


def variance(values):
    middle = mean(values)
    return sum((value - middle) ** 2 for value in values) / (len(values) - 1)


def residual(picture, reference):
    return [value - base for name in "RGB" for value, base in zip(picture.channels[name], reference.channels[name])]


def correlation(a, b):
    # Rank by sign and size below a bound: a few bright samples must not decide.
    bound = 3 * math.sqrt(mean([value * value for value in a + b]))
    a, b = ([min(max(value, -bound), bound) for value in values] for values in (a, b))
    return mean([x * y for x, y in zip(a, b)]) / math.sqrt(mean([x * x for x in a]) * mean([y * y for y in b]) + 1e-30)


def check_seeds(room):
    if not room.worker.manifest["seeds"]:
        return "the engine has none"
    window = [24, 30, 88, 78]
    reference = room.paint(window, 512, seed=9)
    first = residual(room.paint(window, 4, seed=1), reference)
    worst = 0.0
    for name, more in (("another seed", {"seed": 2}), ("later samples", {"seed": 1, "first_sample": 4}),
                       ("both", {"seed": 2, "first_sample": 4})):
        found = correlation(first, residual(room.paint(window, 4, **more), reference))
        expect(abs(found) < 0.08, f"{name}: noise is the same in part (correlation {found:.3f})")
        worst = max(worst, abs(found))
    again = residual(room.paint(window, 4, seed=1), reference)
    expect(REPEATS[room.name] or correlation(first, again) < 1.01, "no correlation can be above 1")
    if REPEATS[room.name]:
        expect(again == first, "the same window and seed give other bits")
    return f"correlation {worst:.3f} at most" + (", equal requests give equal bits" if REPEATS[room.name] else "")


def check_mean(room):
    """Three engines solve the same equation; POV-Ray's lamp is another, and is held to its own direct light."""
    picture = room.paint(WHOLE, 64)
    found = [mean(picture.channels[name]) for name in "RGB"]
    if room.name == "povray":
        expect(0.2 < found[0] < 0.6, f"the mean is {found}")
        return f"mean {found[0]:.4f}"
    wanted = (0.3284, 0.2436, 0.1220)
    off = max(abs(value / base - 1) for value, base in zip(found, wanted))
    expect(off < 0.01, f"the mean is {found} instead of {wanted}")
    return f"off by {100 * off:.2f} %"


def check_depth(room):
    """Direct light alone is less than all of it; a depth that is asked for does not stay."""
    window = [10, 20, 118, 90]
    deep = room.paint(window, 16)
    flat = room.paint(window, 16, max_depth=0)
    again = room.paint(window, 16)
    if room.name == "povray":
        return "the room mirrors nothing"
    ratio = mean(flat.channels["R"]) / mean(deep.channels["R"])
    expect(0.3 < ratio < 0.85, f"direct light is {ratio:.3f} of all light")
    expect(abs(mean(again.channels["R"]) / mean(deep.channels["R"]) - 1) < 0.03, "the depth asked for has stayed")
    return f"direct light is {100 * ratio:.0f} % of all light"


def check_time(room):
    """A window for which it has a second, and no end of samples."""
    if "time" not in room.worker.manifest["tunables"]:
        return "it paints until it has all samples"
    started = time.monotonic()
    picture = room.paint(WHOLE, 1 << 20, time=1)
    took = time.monotonic() - started
    expect(1 <= room.samples_taken < 1 << 20, f"it tells {room.samples_taken} samples")
    expect(took < 20, f"it took {took:.1f} s")
    found = mean(picture.channels["R"])
    expect(0.9 < found / 0.3284 < 1.1, f"the mean is {found}")
    return f"{room.samples_taken} samples in {took:.1f} s"


def check_progress(room):
    room.paint(WHOLE, 81 if room.name == "povray" else 256)
    shares = room.worker.shares
    expect(shares, "no progress is told")
    expect(all(0 <= share <= 1 for share in shares) and shares == sorted(shares), f"the progress goes {shares}")
    return f"told {len(shares)} times"


def check_layers(room):
    layers = {layer["name"]: layer["channels"] for layer in room.opened["layers"]}
    if room.name == "povray":
        expect(not layers, "POV-Ray has no layers")
        return "none"
    picture = room.paint([30, 10, 60, 50], 16)
    for name, channels in (("depth", ["Z"]), ("normal", ["X", "Y", "Z"]), ("albedo", ["R", "G", "B"])):
        expect(layers.get(name) == channels, f"layer {name} is not told, or as {layers.get(name)}")
    told = {f"{name}.{channel}" for name, channels in layers.items() for channel in channels}
    found = {name for name in picture.channels if "." in name}
    expect(told == found, f"told are {sorted(told)}, the file has {sorted(found)}")
    middle = room.paint([WIDTH // 2 + 24, 30, WIDTH // 2 + 26, 32], 64)
    depth = mean(middle.channels["depth.Z"])
    expect(4.8 < depth < 5.1, f"the wall at the back is at {depth:.3f} instead of 4.9")
    normal = mean(middle.channels["normal.Y"])
    expect(abs(normal + 1) < 0.02, f"its normal's y is {normal:.3f} instead of -1")
    albedo = mean(middle.channels["albedo.R"])
    expect(abs(albedo - 0.73) < 0.03, f"its albedo is {albedo:.3f} instead of 0.73")
    return ", ".join(layers) + (check_numbers(room) if room.name == "mitsuba" else "")


def check_numbers(room):
    """Mitsuba numbers shapes otherwise in each process: the worker tells their places in the file."""
    with open(room.scene) as file:
        text = file.read()
    path = os.path.join(room.scratch, "numbers.xml")
    with open(path, "w") as file:
        file.write(text.replace("a:albedo", "a:albedo,s:shape_index,p:prim_index"))
    order = re.findall(r'<shape type="rectangle" id="(\w+)"', text)
    expect([layer["name"] for layer in room.open(path)["layers"]][-2:] == ["p", "s"], "the numbers are no layers")
    middle = (WIDTH // 2, HEIGHT // 2)
    for shape, (x, y) in (("back", (middle[0] + 24, 30)), ("left", (middle[0] - 40, middle[1])),
                          ("right", (middle[0] + 40, middle[1]))):
        window = [x, y, x + 2, y + 2]
        picture = room.paint(window, 16)
        number = mean(next(picture.channels[name] for name in picture.channels if name.startswith("s.")))
        expect(abs(number - order.index(shape) - 1) < 1e-3, f"`{shape}` has the number {number}, not its place in {order}")
    room.open(room.scene)
    return "; shapes are numbered by their places in the file"


def check_frames(room):
    if room.name != "cycles":
        return "one"
    expect((room.opened["first_frame"], room.opened["last_frame"]) == (1, 3), "the frames are not those of the file")
    first, third = room.paint(WHOLE, 16, frame=1), room.paint(WHOLE, 16, frame=3)
    expect(not bits_equal(first, third), "frame 3 is frame 1")
    expect(bits_equal(first, room.paint(WHOLE, 16, frame=1)), "frame 1 does not come back")
    return "1 to 3"


def check_reopening(room):
    """A scene that is opened again, after another size, frame and depth, is the one of before."""
    before = room.paint(WHOLE, 4, seed=3)
    more = {"frame": 3} if room.name == "cycles" else {}
    room.open(room.scene, width=64, height=48, **more)
    small = room.paint([0, 0, 64, 48], 2, max_depth=1 if room.worker.manifest["tunables"].get("max_depth") else None)
    expect((small.width, small.height) == (64, 48), "the size is not that of the second request")
    started = time.monotonic()
    opened = room.open(room.scene)
    seconds = time.monotonic() - started
    expect(opened == room.opened, f"it was {room.opened}, and is {opened}")
    after = room.paint(WHOLE, 4, seed=3)
    expect(bits_equal(before, after) or not REPEATS[room.name], "the picture is another one")
    return f"the same after another size, in {seconds:.2f} s"


def scene_with(room, folder, old, new, name=None):
    """A copy of the room with a change in its text."""
    name = name or {"luxcore": "room.scn"}.get(room.name, SCENES[room.name])
    shutil.copytree(os.path.join(HERE, "scenes"), folder, dirs_exist_ok=True)
    path = os.path.join(folder, name)
    with open(path) as file:
        text = file.read()
    expect(old in text, f"{name} has no `{old}`")
    with open(path, "w") as file:
        file.write(text.replace(old, new, 1))
    return os.path.join(folder, SCENES[room.name])


def scene_with_missing_texture(room, folder):
    if room.name == "cycles":
        return room.blend("missing.blend", os.path.join(folder, "nowhere.png"))
    old, new = {
        "mitsuba": ('<rgb name="reflectance" value="0.73 0.71 0.68"/>',
                    '<texture type="bitmap" name="reflectance"><string name="filename" value="nowhere.png"/></texture>'),
        "luxcore": ("scene.materials.white.kd = 0.73 0.71 0.68",
                    'scene.textures.lost.type = "imagemap"\nscene.textures.lost.file = "nowhere.png"\n'
                    'scene.materials.white.kd = "lost"'),
        "povray": ("pigment { rgb <0.73, 0.71, 0.68> }", 'pigment { image_map { png "nowhere.png" } }')}[room.name]
    return scene_with(room, folder, old, new)


def check_errors(room):
    """What is wrong is told in the engine's words, and the worker goes on."""
    lost, broken = WORDS[room.name]
    folder = os.path.join(room.scratch, "wrong")
    os.makedirs(folder, exist_ok=True)

    failed = room.open(os.path.join(folder, "not_there" + os.path.splitext(room.scene)[1]), kind="failed")
    expect("no such file" in failed["reason"].lower(), f"a missing scene: {failed['reason']}")
    missing = scene_with_missing_texture(room, folder)
    texture = room.open(missing, kind="failed")
    expect("nowhere.png" in texture["reason"] and re.search(lost, texture["reason"], re.I),
           f"a missing texture: {texture['reason']}")
    listed = room.worker.ask("files", do="files", scene=missing)
    expect([os.path.basename(path) for path in listed["missing"]] == ["nowhere.png"], f"missing files: {listed}")

    path = os.path.join(folder, "broken" + os.path.splitext(room.scene)[1])
    with open(room.scene, "rb") as file:
        half = file.read()
    with open(path, "wb") as file:
        file.write(b'scene.file = \n[oops\n' if room.name == "luxcore" else half[:len(half) // 2])
    failed = room.open(path, kind="failed")
    expect(re.search(broken, failed["reason"], re.I | re.S), f"a broken scene: {failed['reason']}")

    refused = room.worker.ask("failed", **room.request(WHOLE, 1))
    expect("no scene" in refused["reason"], f"no scene is open, and it says: {refused['reason']}")
    room.open(room.scene)
    outside = room.worker.ask("failed", **room.request([0, 0, WIDTH + 1, HEIGHT], 1))
    expect("window" in outside["reason"] and not outside["fatal"], f"a window outside: {outside}")
    room.worker.ask("failed", do="dance")
    room.worker.process.stdin.write(b"{ no json\n")
    room.worker.process.stdin.flush()
    room.worker.answer("failed")
    room.paint([0, 0, 8, 8], 1)
    return f"texture: {texture['reason'][:70]!r}; scene: {failed['reason'][:70]!r}"


def check_files(room):
    listed = room.worker.ask("files", do="files", scene=room.scene)
    expect(not listed["missing"], f"missing files: {listed['missing']}")
    wanted = ["room.scn"] if room.name == "luxcore" else []
    expect([os.path.basename(path) for path in listed["files"]] == wanted, f"files: {listed['files']}")
    picture = room.paint([0, 0, 4, 4], 1)
    expect(picture.width == 4, "the scene is not open any more after `files`")
    return f"{len(listed['files'])}"


def check_costs(room):
    """Not a check: what a window of 64x64 pixels costs beside its samples."""
    room.paint([0, 0, 64, 64], 1)
    times = []
    for shift in range(5):
        started = time.monotonic()
        room.paint([shift, shift, shift + 64, shift + 64], 1)
        times.append(time.monotonic() - started)
    return f"a window of 64x64 pixels and 1 sample takes {sorted(times)[2]:.3f} s"


def check_leaving(room):
    room.worker.process.stdin.write(json.dumps(room.request(WHOLE, 65536 if room.name != "povray" else 81)).encode())
    room.worker.process.stdin.write(b"\n")
    room.worker.process.stdin.flush()
    time.sleep(0.5)
    started = time.monotonic()
    room.worker.process.stdin.close()
    try:
        code = room.worker.process.wait(timeout=30)
    except subprocess.TimeoutExpired:
        room.worker.process.kill()
        raise Failed("it goes on painting after the end of its stdin")
    seconds = time.monotonic() - started
    expect(code == 0, f"it ends with status {code}")
    return f"after {seconds:.2f} s, while painting"


CHECKS = (check_opening, check_place, check_window_is_frame, check_seeds, check_mean, check_depth, check_time, check_progress,
          check_layers, check_frames, check_reopening, check_files, check_errors, check_costs, check_leaving)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("name", choices=sorted(SCENES))
    parser.add_argument("--way", type=int, default=0)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--only")
    arguments = parser.parse_args()
    scratch = tempfile.mkdtemp(prefix=f"check_{arguments.name}_")
    started = time.monotonic()
    room = Room(arguments, scratch)
    print(f"{arguments.name} {room.worker.greeting['version']}, ready after "
          f"{time.monotonic() - room.worker.started:.2f} s or less; log in {scratch}")
    wrong = 0
    for check in CHECKS:
        name = check.__name__.removeprefix("check_").replace("_", " ")
        if arguments.only and arguments.only not in name:
            continue
        begun = time.monotonic()
        try:
            told = check(room)
            print(f"  ok     {name}: {told} ({time.monotonic() - begun:.1f} s)", flush=True)
        except Failed as failure:
            wrong += 1
            print(f"  WRONG  {name}: {failure}", flush=True)
            if room.worker.process.poll() is not None:
                break
            room.open(room.scene)
    if room.worker.process.poll() is None:
        room.worker.process.kill()
    print(f"{wrong} wrong, {time.monotonic() - started:.0f} s")
    if not wrong:
        shutil.rmtree(scratch)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
