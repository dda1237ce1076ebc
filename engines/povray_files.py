"""Which files a POV-Ray scene names, found in its text: includes, pictures, heights, densities, fonts and data files.

Names that a scene puts together (`concat("map", str(frame, 0, 0), ".png")`) cannot be found this way.
"""

import glob
import os
import re

DEFAULT_LIBRARY = sorted(glob.glob("/usr/share/povray*/include") + glob.glob("/usr/local/share/povray*/include")
                         + glob.glob("/usr/share/povray*/ini") + glob.glob("/opt/homebrew/share/povray*/include"))
BUILT_IN_FONTS = {"cyrvetic.ttf", "timrom.ttf", "crystal.ttf", "povlogo.ttf"}
COMMENTS = re.compile(r'("(?:[^"\\\n]|\\.)*")|//[^\n]*|/\*.*?\*/', re.S)
NAMED = re.compile(r'(?:#\s*include|\b(?:gif|tga|iff|ppm|pgm|png|jpeg|jpg|tiff|tif|exr|hdr|sys|pot|bmp|df3|ttf)|'
                   r'#\s*fopen\s+\w+)\s*"([^"\n]+)"')
WRITTEN = re.compile(r'#\s*fopen\s+\w+\s*"([^"\n]+)"\s*(?:write|append)')
MOST_FILES = 10000


def referred_files(scene, library):
    """-> (files that are there, missing ones as they would stand beside the scene). Files of POV-Ray itself are left out."""
    scene = os.path.abspath(scene)
    folder = os.path.dirname(scene)
    places = [folder] + [os.path.join(folder, place) for place in library]
    found, missing, waiting, seen = [], [], [scene], {scene}
    while waiting and len(seen) < MOST_FILES:
        with open(waiting.pop(), errors="replace") as file:
            text = COMMENTS.sub(lambda match: match[1] or " ", file.read())
        written = set(WRITTEN.findall(text))
        for name in NAMED.findall(text):
            if name in written or os.path.basename(name) in BUILT_IN_FONTS:
                continue
            path = next((os.path.normpath(os.path.join(place, name)) for place in places
                         if os.path.isfile(os.path.join(place, name))), None)
            if path is None:
                if not any(os.path.isfile(os.path.join(place, name)) for place in DEFAULT_LIBRARY):
                    missing.append(os.path.join(folder, name))
            elif path not in seen:
                seen.add(path)
                found.append(path)
                if path.lower().endswith((".inc", ".pov", ".mac", ".map")):
                    waiting.append(path)
    return sorted(found), sorted(set(missing))


def has_own_includes():
    """Whether the include files of POV-Ray itself are here: Debian keeps them in a package of their own."""
    return any(os.path.isfile(os.path.join(place, "colors.inc")) for place in DEFAULT_LIBRARY)


def common_folder(paths):
    """The deepest folder that holds all of these."""
    return os.path.commonpath([os.path.dirname(os.path.abspath(path)) for path in paths])
