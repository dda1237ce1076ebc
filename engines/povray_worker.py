"""The worker of POV-Ray (see line_protocol.py). POV-Ray cannot keep a scene: it is started for each window, and reads
the scene each time. This worker knows its sizes and settings, passes on its progress, and cuts what it wrote.

Scenes: `.pov`, and `.ini` that names one. Debian's POV-Ray reads files only below the folder that it is started in, the
home folder and /tmp: it is started with the folder of the scene's files as its home.

`parameters` of `open`: `declare` ("Name=value Name={light_samples}": set before the scene is read; `{samples}`,
`{light_samples}` and `{max_depth}` are what is asked for), `library` (further folders, by `:`), `final_frame` and
`initial_frame` (an animation whose .ini does not say so), `jitter` ("off" or "on"), `radiosity` ("shared": gathered once
for the whole frame and used by all windows, see povray_gathered.py; "window": gathered for each, which shows at the
seams).
"""

import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

from line_protocol import Line, Refusal, serve, sorted_files

LINE = Line()

import math
import re
import shutil
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor

import plain_exr
from povray_files import common_folder, has_own_includes, referred_files
from povray_gathered import Photons, Radiosity, names_radiosity

DEFAULT_FRAME = (640, 480)
LARGEST_GRID = 9  # POV-Ray's own bound of +R for method 1.
LINES_OF_LOG = 400
PHOTON_TIME = re.compile(r"Photon Time:.*\(([\d.]+) seconds\)")
RENDERED = re.compile(rb"Rendered (\d+) of (\d+) pixels")
REASON = re.compile(r"error|cannot|could not|failed|not found|no such|out of memory|undeclared|expected", re.I)
NOISE = re.compile(r"^povray: cannot open the user configuration file|I/O restrictions are disabled")


def program():
    found = os.environ.get("BOTTEGA_POVRAY") or shutil.which("povray")
    if not found:
        raise Refusal("POV-Ray's program `povray` is not in the search path", fatal=True)
    return found


def version_of(path):
    shown = subprocess.run([path, "--version"], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                           stderr=subprocess.STDOUT, timeout=30).stdout.decode(errors="replace")
    numbers = re.search(r"POV-Ray (?:VERSION )?v?(\d+\.\d+[.\w-]*)", shown)
    return numbers[1] if numbers else "unknown"


def read_ini(path):
    """Settings of an .ini file before its first section, by lower-case name."""
    settings = {}
    with open(path, errors="replace") as file:
        for line in file:
            line = line.split(";", 1)[0].strip()
            if line.startswith("["):
                break
            name, is_setting, value = line.partition("=")
            if is_setting:
                settings[name.strip().lower()] = value.strip().strip('"')
    return settings


def size_in_comment(path):
    """The size that a scene's first lines recommend, as in `// +W640 +H480`."""
    with open(path, errors="replace") as file:
        head = "".join(file.readline() for _ in range(60))
    found = re.search(r"//.*?[-+]w\s?(\d+)\s+[-+]h\s?(\d+)", head, re.I)
    return (int(found[1]), int(found[2])) if found else DEFAULT_FRAME


class PovRay:
    name = "povray"

    def __init__(self):
        self.program = program()
        self.version = version_of(self.program)
        self.children = []
        self.seen = None
        LINE.on_leave = self._end_children

    def _end_children(self):
        for child in self.children:
            if child.poll() is None:
                child.kill()

    def open(self, request):
        parameters = request.get("parameters") or {}
        scene = os.path.abspath(request["scene"])
        self.ini = None
        settings = {}
        if scene.lower().endswith(".ini"):
            self.ini = scene
            settings = read_ini(scene)
            if "input_file_name" not in settings:
                raise Refusal(f"{scene} has no Input_File_Name")
            scene = os.path.join(os.path.dirname(scene), settings["input_file_name"])
            if not os.path.isfile(scene):
                raise Refusal(f"{scene}: no such file (Input_File_Name of {self.ini})")
        self.scene, self.scratch = scene, os.path.abspath(request["scratch"])
        self.threads = max(1, int(request.get("threads") or 1))
        self.library = [folder for folder in str(parameters.get("library") or "").split(":") if folder]
        self.library += [value for name, value in settings.items() if name == "library_path"]
        self.declare = str(parameters.get("declare") or "").split()
        self.jitter = str(parameters.get("jitter") or "off").lower() == "on"
        files, self.missing = referred_files(scene, self.library)
        self.home = common_folder([scene] + files)
        shares = (str(parameters.get("radiosity") or "shared") == "shared"
                  and any(names_radiosity(path) for path in [scene] + files))
        width, height = size_in_comment(scene)
        self.width = int(request.get("width") or settings.get("width", width))
        self.height = int(request.get("height") or settings.get("height", height))
        self.first_frame = int(parameters.get("initial_frame") or settings.get("initial_frame", 1))
        self.last_frame = int(parameters.get("final_frame") or settings.get("final_frame", self.first_frame))
        self.frame = self.first_frame if request.get("frame") is None else int(request["frame"])
        seen = self._state([scene, self.ini, *files], parameters)
        if seen != self.seen:
            self.seen = None
            self.photons, self.radiosity = Photons(scene, self.scratch), Radiosity(self.scratch) if shares else None
            self.largest = (0, 0)
            self.window_seconds = self._try_scene()
            self.seen = seen
        # A look at the scene opens it again, smaller: what is gathered for that is to do for all of it.
        self.largest = max(self.largest, (self.width, self.height))
        return {"width": self.width, "height": self.height, "first_frame": self.first_frame,
                "last_frame": self.last_frame, "frame": self.frame, "window_seconds": self.window_seconds, "layers": []}

    def _state(self, files, parameters):
        """What is the same when the scene is opened again, at another size, say: then what was gathered is kept."""
        stats = [(path, os.stat(path).st_mtime_ns, os.stat(path).st_size) for path in files if path]
        return stats, self.scratch, self.frame, self.first_frame, self.last_frame, sorted(map(str, parameters.items()))

    def _try_scene(self):
        """Reads the scene for a single pixel: what is wrong with it is told now. Returns what a window costs beside its
        samples, in seconds."""
        begun, shooting = time.monotonic(), 0
        settings = self._settings((0, 0, 1, 1), 1, self.frame, None, None, "opened.exr")
        if self.photons.place is None or self._asks_for_samples():
            self._start(settings + ["Quality=0"], lambda share: None)
        else:
            shooting = self._with_photons(self._key(self.frame, None, None, 1), settings, lambda share: None)
        return time.monotonic() - begun - shooting

    def paint(self, order, path, progress):
        window = order.window
        if order.light_samples is not None and not any("{light_samples}" in item for item in self.declare):
            raise Refusal("POV-Ray's light samples are the scene's own; a scene that takes their number by a constant "
                          "can be given it with `declare`")
        grid = min(max(1, math.ceil(math.sqrt(order.samples) - 1e-9)), LARGEST_GRID)
        frame = self.frame if order.frame is None else order.frame
        written = f"{order.id}.povray.exr"
        place = self._place(written, frame)
        if os.path.exists(place):
            os.remove(place)
        settings = self._settings((window.x0, window.y0, window.x1, window.y1), grid, frame, order.max_depth,
                                  order.light_samples, written)
        key = self._key(frame, order.max_depth, order.light_samples, grid)
        begun = time.monotonic()
        radiosity = self._radiosity(key)
        once = time.monotonic() - begun
        once += self._with_photons(key, settings + radiosity, progress)
        if not os.path.isfile(place):
            raise Refusal("POV-Ray finished and wrote no picture")
        picture = plain_exr.read(place, rows=(window.y0, window.y1))
        os.remove(place)
        if (picture.width, picture.height) != (self.width, self.height):
            raise Refusal(f"POV-Ray wrote {picture.width}x{picture.height} pixels instead of {self.width}x{self.height}")
        cut = picture.cut(window.x0, window.y0, window.x1, window.y1)
        plain_exr.write(path, cut.width, cut.height, cut.channels)
        return window, grid * grid, once

    def _place(self, name, frame):
        """Where POV-Ray writes a picture: in an animation it puts the frame into the name, with the digits of the last."""
        stem, kind = os.path.splitext(name)
        if self.last_frame > self.first_frame:
            stem += str(frame).zfill(len(str(self.last_frame)))
        return os.path.join(self.scratch, stem + kind)

    def _settings(self, window, grid, frame, max_depth, light_samples, written):
        """Lines of an .ini file. POV-Ray counts columns and rows from 1, and the last ones belong to the window. A last
        one of 1 would be the share of a frame, all of it: then one more is painted."""
        x0, y0, x1, y1 = window
        lines = [f'Input_File_Name="{self.scene}"', f"Width={self.width}", f"Height={self.height}",
                 f"Start_Column={x0 + 1}", f"End_Column={min(max(x1, 2), self.width)}",
                 f"Start_Row={y0 + 1}", f"End_Row={min(max(y1, 2), self.height)}",
                 f'Output_File_Name="{written}"', "Output_to_File=on", "Output_File_Type=E", "File_Gamma=1.0",
                 "Display=off", "Pause_when_Done=off", "Verbose=on", "Continue_Trace=off", "Create_Histogram=off",
                 f"Work_Threads={self.threads}", "Output_Alpha=off", "Bits_Per_Color=16"]
        # A threshold of 0 takes a grid in each pixel whose neighbours are not exactly the same.
        lines += ["Antialias=off"] if grid == 1 else [
            "Antialias=on", "Sampling_Method=1", "Antialias_Threshold=0.0", f"Antialias_Depth={grid}",
            f"Jitter={'on' if self.jitter else 'off'}"]
        lines += [f'Library_Path="{folder}"' for folder in [os.path.dirname(self.scene)] + self.library]
        asked = {"samples": grid * grid, "light_samples": light_samples, "max_depth": max_depth}
        for item in self.declare:
            name, _, value = item.partition("=")
            value = re.sub(r"\{(\w+)\}", lambda found: str(asked.get(found[1])), value)
            if "None" not in value:
                lines.append(f"Declare={name}={value}")
        if self.last_frame > self.first_frame:
            lines += [f"Initial_Frame={self.first_frame}", f"Final_Frame={self.last_frame}",
                      f"Subset_Start_Frame={frame}", f"Subset_End_Frame={frame}"]
        return lines

    def _asks_for_samples(self):
        return any("{samples}" in item for item in self.declare)

    def _key(self, frame, max_depth, light_samples, grid):
        """What gathered light depends on beside the scene. `grid`: samples along each side of a pixel."""
        return frame, max_depth, light_samples, grid if self._asks_for_samples() else 1

    def _with_photons(self, key, settings, progress):
        """Runs POV-Ray with these settings and the photons of the frame: shoots and saves them, if they are not there. Returns
        the seconds which that took that will not be taken again."""
        is_there = self.photons.has(key)
        scene = self._scene_of_depth(self.photons.scene_for(key), key[1])
        try:
            log = self._start(settings + [f'Input_File_Name="{scene}"'], progress)
        except Refusal:
            self.photons.forget(key)
            raise
        told = [float(found[1]) for line in log if (found := PHOTON_TIME.search(line))]
        return sum(told) if self.photons.has(key) and not is_there else 0

    def _radiosity(self, key):
        """Settings that have a window use what was gathered for the whole frame."""
        if not self.radiosity:
            return []
        frame, max_depth, light_samples, grid = key

        def run(jobs):
            pictures = [f"gathered{index}.exr" for index in range(len(jobs))]
            scene = self._scene_of_depth(self.scene, max_depth)
            settings = [self._settings((0, 0, 1, 1), grid, frame, max_depth, light_samples, picture)
                        + [f'Input_File_Name="{scene}"'] + job for picture, job in zip(pictures, jobs)]
            together = min(self.threads, len(jobs))
            for first in range(0, len(jobs), together):
                self._start_all(settings[first:first + together], lambda share: None)
            for picture in pictures:
                os.remove(self._place(picture, frame))

        return self.radiosity.settings(key, *self.largest, run)

    def _scene_of_depth(self, scene, max_depth):
        """A scene itself, or one that reads it and then sets how often light is followed: 1 is no reflection."""
        if max_depth is None:
            return scene
        with open(self.scene, errors="replace") as file:
            version = re.search(r"^\s*#version\s+[\w.]+\s*;", file.read(), re.M)
        path = os.path.join(self.scratch, "with_depth.pov")
        with open(path, "w") as file:
            file.write(f'{version[0].strip() if version else ""}\n#include "{scene}"\n'
                       f"global_settings {{ max_trace_level {max_depth + 1} }}\n")
        return path

    def _start(self, settings, progress):
        return self._start_all([settings], progress)[0]

    def _start_all(self, jobs, progress):
        """Runs POV-Ray with each of these settings at the same time, to the end. Returns their logs' ends. Raises its own
        words when one fails."""
        if self.ini:
            shutil.copyfile(self.ini, os.path.join(self.scratch, "scene.ini"))
        environment = dict(os.environ, HOME=self.home)
        self.children = []
        for index, settings in enumerate(jobs):
            names = (["scene.ini"] if self.ini else []) + [f"bottega{index}.ini"]
            with open(os.path.join(self.scratch, names[-1]), "w") as file:
                file.write("\n".join(settings) + "\n")
            self.children.append(subprocess.Popen([self.program] + names, cwd=self.scratch, env=environment,
                                                  stdin=subprocess.DEVNULL, stdout=2, stderr=subprocess.PIPE))
        with ThreadPoolExecutor(len(jobs)) as threads:
            logs = list(threads.map(lambda child: self._follow(child, progress), self.children))
        codes = [child.wait() for child in self.children]
        self.children = []
        for code, log in zip(codes, logs):
            if code != 0:
                raise Refusal(self._reason(code, log))
        return logs

    def _reason(self, code, log):
        reason = reason_in(log) or f"POV-Ray ended with status {code}"
        # The copy that names a file of photons has the lines of the scene itself.
        reason = reason.replace(os.path.join(self.scratch, "with_photons.pov"), self.scene)
        if self.missing and "pars" in reason.lower():
            reason += "; these files are missing: " + ", ".join(self.missing[:5])
            if not has_own_includes() and any(path.lower().endswith(".inc") for path in self.missing):
                reason += "; the include files that come with POV-Ray are not installed (Debian: apt install povray-includes)"
        return reason

    def _follow(self, child, progress):
        """Passes the log on, and the progress that POV-Ray tells between carriage returns; returns the log's end."""
        log, pending = [], b""
        while piece := child.stderr.read1(1 << 14):
            *lines, pending = re.split(rb"[\r\n]", pending + piece)
            # POV-Ray ends a line of progress by no line feed; it is whole when it shows its percents.
            if pending.endswith(b"%)"):
                lines.append(pending)
                pending = b""
            for line in lines:
                counted = RENDERED.search(line)
                if counted:
                    progress(int(counted[1]) / max(int(counted[2]), 1))
                elif line.strip():
                    os.write(2, line + b"\n")
                    log = (log + [line.decode(errors="replace").strip()])[-LINES_OF_LOG:]
        return log

    def files(self, path):
        scene = os.path.abspath(path)
        found = []
        library = []
        if scene.lower().endswith(".ini"):
            settings = read_ini(scene)
            library = [settings["library_path"]] if "library_path" in settings else []
            scene = os.path.join(os.path.dirname(scene), settings.get("input_file_name", ""))
            found.append(scene)
        if os.path.isfile(scene):
            files, missing = referred_files(scene, library)
            found += files + missing
        return sorted_files(found)


def reason_in(log):
    """What POV-Ray said went wrong: the place and the error, without the scene's text between them."""
    told = [line for line in log if REASON.search(line) and not NOISE.search(line)]
    return "; ".join(dict.fromkeys(told[-4:]))


if __name__ == "__main__":
    try:
        worker = PovRay()
    except (Refusal, OSError, subprocess.SubprocessError) as error:
        LINE.fail(str(error), fatal=True)
        LINE.leave(1)
    serve(LINE, worker)
