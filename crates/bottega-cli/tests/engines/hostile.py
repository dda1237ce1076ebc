"""A worker that does what it should not, as the text of its scene says."""
import array, json, os, signal, subprocess, sys, time
import plain_exr

opened = {}
answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)

def say(**answer):
    print(json.dumps(answer), file=answers, flush=True)

def picture(path, width, height, color):
    channels = {}
    for i, name in enumerate("RGB"):
        channels[name] = array.array("f", [color(x, y)[i] for y in range(height) for x in range(width)])
    plain_exr.write(path, width, height, channels)

def layers(mode):
    """The layers of the scene."""
    if mode == "layers":
        return [{"name": "id", "channels": ["Y"], "combine": "pick"}, {"name": "normal", "channels": ["X", "Y", "Z"]},
                {"name": "two", "channels": ["a", "b"]}]
    if mode == "no such layer":
        return [{"name": "depth", "channels": ["Z"]}]
    if mode == "many layers":
        return [{"name": str(i), "channels": ["Y"]} for i in range(1000)]
    if mode == "nameless layer":
        return [{"name": "a\0b", "channels": ["Y"]}]
    return []

def layered(x, y):
    """The color, alpha, and the layers of the mode `layers`, by where the pixel is."""
    return {"R": x / 8, "G": y / 8, "B": 1.0, "A": x / 128, "id.Y": x * 1000.0 + y, "normal.X": x * 1.0,
            "normal.Y": y * 1.0, "normal.Z": 0.5, "two.a": x + y, "two.b": x - y}

def sound(x, y):
    return (x / 8, y / 8, 1.0)

def description(mode):
    """Further fields of the description of a scene."""
    if mode == "wide filter":
        return {"filter": {"kind": "tent", "radius": 1e30}}
    if mode.startswith("dear windows"):
        return {"window_seconds": float(mode.removeprefix("dear windows"))}
    return {}

def opens(path, how):
    """Whether a file can be opened."""
    try:
        open(path, how).close()
        return True
    except OSError:
        return False

def paint(request, mode, size, scratch):
    if mode.startswith("dear windows"):
        with open(os.environ["TRACE"], "a") as trace:
            trace.write("window ")
    x0, y0, x1, y1 = request["window"]
    path = os.path.join(scratch, f"{request['id']}.exr")
    color, width, height = sound, x1 - x0, y1 - y0
    if mode.startswith("early "):
        mode = mode[6:]
    elif size[0] * size[1] <= 4096:
        mode = "sound"
    if mode == "nan":
        color = lambda x, y: (float("nan"), 1.0, 1.0)
    if mode == "black":
        color = lambda x, y: (0.0, 0.0, 0.0)
    if mode == "frames":
        color = lambda x, y: (float(request["frame"]), 0.0, 0.0)
    taken = request["samples"]
    if mode == "early":
        # Of each window but the first it takes one sample alone, which is brighter.
        with open(os.environ["TRACE"], "a") as trace:
            trace.write(json.dumps(request) + "\n")
        time.sleep(0.1)
        if request["first_sample"] > 0:
            color, taken = (lambda x, y: (3.0, 3.0, 3.0)), 1
        else:
            color = lambda x, y: (1.0, 1.0, 1.0)
    at = (lambda x, y: color(x + x0, y + y0))
    if mode == "size":
        width += 1
    if mode == "refuses":
        return say(failed={"id": request["id"], "reason": "texture `wood.png` is not to my taste", "fatal": False})
    if mode == "crash" or mode == "once" and not os.path.exists(os.environ["TRACE"]):
        open(os.environ["TRACE"], "w").close()
        print("about to fall", file=sys.stderr, flush=True)
        os.abort()
    if mode == "hang":
        time.sleep(3600)
    if mode == "flood":
        while True:
            print("all work and no play" * 50, file=sys.stderr)
    if mode == "forks":
        for _ in range(5):
            subprocess.Popen(["/bin/sh", "-c", f"trap '' TERM; exec setsid sleep 3601 # {os.environ['TRACE']}"])
    if mode == "nonsense":
        print('{"painted": 3}', file=answers, flush=True)
        return
    if mode == "elsewhere":
        return say(painted={"id": request["id"], "file": "/etc/hostname", "window": request["window"], "samples": 1})
    if mode == "network":
        import socket
        try:
            socket.create_connection(("127.0.0.1", int(os.environ["PORT"])), timeout=5)
            color = lambda x, y: (1.0, 0.0, 0.0)
        except OSError:
            color = lambda x, y: (0.0, 1.0, 0.0)
        at = color
    if mode.startswith("secret "):
        place, scene = mode.removeprefix("secret "), opened["scene"]
        could = [opens(place, "r"), opens(place + ".new", "w"), opens(scene, "a")]
        at = color = lambda x, y: tuple(1.0 if done else 0.25 for done in could)
    if mode == "layers":
        pixels = [layered(x + x0, y + y0) for y in range(height) for x in range(width)]
        planes = {name: array.array("f", [pixel[name] for pixel in pixels]) for name in pixels[0]}
        plain_exr.write(path, width, height, planes)
    elif mode != "nothing":
        picture(path, width, height, at)
    if mode == "half":
        with open(path, "r+b") as file:
            file.truncate(os.path.getsize(path) // 2)
    say(progress={"id": request["id"], "share": 0.5})
    say(painted={"id": request["id"], "file": path, "window": request["window"], "samples": taken})

def main():
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    say(ready={"engine": "hostile", "version": "1.0", "protocol": 1})
    mode, size, scratch = "", (0, 0), ""
    for line in sys.stdin:
        request = json.loads(line)
        if request["do"] == "open":
            opened["scene"] = request["scene"]
            with open(request["scene"]) as file:
                mode = file.read().strip()
            if mode == "frames":
                with open(os.environ["TRACE"], "a") as trace:
                    trace.write(f"{os.getpid()}\n")
            if mode == "unreadable":
                say(failed={"id": None, "reason": "line 1: I do not know the word `unreadable`", "fatal": False})
                continue
            size, scratch = (request["width"] or 96, request["height"] or 64), request["scratch"]
            say(opened={"width": size[0], "height": size[1], "frame": request["frame"], "layers": layers(mode), **description(mode)})
        elif request["do"] == "paint":
            paint(request, mode, size, scratch)
        elif request["do"] == "files":
            say(files={"files": [], "missing": []})
    if mode == "forks":
        # It has heard that nobody needs it any more, and stays.
        time.sleep(3600)

main()
