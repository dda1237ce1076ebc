"""Light that POV-Ray gathers for a whole frame before it paints: radiosity and photons. Here it is gathered once, kept in
files beside the pictures, and used by all windows of the frame.

*Photons* are shot by the first run that needs them: it saves them, and later ones load them. For that their block in the
scene's `global_settings` is given the name of a file, in a copy of the scene. Where that block stands in an include, or
names a file itself, each window shoots its own.

*Radiosity* is gathered over the frame at half its size, the upper and the lower half by a process each, of one thread: so
every machine gathers the same, whatever processors it has. A smaller frame of the same scene takes what a larger one has.
"""

import os
import re

HIDDEN = re.compile(r'"(?:[^"\\\n]|\\.)*"|//[^\n]*|/\*.*?\*/', re.S)
STRIPS = 2


def bare(text):
    """The text with blanks in place of comments and strings: all else stays where it was."""
    return HIDDEN.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)


def block(text, name, begin, end):
    """Where the inside of the first `name { … }` between these places begins and ends; None if there is none."""
    found = re.compile(rf"\b{name}\s*\{{").search(text, begin, end)
    if not found:
        return None
    depth = 1
    for brace in re.compile(r"[{}]").finditer(text, found.end(), end):
        depth += 1 if brace[0] == "{" else -1
        if depth == 0:
            return found.end(), brace.start()
    return None


def place_of_photons(text):
    """Where the name of a file belongs in the block of photons of a scene's settings; None: there is no such block, or it
    has a name already."""
    seen, begin = bare(text), 0
    while settings := block(seen, "global_settings", begin, len(seen)):
        photons = block(seen, "photons", *settings)
        if photons:
            names_file = re.search(r"\b(save_file|load_file)\b", seen[slice(*photons)])
            return None if names_file else photons[0]
        begin = settings[1]
    return None


def names_radiosity(path):
    """Whether a scene or include has a block of radiosity."""
    if not path.lower().endswith((".pov", ".inc", ".mac")):
        return False
    with open(path, errors="replace") as file:
        return re.search(r"\bradiosity\s*\{", bare(file.read())) is not None


def text_of(path):
    """Texts of POV-Ray are of no encoding that is known: each byte is a letter."""
    with open(path, encoding="latin-1", newline="") as file:
        return file.read()


def remove_leftovers(scratch, kind):
    """Removes what was gathered for a scene that was open before: its light is not that of this one."""
    for name in os.listdir(scratch):
        if name.startswith(("photons", "radiosity")) and name.endswith(kind):
            os.remove(os.path.join(scratch, name))


class Photons:
    """Photons of a scene, by the settings that they depend on."""

    def __init__(self, scene, scratch):
        self.scene, self.scratch = scene, scratch
        self.text = text_of(scene)
        self.place = place_of_photons(self.text)
        self.kept = {}
        remove_leftovers(scratch, ".map")

    def scene_for(self, key):
        """The scene to be read in place of the scene itself: it saves the photons, or loads them if they were saved."""
        if self.place is None:
            return self.scene
        if key not in self.kept:
            self.kept[key] = os.path.join(self.scratch, f"photons{len(self.kept)}.map")
        kept = self.kept[key]
        verb = "load_file" if self.has(key) else "save_file"
        path = os.path.join(self.scratch, "with_photons.pov")
        before, after = (part.encode("latin-1") for part in (self.text[:self.place], self.text[self.place:]))
        with open(path, "wb") as file:
            file.write(before + f' {verb} "'.encode() + os.fsencode(kept) + b'" ' + after)
        return path

    def has(self, key):
        """Whether they were shot and saved."""
        return key in self.kept and os.path.isfile(self.kept[key])

    def forget(self, key):
        """After a run that failed: who knows what it saved."""
        if self.has(key):
            os.remove(self.kept[key])


class Radiosity:
    """Light that was gathered for a scene, by the settings that it depends on."""

    def __init__(self, scratch):
        self.scratch = scratch
        self.kept = {}
        self.runs = 0
        remove_leftovers(scratch, ".rca")

    def settings(self, key, width, height, run):
        """Lines of an .ini file with which a window of a frame of this size uses what was gathered.

        - `run`: runs POV-Ray with several lists of further lines at the same time, each with a name of its own.
        """
        if key not in self.kept or self.kept[key][0] < width:
            self.kept[key] = (width, self._gather(width, height, run))
        file = self.kept[key][1]
        return [f'Radiosity_File_Name="{file}"', "Radiosity_From_File=on", "Radiosity_Vain_Pretrace=off"] if file else []

    def _gather(self, width, height, run):
        self.runs += 1
        width, height = (width + 1) // 2, (height + 1) // 2
        edges = [height * strip // STRIPS for strip in range(STRIPS + 1)]
        names, jobs = [], []
        for top, bottom in zip(edges, edges[1:]):
            if top == bottom:
                continue
            names.append(f"radiosity{self.runs}_{top}.rca")
            jobs.append([f"Width={width}", f"Height={height}", "Start_Column=1", f"End_Column={width}",
                         f"Start_Row={top + 1}", f"End_Row={bottom}", "Work_Threads=1", "Antialias=off",
                         "Radiosity_To_File=on", f'Radiosity_File_Name="{names[-1]}"'])
        run(jobs)
        return self._joined(names)

    def _joined(self, names):
        """All files of these names as one, of lines in the order of the names. A scene may name radiosity and not use it:
        then there are none, or nothing in them, and the answer is None."""
        gathered = b""
        for path in (os.path.join(self.scratch, name) for name in names):
            if os.path.isfile(path):
                with open(path, "rb") as part:
                    gathered += part.read()
                os.remove(path)
        if not gathered:
            return None
        joined = f"radiosity{self.runs}.rca"
        with open(os.path.join(self.scratch, joined), "wb") as whole:
            whole.write(gathered)
        return joined
