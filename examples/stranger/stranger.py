#!/usr/bin/env python3
"""A render agent of another platform: it takes part in a picture of a Bottega farm by FIPA messages over HTTP, and paints its
zones with Mitsuba 3. Nothing else is needed than Python and `pip install mitsuba`.

    bottega up                                                          # one shell
    bottega render room.xml -o room.exr --farm --strangers              # another one
    python3 stranger.py                                                 # a third: it finds the job by itself

What is said is the ontology `bottega-painting`: docs/strangers.md.
"""

import argparse
import email.parser
import http.client
import http.server
import os
import queue
import re
import signal
import socket
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.parse
import urllib.request
import uuid
from xml.sax.saxutils import escape

TOKEN = re.compile(r'\s*(?:([()])|"((?:[^"\\]|\\.)*)"|([^\s()"]+))', re.S)


def parse(text):
    """An expression of SL, or a message in FIPA's string form: lists of texts."""
    stack = [[]]
    for bracket, string, word in TOKEN.findall(text):
        if bracket == "(":
            stack.append([])
        elif bracket == ")":
            done = stack.pop()
            stack[-1].append(done)
        else:
            stack[-1].append(word or re.sub(r"\\(.)", r"\1", string, flags=re.S))
    return stack[0]


def write(term):
    if isinstance(term, list):
        return "(" + " ".join(write(item) for item in term) + ")"
    text = str(term)
    if text and not re.search(r'[\s()"\\#@]', text[1:]) and not re.match(r'[\d"#@()\\-]', text) or re.fullmatch(r"-?[\d.]+(e-?\d+)?", text):
        return text
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def fields(term):
    """The named parameters of `(head :name value …)`."""
    return {key[1:].lower(): value for key, value in zip(term[1::2], term[2::2])}


def aid(name, address=None):
    return ["agent-identifier", ":name", name] + ([":addresses", ["sequence", address]] if address else [])


class Transport:
    """FIPA's message transport over HTTP: one address for what comes, one connection for each message that goes."""

    def __init__(self, name, listen, hear):
        came = queue.Queue()

        class Handler(http.server.BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def do_POST(self):
                body = self.rfile.read(int(self.headers["Content-Length"]))
                head = f"Content-Type: {self.headers['Content-Type']}\r\n\r\n".encode()
                parts = email.parser.BytesParser().parsebytes(head + body).get_payload()
                # The next message is sent after this answer: taking the message first keeps their order.
                came.put(parse(parts[1].get_payload(decode=True).decode())[0])
                self.send_response(200)
                self.send_header("Content-Length", "0")
                self.end_headers()

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer((listen, 0), Handler)
        self.server.daemon_threads = True
        port = self.server.server_address[1]
        self.address = f"http://{listen}:{port}/acc"
        self.name = f"{name}@{socket.gethostname()}-{port}"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

        def hear_all():
            for message in iter(came.get, None):
                try:
                    hear(message)
                except Exception as error:
                    print(f"a message was not understood, or not answered: {error}", file=sys.stderr, flush=True)

        threading.Thread(target=hear_all, daemon=True).start()

    def send(self, act, to, content, conversation, protocol, in_reply_to=None):
        (name, address), boundary = to, "part-" + uuid.uuid4().hex
        message = [act, ":sender", aid(self.name, self.address), ":receiver", ["set", aid(name, address)],
                   ":content", write(content), ":language", "fipa-sl", ":ontology",
                   "fipa-agent-management" if name.startswith("df@") else "bottega-painting", ":protocol", protocol,
                   ":conversation-id", conversation, ":reply-with", uuid.uuid4().hex]
        if in_reply_to:
            message += [":in-reply-to", in_reply_to]
        payload = write(message).encode()
        agent = lambda n, a: (f"<agent-identifier><name>{escape(n)}</name><addresses><url>{escape(a)}</url></addresses>"
                              "</agent-identifier>")
        date = time.strftime("%Y%m%dT%H%M%S000Z", time.gmtime())
        envelope = (f'<?xml version="1.0"?>\n<envelope><params index="1"><to>{agent(name, address)}</to>'
                    f"<from>{agent(self.name, self.address)}</from>"
                    "<acl-representation>fipa.acl.rep.string.std</acl-representation>"
                    f"<payload-length>{len(payload)}</payload-length><payload-encoding>UTF-8</payload-encoding>"
                    f"<date>{date}</date><intended-receiver>{agent(name, address)}</intended-receiver></params></envelope>")
        line = f"\r\n--{boundary}"
        body = (f"This is not part of the MIME multipart encoded message.{line}\r\nContent-Type: application/xml\r\n\r\n"
                f"{envelope}{line}\r\nContent-Type: application/text\r\n\r\n").encode() + payload + f"{line}--\r\n".encode()
        url = urllib.parse.urlsplit(address)
        connection = http.client.HTTPConnection(url.hostname, url.port, timeout=10)
        connection.request("POST", url.path, body, {"Content-Type": f'multipart/mixed ; boundary="{boundary}"'})
        connection.getresponse().read()
        connection.close()


class Painter:
    """Mitsuba with the scene of a job."""

    def __init__(self, work, variant):
        import mitsuba
        self.mi = mitsuba
        mitsuba.set_variant(variant)
        self.folder = tempfile.TemporaryDirectory(prefix="stranger-")
        for file in work["files"][1:]:
            file = fields(file)
            path = os.path.normpath(os.path.join(self.folder.name, "scene", file["name"]))
            if not path.startswith(self.folder.name + os.sep):
                raise ValueError(f"a file is called {file['name']}")
            os.makedirs(os.path.dirname(path), exist_ok=True)
            with urllib.request.urlopen(file["at"], timeout=60) as answer, open(path, "wb") as out:
                out.write(answer.read())
        self.scene = mitsuba.load_file(os.path.join(self.folder.name, "scene", work["scene"]))
        self.sensor = self.scene.sensors()[int(work.get("camera", 0))]
        self.film = mitsuba.traverse(self.sensor)
        self.film["film.size"] = [int(work["width"]), int(work["height"])]
        own = self.scene.integrator()
        self.kind = "volpath" if own is not None and "Vol" in type(own).__name__ + str(own)[:24] else "path"
        self.integrators = {}

    def paint(self, order):
        """The mean of the samples of a rectangle, as the bytes of an OpenEXR file."""
        mi, number = self.mi, lambda name: int(order[name])
        self.film["film.crop_offset"] = [number("x0"), number("y0")]
        self.film["film.crop_size"] = [number("x1") - number("x0"), number("y1") - number("y0")]
        self.film.update()
        depth = number("max-depth")
        if depth not in self.integrators:
            self.integrators[depth] = mi.load_dict({"type": self.kind, "max_depth": depth + 1})
        seed = (number("seed") * 1000003 + number("zone") * 8191 + number("order")) & 0xFFFFFFFF
        image = mi.render(self.scene, sensor=self.sensor, integrator=self.integrators[depth], spp=number("samples"), seed=seed)
        path = os.path.join(self.folder.name, "zone.exr")
        mi.Bitmap(image[:, :, :3]).write(path)
        with open(path, "rb") as file:
            return file.read()


class Stranger:
    def __init__(self, options):
        self.options = options
        self.heard, self.orders = queue.Queue(), queue.Queue()
        self.withdrawn = set()
        self.painter, self.master = None, None
        self.lock, self.speed, self.load, self.painted = threading.Lock(), 1.0, 0.0, 0
        self.transport = Transport(options.name, options.listen, self.hear)

    def ask(self, act, to, content, conversation, protocol, wanted):
        """Says something, and waits for an answer of these acts."""
        self.transport.send(act, to, content, conversation, protocol)
        others, until = [], time.monotonic() + 20
        try:
            while True:
                message = self.heard.get(timeout=max(0.0, until - time.monotonic()))
                if message["conversation-id"] == conversation and message["act"] in wanted:
                    return message
                others.append(message)
        except queue.Empty:
            raise TimeoutError(f"{to[0]} does not answer") from None
        finally:
            for message in others:
                self.heard.put(message)

    def masters(self):
        """The names and addresses of the Masters of jobs that admit strangers, by the yellow pages of the farm's platform."""
        with urllib.request.urlopen(self.options.platform, timeout=10) as answer:
            platform = fields(parse(answer.read().decode())[0])["name"]
        df = (f"df@{platform}", self.options.platform)
        service = ["service-description", ":type", "bottega-master"]
        search = ["search", ["df-agent-description", ":services", ["set", service]], ["search-constraints", ":max-results", "-1"]]
        found = self.ask("request", df, [["action", aid(*df), search]], uuid.uuid4().hex, "fipa-request",
                         ("inform", "failure", "refuse", "not-understood"))
        agents = found["content"][0][0][2][1:] if found["act"] == "inform" else []
        names = [fields(fields(agent)["name"]) for agent in agents]
        return [(name["name"], name["addresses"][1]) for name in names]

    def is_absent(self):
        """True if the yellow pages say that the Master is gone. A platform that is too busy to answer says nothing."""
        try:
            return self.master not in self.masters()
        except TimeoutError:
            return False

    def find_master(self):
        is_waiting = False
        while not (masters := self.masters()):
            if not is_waiting:
                print(f"{self.transport.name} waits for a picture at {self.options.platform}", flush=True)
                is_waiting = True
            time.sleep(0.5)
        return masters[0]

    def hear(self, message):
        """Takes a message: what is urgent at once, the rest when there is time."""
        told = fields(message)
        told["act"], told["content"] = message[0].lower(), parse(told.get("content", "()"))
        told.setdefault("conversation-id", "")
        act = told["act"]
        if act == "cfp":
            self.propose(told)
        elif act in ("request", "accept-proposal"):
            order = fields(told["content"][0][0][2])
            with self.lock:
                self.load += float(order.get("seconds", 0)) * self.speed
            self.orders.put((order, told))
        elif act == "cancel":
            self.withdrawn.add(fields(told["content"][0][0][2])["order"])
        elif act in ("reject-proposal", "disconfirm"):
            print(f"{act}: {write(told['content'][0])}", flush=True) if self.options.verbose else None
        else:
            self.heard.put(told)

    def propose(self, told):
        """A zone is done when all that is in hand is, and it. One at a time is enough for a slow engine."""
        zones = fields(told["content"][0][0][2])["zones"][1:]
        bids = ["sequence"]
        with self.lock:
            for zone in map(fields, zones):
                finish = self.load + float(zone["seconds"]) * self.speed
                bids.append(["zone", ":number", zone["number"], ":seconds", f"{finish:.4f}"])
        me = aid(self.transport.name)
        self.transport.send("propose", self.master, [["action", me, ["paint", ":zones", bids]], ["room", "1"]],
                            told["conversation-id"], "fipa-contract-net", told.get("reply-with"))

    def deliver(self, order, told):
        name = ["paint", ":zone", order["zone"], ":order", order["order"]]
        action = ["action", aid(self.transport.name), name]
        answer = lambda act, content: self.transport.send(act, self.master, content, told["conversation-id"],
                                                          "fipa-request", told.get("reply-with"))
        begun = time.monotonic()
        try:
            picture = self.painter.paint(order)
            if order["order"] in self.withdrawn:
                return
            request = urllib.request.Request(order["deliver"], picture, {"Content-Type": "image/x-exr"}, method="PUT")
            urllib.request.urlopen(request, timeout=60).close()
        except Exception as error:
            why = error.read().decode() if isinstance(error, urllib.error.HTTPError) else str(error)
            return answer("failure", [action, ["internal-error", why[:200]]])
        finally:
            taken, expected = time.monotonic() - begun, float(order.get("seconds", 0))
            with self.lock:
                self.load = max(0.0, self.load - expected * self.speed)
                if expected > 0:
                    self.speed = max(0.05, 0.5 * self.speed + 0.5 * taken / expected)
        answer("inform", [["done", action]])
        self.painted += 1
        if self.options.verbose:
            print(f"zone {order['zone']}: {order['samples']} samples in {taken:.2f} s", flush=True)

    def run(self):
        import mitsuba  # Importing takes seconds, during which no zone should wait.
        mitsuba.set_variant(self.options.variant)
        self.master = self.find_master()
        conversation = uuid.uuid4().hex
        wish = ["iota", "?work", ["paints", ":agent", aid(self.transport.name), ":power", "1", ":lanes", "1", ":work", "?work"]]
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        first = self.ask("subscribe", self.master, [wish], conversation, "fipa-subscribe",
                         ("agree", "refuse", "failure", "not-understood"))
        if first["act"] != "agree":
            sys.exit(f"{self.master[0]} does not want this agent: {write(first['content'][0])}")
        print(f"{self.transport.name} takes part in the work of {self.master[0]}", flush=True)
        painting = threading.Thread(target=self.paint_all, daemon=True)
        absences = 0
        try:
            while True:
                try:
                    told = self.heard.get(timeout=10)
                except queue.Empty:  # Its last message may be lost, or it was killed; or that message is still on its way.
                    absences = absences + 1 if self.is_absent() else 0
                    if absences == 2:
                        sys.exit(f"{self.master[0]} is no longer in the yellow pages")
                    continue
                if told["conversation-id"] != conversation:
                    continue
                content = told["content"][0]
                if told["act"] == "inform" and content[0][0] == "=":
                    self.painter = Painter(fields(content[0][2]), self.options.variant)
                    painting.start()
                elif told["act"] == "inform" and content[0][0] == "done":
                    return print(f"the picture is painted, {self.painted} orders here", flush=True)
                elif told["act"] in ("failure", "refuse"):
                    sys.exit(f"{self.master[0]} wants nothing more of this agent: {write(content)}")
        except KeyboardInterrupt:
            self.transport.send("cancel", self.master, [wish], conversation, "fipa-subscribe")
        finally:
            self.orders.queue.clear()  # Mitsuba must come to an end before Python does.
            self.orders.put(None)
            if painting.ident:
                painting.join()

    def paint_all(self):
        for order, told in iter(self.orders.get, None):
            if order["order"] not in self.withdrawn:
                self.deliver(order, told)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--platform", default="http://127.0.0.1:7779/acc", help="where the farm's platform is")
    parser.add_argument("--listen", default="127.0.0.1", help="the address of this machine by which the farm reaches it")
    parser.add_argument("--name", default="mitsuba", help="the agent's name")
    parser.add_argument("--variant", default="scalar_rgb", help="Mitsuba's variant, such as llvm_ad_rgb")
    parser.add_argument("--verbose", action="store_true")
    try:
        Stranger(parser.parse_args()).run()
    except OSError as error:
        sys.exit(f"the platform does not answer: {error}")
