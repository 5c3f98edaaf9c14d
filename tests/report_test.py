# SPDX-License-Identifier: MIT
"""`itr report` in a real browser: runs of known fields, whose colours must be where they belong; slider, picking, links, cut,
edits; plots alone where there is no WebGL. Skipped (77) without Chromium and its driver; the main ones also run in Firefox where it
and Xvfb are installed.

usage: report_test.py ITR EXAMPLES
"""

import base64
import io
import json
import os
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.error
import urllib.request

import h5py
import numpy
from PIL import Image

EXAMPLES = pathlib.Path(sys.argv.pop())
ITR = sys.argv.pop()
sys.path.insert(0, str(EXAMPLES.parent / "src/apps/study"))
sys.dont_write_bytecode = True
from plan import ALL_SERIES, Run  # noqa: E402
from plot import make_svg  # noqa: E402
from results import COSTS, MEASURES, Results, Row  # noqa: E402
CHROMIUM = shutil.which("chromium")
DRIVER = shutil.which("chromedriver")
FIREFOX = shutil.which("firefox-esr") or shutil.which("firefox")
XVFB = shutil.which("Xvfb")
SKIPPED = 77
PATIENCE = 120  # s, for what a loaded machine does late; a page that never does it fails here
MAP = numpy.array([[68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141], [39, 173, 129], [92, 200, 99],
                   [170, 220, 50], [253, 231, 37]], float)


def colour(share):
    """Of the page's map."""
    return [numpy.interp(share * 8, range(9), MAP[:, k]) for k in range(3)]


def free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


class Browser:
    """Chromium by the WebDriver protocol, without a window."""

    def __init__(self, *arguments):
        port = free_port()
        self.driver = subprocess.Popen([DRIVER, f"--port={port}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.base = f"http://127.0.0.1:{port}"
        until = time.monotonic() + PATIENCE
        while True:
            try:
                urllib.request.urlopen(self.base + "/status").close()
                break
            except OSError:
                if time.monotonic() > until:
                    raise
                time.sleep(0.1)
        options = ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--enable-unsafe-swiftshader", "--window-size=1280,900",
                   "--force-device-scale-factor=1", *arguments]
        wanted = {"browserName": "chrome", "goog:loggingPrefs": {"browser": "ALL"},
                  "goog:chromeOptions": {"binary": CHROMIUM, "args": options}, "timeouts": {"script": 1000 * PATIENCE}}
        session = self.call("POST", "/session", {"capabilities": {"alwaysMatch": wanted}})
        self.session = f"/session/{session['sessionId']}"

    def call(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.base + path, data, {"Content-Type": "application/json"}, method=method)
        try:
            with urllib.request.urlopen(request, timeout=2 * PATIENCE) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise RuntimeError(error.read().decode()[:1000]) from None

    def open(self, path, more=""):
        self.call("POST", self.session + "/url", {"url": "about:blank"})
        self.call("POST", self.session + "/url", {"url": pathlib.Path(path).resolve().as_uri() + more})
        return self.run("return r.failed ? String(r.failed.stack) : ''")

    def run(self, script):
        """`r` is the page's report, `v` its view, of a run. Returns what the script returns, once frames are drawn."""
        whole = ("const done = arguments[0]; (async () => { const r = await window.itrReport, v = r.view; "
                 f"if (v) await v.ready; {script} }})().then(done, e => done('failed: ' + e.stack));")
        return self.call("POST", self.session + "/execute/async", {"script": whole, "args": []})

    def picture(self):
        png = base64.b64decode(self.call("GET", self.session + "/screenshot"))
        return numpy.asarray(Image.open(io.BytesIO(png)).convert("RGB"), float)

    def place(self, *point):
        """Pixel of a point of the scene."""
        point = json.dumps([*point, 0][:3])
        return self.run(f"const o = r.run.meta.origin, p = {point}.map((c, k) => c - (o[k] ?? 0)), b = v.stage.getBoundingClientRect(), "
                        "s = v.project(p); return [Math.round(b.left + s[0]), Math.round(b.top + s[1])]")

    def click(self, x, y):
        act = [{"type": "pointerMove", "x": x, "y": y}, {"type": "pointerDown", "button": 0}, {"type": "pointerUp", "button": 0}]
        self.call("POST", self.session + "/actions", {"actions": [{"type": "pointer", "id": "mouse", "actions": act}]})

    def drag(self, x, y, dx, dy):
        act = [{"type": "pointerMove", "x": x, "y": y}, {"type": "pointerDown", "button": 0},
               {"type": "pointerMove", "x": x + dx, "y": y + dy, "duration": 50}, {"type": "pointerUp", "button": 0}]
        self.call("POST", self.session + "/actions", {"actions": [{"type": "pointer", "id": "mouse", "actions": act}]})

    def errors(self):
        return [entry["message"] for entry in self.call("POST", self.session + "/se/log", {"type": "browser"}) if entry["level"] == "SEVERE"]

    def close(self):
        try:
            self.call("DELETE", self.session)
        finally:
            self.driver.terminate()
            self.driver.wait()


class Firefox(Browser):
    """By Marionette, its own protocol, which needs no driver; in a window that is not seen, as it has no WebGL without one."""

    COMMANDS = {"url": "Navigate", "async": "ExecuteAsyncScript", "screenshot": "TakeScreenshot", "actions": "PerformActions"}

    def __init__(self):
        ends, port, self.sent, self.session = os.pipe(), free_port(), 0, ""
        self.screen = subprocess.Popen([XVFB, "-displayfd", str(ends[1]), "-screen", "0", "1400x1000x24", "-nolisten", "tcp"],
                                       pass_fds=ends[1:], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(ends[1])
        with os.fdopen(ends[0]) as told:
            display = ":" + told.readline().strip()
        self.profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        settings = {"marionette.port": port, "webgl.force-enabled": "true", "layout.css.devPixelsPerPx": '"1.0"'}
        pathlib.Path(self.profile.name, "user.js").write_text("".join(f'user_pref("{k}", {v});\n' for k, v in settings.items()))
        self.driver = subprocess.Popen([FIREFOX, "--marionette", "--no-remote", "--profile", self.profile.name, "--width", "1280", "--height", "900"],
                                       env={**os.environ, "DISPLAY": display}, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        until = time.monotonic() + PATIENCE
        while True:
            try:
                self.socket = socket.create_connection(("127.0.0.1", port))
                break
            except OSError:
                if time.monotonic() > until:
                    raise
                time.sleep(0.1)
        self.file = self.socket.makefile("rb")
        self.read()
        self.send("WebDriver:NewSession", {"capabilities": {"alwaysMatch": {"timeouts": {"script": 1000 * PATIENCE}}}})

    def read(self):
        length = b""
        while not length.endswith(b":"):
            length += self.file.read(1)
        return json.loads(self.file.read(int(length[:-1])))

    def send(self, name, body):
        self.sent += 1
        text = json.dumps([0, self.sent, name, body]).encode()
        self.socket.sendall(b"%d:%s" % (len(text), text))
        _, _, error, answer = self.read()
        if error:
            raise RuntimeError(str(error)[:1000])
        return answer.get("value")

    def call(self, method, path, body=None):
        return self.send("WebDriver:" + self.COMMANDS[path.rpartition("/")[2]], body or {})

    def errors(self):
        return []  # not told; a page that fails says so in `open`

    def close(self):
        try:
            self.send("Marionette:Quit", {"flags": ["eForceQuit"]})
            self.driver.wait(30)
        finally:
            self.file.close()
            self.socket.close()
            self.driver.kill()
            self.driver.wait()
            self.screen.terminate()
            self.screen.wait()
            self.profile.cleanup()


def write_frame(folder, step, t, rest, x, cells, density, curved=(), obstacle=None, v=None):
    """As the command stores it; v: velocities, else of length 2 everywhere."""
    rest, x, cells = numpy.array(rest, float), numpy.array(x, float), numpy.array(cells)
    dim = rest.shape[1]
    facets = {}
    for cell in cells:
        for k in range(dim + 1):
            facet = [int(c) for c in numpy.delete(cell, k)][::-1 if k % 2 else 1]  # outward
            facets.setdefault(tuple(sorted(facet)), []).append(facet)
    surface = [facet[0] for facet in facets.values() if len(facet) == 1]
    (folder / "frames").mkdir(parents=True, exist_ok=True)
    with h5py.File(folder / f"frames/{step:06}.h5", "w") as file:
        file.attrs["step"], file.attrs["t"] = numpy.int64(step), float(t)

        def write(name, values, unit, kind=float):
            file[name] = numpy.asarray(values, kind)
            if unit:
                file[name].attrs["unit"] = unit

        write("/mesh/rest", rest, "m")
        for name, values in (("simplices", cells), ("body", [0] * len(cells)), ("surface", surface)):
            write("/mesh/" + name, values, None, numpy.int64)
        if len(curved):
            write("/mesh/curved_edges", curved, None, numpy.int64)
        speed = numpy.full(rest.shape, 2 / numpy.sqrt(dim)) if v is None else v
        for name, values, unit in (("x", x, "m"), ("u", x - rest, "m"), ("v", speed, "m/s"), ("elastic_density", density, "J/m^2")):
            write("/fields/" + name, values, unit)
        points, edges = obstacle or (numpy.zeros((0, dim)), numpy.zeros((0, 2)))
        write("/obstacles/x", points, "m")
        write("/obstacles/edges", edges, None, numpy.int64)
        write("/obstacles/faces", numpy.zeros((0, 3)), None, numpy.int64)


def write_steps(folder, times):
    none = {"tried": 0, "relaxed": 0, "accepted": 0}
    with open(folder / "steps.jsonl", "w") as file:
        for step, t in enumerate(times):
            row = {"step": step, "t": t, "vertices": 4 + step, "newton_iterations": 3, "min_distance": None, "min_volume_ratio": 1,
                   "energy": {"elastic": 1.0 + step, "total": 2.0 + step}, "energy_before_remesh": 2.5 + step, "history_loss": 0.25,
                   "splits": {**none, "accepted": step}, "curves": {**none, "accepted": 2 * step}, "collapses": none, "swaps": none, "smooths": none, "seconds": {"total": 0.5}}
            file.write(json.dumps(row) + "\n")
        file.write('{"step":3,"t"')  # what a run is writing just now


SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]


def write_plane(folder):
    """A square of two cells; moved; moved on, with one cell split by a new vertex."""
    wall = (numpy.array([[2.55, 0], [2.55, 1]]), [[0, 1]])
    move = lambda x, by: numpy.array(x, float) + [by, 0]
    write_frame(folder, 0, 0, SQUARE, SQUARE, [[0, 1, 2], [0, 2, 3]], [0, 100], obstacle=wall)
    write_frame(folder, 1, 0.1, SQUARE, move(SQUARE, 1), [[0, 1, 2], [0, 2, 3]], [50, 25], obstacle=wall)
    more = SQUARE + [[0.25, 0.75]]
    write_frame(folder, 2, 0.3, more, move(more, 1.5), [[0, 1, 2], [0, 2, 4], [2, 3, 4], [3, 0, 4]], [100, 25, 50, 75], obstacle=wall)
    write_steps(folder, [0, 0.1, 0.3])


def write_solid(folder):
    """Two tetrahedra, above and below the plane y = 0."""
    rest = [[0, 0, 0], [1, 0, 0], [0, 0, -1], [0.3, 1, -0.3], [0.3, -1, -0.3]]
    write_frame(folder, 0, 0, rest, rest, [[0, 1, 2, 3], [1, 0, 2, 4]], [10, 40])
    write_steps(folder, [0])


class Cases(unittest.TestCase):
    start = Browser

    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        cls.browser = cls.start()
        cls.plane = cls.folder / "plane <run> & co"
        write_plane(cls.plane)
        cls.solid = cls.folder / "solid"
        write_solid(cls.solid)

    @classmethod
    def tearDownClass(cls):
        cls.browser.close()
        cls.temporary.cleanup()

    def report(self, folder, *more, status=0):
        done = subprocess.run([ITR, "report", folder, *more], capture_output=True, text=True)
        self.assertEqual(done.returncode, status, done.stderr)
        return done

    def open(self, path, more=""):
        self.assertEqual(self.browser.open(path, more), "")

    def assert_colour(self, picture, at, expected, within=6):
        found = picture[at[1], at[0]]
        self.assertLess(numpy.abs(found - expected).max(), within, f"{found} instead of {expected} at {at}")

    def see(self, check):
        """Gives `check` one picture after the other until it passes: browsers show a frame some time after they have drawn it."""
        until = time.monotonic() + PATIENCE
        while True:
            try:
                return check(self.browser.picture())
            except AssertionError:
                if time.monotonic() > until:
                    raise
                time.sleep(0.1)

    def settled_picture(self):
        """The first picture that looks as the one before it."""
        seen = [self.browser.picture()]

        def settled(picture):
            seen.append(picture)
            self.assertLess(numpy.abs(seen[-1] - seen[-2]).max(), 3)
            return picture

        return self.see(settled)

    def wait_for(self, script, expected):
        """Runs a script until it returns what is expected."""
        until = time.monotonic() + PATIENCE
        while (found := self.browser.run(script)) != expected and time.monotonic() < until:
            time.sleep(0.1)
        self.assertEqual(found, expected, script)

    def assert_seen(self, *expected, within=6):
        """Pairs of a pixel and its colour."""
        self.see(lambda picture: [self.assert_colour(picture, at, wanted, within) for at, wanted in expected])

    def assert_drawn(self, *expected):
        """Pairs of a point and the share of the colours there, or None: white."""
        self.see(lambda picture: [self.assert_colour(picture, self.browser.place(*point), [255] * 3 if share is None else colour(share))
                                  for point, share in expected])


class Report(Cases):
    def test_cells_have_their_colours_at_their_places(self):
        self.report(self.plane)
        self.open(self.plane / "report.html", "#t=0&edges=0")
        self.assert_drawn(((0.75, 0.25), 0), ((0.25, 0.75), 1), ((1.75, 0.25), None))
        self.browser.run("v.slider.value = 1; v.slider.dispatchEvent(new Event('input'))")
        self.assert_drawn(((0.75, 0.25), None), ((1.75, 0.25), 0.5), ((1.25, 0.75), 0.25))
        self.browser.run("v.slider.value = 2; v.slider.dispatchEvent(new Event('input'))")
        self.assert_drawn(((2.25, 0.25), 1), ((1.75, 0.6), 0.25), ((1.9, 0.9), 0.5), ((1.6, 0.6), 0.75))
        self.assertIn("t = 0.3 s · step 2 · 5 vertices · 4 cells", self.browser.run("return v.time.textContent"))
        # Half as deformed, by another field, logarithmically, with another range.
        self.browser.run("await v.set({factor: 0.5})")
        self.assert_drawn(((2.25, 0.25), None), ((1.5, 0.25), 1))
        self.browser.run("await v.set({factor: 1, field: 'u'})")
        self.assert_drawn(((2.25, 0.25), 1))
        self.browser.run("await v.set({field: 'elastic_density', log: true})")
        self.assert_drawn(((1.75, 0.6), 1 + numpy.log10(0.25) / 4))
        self.browser.run("await v.set({log: false, least: 0, most: 200})")
        self.assert_drawn(((2.25, 0.25), 0.5))
        self.assertIn("200", self.browser.run("return v.legend.textContent"))
        self.assertIn("elastic energy density [J/m²]", self.browser.run("return v.legend.textContent"))
        self.assertEqual(self.browser.run("await v.set({field: 'J', least: null, most: null}); return r.run.meta.ranges.J"), [1, 1])
        self.assertAlmostEqual(self.browser.run("await v.set({frame: 0, field: 'size'}); return r.run.meta.ranges.size[0]"), 1)
        self.assertEqual(self.browser.errors(), [])

    def test_edges_obstacles_and_edits_are_drawn(self):
        self.report(self.plane)
        self.open(self.plane / "report.html", "#t=0")
        middle, wall = self.browser.place(0.5, 0.5), self.browser.place(2.55, 0.5)
        self.see(lambda picture: self.assertLess(picture[middle[1], middle[0]].sum(), 0.85 * sum(colour(1))))
        self.see(lambda picture: self.assertLess(picture[wall[1], wall[0] - 2:wall[0] + 3].sum(axis=1).min(), 600))
        self.browser.run("await v.set({edges: false, obstacles: false})")
        self.assert_seen((self.browser.place(0.4, 0.6), colour(1)), (wall, [255] * 3))
        self.browser.run("await v.set({frame: 2, edits: true})")
        self.assertIn("1 new vertices", self.browser.run("return v.made.textContent"))
        self.assertIn("Step 2: energy lower by 0.25 J", self.browser.run("return v.made.textContent"))
        self.assert_seen((self.browser.place(1.75, 0.75), [10, 143, 60]))
        self.assertEqual(self.browser.errors(), [])

    def test_vertices_that_are_gone_are_shown_where_their_material_is(self):
        folder = self.folder / "coarsened"
        more = SQUARE + [[0.25, 0.75]]
        write_frame(folder, 0, 0, more, more, [[0, 1, 2], [0, 2, 4], [2, 3, 4], [3, 0, 4]], [1, 1, 1, 1])
        write_frame(folder, 1, 0.1, SQUARE, numpy.array(SQUARE, float) + [2, 0], [[0, 1, 2], [0, 2, 3]], [1, 1])
        write_steps(folder, [0, 0.1])
        self.report(folder)
        self.open(folder / "report.html", "#t=0.1&edits=1&edges=0")
        self.assertIn("1 collapsed vertices", self.browser.run("return v.made.textContent"))
        self.assertNotIn("swap", self.browser.run("return v.made.textContent"))
        self.assert_seen((self.browser.place(2.25, 0.75), [208, 2, 27]))
        self.assertEqual(self.browser.errors(), [])

    def test_a_click_tells_ids_and_values(self):
        self.report(self.plane)
        self.open(self.plane / "report.html", "#t=0.1")
        self.browser.click(*self.browser.place(1.9, 0.2))
        text = self.browser.run("return v.pickText.textContent")
        for part in ("vertex 1", "rest  1, 0 m", "now   2, 0 m", "displacement |u|  1 m", "velocity |v|  2 m/s", "cell 0",
                     "vertices  0 1 2", "elastic energy density  50 J/m²", "volume ratio J  1"):
            self.assertIn(part, text)
        self.browser.click(*self.browser.place(0.5, 0.5))
        self.assertNotIn("vertex", self.browser.run("return v.pickText.textContent"))
        # A vertex keeps its id where the mesh changes, and one that is not there yet is said not to be.
        self.browser.run("await v.set({frame: 2})")
        self.browser.click(*self.browser.place(1.76, 0.75))
        self.assertIn("vertex 6", self.browser.run("return v.pickText.textContent"))  # after those of the wall
        self.browser.run("await v.set({frame: 1})")
        self.assertIn("vertex 6 is not in this frame", self.browser.run("return v.pickText.textContent"))
        self.assertEqual(self.browser.errors(), [])

    def test_two_fingers_zoom_and_move(self):
        self.report(self.plane)
        self.open(self.plane / "report.html")
        x, y = self.browser.place(1.75, 0.5)
        finger = lambda name, at, to: {"type": "pointer", "id": name, "parameters": {"pointerType": "touch"}, "actions": [
            {"type": "pointerMove", "x": at[0], "y": at[1]}, {"type": "pointerDown", "button": 0},
            {"type": "pointerMove", "x": to[0], "y": to[1], "duration": 50}, {"type": "pointerUp", "button": 0}]}
        before = self.browser.run("return v.project([1.75, 0.5, 0])")
        fingers = [finger("a", (x - 50, y), (x - 100, y + 30)), finger("b", (x + 50, y), (x + 100, y + 30))]
        self.browser.call("POST", self.browser.session + "/actions", {"actions": fingers})
        self.assertAlmostEqual(self.browser.run("return v.camera.zoom"), 2, delta=0.1)
        after = self.browser.run("return v.project([1.75, 0.5, 0])")
        self.assertLess(abs(after[0] - before[0]) + abs(after[1] - before[1] - 30), 6)
        self.assertEqual(self.browser.run("return v.state.pick"), None)
        self.browser.call("DELETE", self.browser.session + "/actions")
        self.assertEqual(self.browser.errors(), [])

    def test_a_link_opens_the_same_view(self):
        self.report(self.solid)
        self.open(self.solid / "report.html")
        x, y = self.browser.place(0.2, 0.1, -0.2)
        self.browser.drag(x, y, 80, 30)
        self.browser.run("v.zoomAt(1.3); await v.set({log: true, axis: 'x', cut: 0.2, pick: {cell: 1, vertex: 4}})")
        self.wait_for("return location.hash === v.toHash()", True)
        link = self.browser.run("return location.hash")
        before = self.settled_picture()
        self.assertNotIn("view=35,20,1,", link)
        self.open(self.solid / "report.html", link)
        self.assertEqual(self.browser.run("return v.toHash()"), link)
        self.see(lambda picture: self.assertLess(numpy.abs(picture - before)[60:, :-20].max(), 12))  # without the scroll bar
        self.open(self.solid / "report.html", "#t=nonsense&view=1,2&cut=q&pick=99,99&field=nothing")
        self.assertEqual(self.browser.errors(), [])

    def test_a_cut_shows_the_cells_inside(self):
        self.report(self.solid)
        self.open(self.solid / "report.html", "#edges=0&cut=z,0.5,0&view=0,0,1,0.5,0,-0.5")
        share = lambda value: value / 40
        above, below = self.browser.place(0.2, 0.2, -0.5), self.browser.place(0.2, -0.2, -0.5)
        light = 0.55 + 0.45 * 0.86  # straight from the front
        self.assert_seen((above, light * numpy.array(colour(share(10)))), (below, light * numpy.array(colour(share(40)))), within=9)
        self.browser.click(*below)
        self.assertIn("cell 1\n", self.browser.run("return v.pickText.textContent"))
        self.assertIn("elastic energy density  40 J/m²", self.browser.run("return v.pickText.textContent"))
        # Cells before the plane are gone: its normal looks at us.
        self.assertTrue(self.browser.run("return v.pickAt(...v.project([0.05, 0.02, 0])) === null || v.cutPlane[2] === 1"))
        self.assertEqual(self.browser.errors(), [])

    def test_a_certificate_is_shown_if_asked_for(self):
        self.report(self.plane, "--certify")
        self.open(self.plane / "report.html")
        self.assertIn("3 stored frames, each by itself: no intersection", self.browser.run("return document.querySelector('header').textContent"))
        folder = self.folder / "inverted"
        write_frame(folder, 0, 0, SQUARE, [[0, 0], [1, 0], [1, 1], [0.8, 0.2]], [[0, 1, 2], [0, 2, 3]], [1, 1])
        write_steps(folder, [0])
        self.report(folder, "--certify")
        self.open(folder / "report.html")
        text = self.browser.run("return document.querySelector('.certificate.failed').textContent")
        self.assertRegex(text, r"1 stored frames, each by itself: \d+ violations.*000000")

    def test_gaps_are_those_to_obstacles_and_other_bodies(self):
        folder = self.folder / "gaps"
        rest = numpy.array([[0, 0], [1, 0], [0, 1], [1.02, 0.5], [2, 0.5], [2, 1.5]])
        floor = (numpy.array([[-1, -0.01], [0.5, -0.01]]), [[0, 1]])
        write_frame(folder, 0, 0, rest, rest, [[0, 1, 2], [3, 4, 5]], [1, 1], obstacle=floor)
        write_steps(folder, [0])
        self.report(folder)
        self.open(folder / "report.html")
        limit = 0.02 * numpy.hypot(2, 1.5)
        found = self.browser.run("const g = v.frame.field('gap'); return [...v.frame.mesh.vertices].filter(i => r.run.kind[i] === 0).map(i => g.values[i])")
        numpy.testing.assert_allclose(found, [0.01, limit, limit, limit, limit, limit], rtol=2e-3)
        x = rest.copy()
        x[3:] -= [0.5, 0]  # beside the first one's slanted side: x + y = 1
        write_frame(folder, 1, 0.1, rest, x, [[0, 1, 2], [3, 4, 5]], [1, 1], obstacle=floor)
        self.report(folder)
        self.open(folder / "report.html", "#t=0.1&field=gap")
        found = self.browser.run("const g = v.frame.field('gap'); return [...v.frame.mesh.vertices].filter(i => r.run.kind[i] === 0).map(i => g.values[i])")
        numpy.testing.assert_allclose(found, [0.01, limit, limit, 0.02 / numpy.sqrt(2), limit, limit], rtol=2e-3)
        self.assertEqual(self.browser.errors(), [])

    def test_curved_edges_are_drawn_curved(self):
        folder = self.folder / "curved"
        rest = [[0, 0], [1, 0], [0, 1], [0.5, 0], [0, 0.5], [0.5, 0.5]]
        x = [[0, 0], [1, 0], [0, 1], [0.5, -0.2], [0, 0.5], [0.5, 0.5]]
        write_frame(folder, 0, 0, rest, x, [[0, 1, 2]], [5], curved=[[0, 1], [0, 2], [1, 2]])
        write_steps(folder, [0])
        self.report(folder)
        self.open(folder / "report.html", "#edges=0")
        self.assert_drawn(((0.5, -0.15), 1), ((0.5, -0.25), None), ((0.1, -0.02), 1), ((0.1, -0.12), None))
        self.browser.run("await v.set({field: 'order'})")
        self.assert_drawn(((0.4, 0.2), 1))
        self.assertEqual(self.browser.errors(), [])

    def test_partly_curved_meshes_are_drawn_with_their_own_edges(self):
        folder = self.folder / "partly"  # of a square's two cells one has a curved edge, at its bottom
        rest = SQUARE + [[0.5, 0]]
        write_frame(folder, 0, 0, rest, SQUARE + [[0.5, -0.2]], [[0, 1, 2], [0, 2, 3]], [5, 10], curved=[[0, 1]])
        write_steps(folder, [0])
        self.report(folder)
        self.open(folder / "report.html", "#edges=0")
        self.assert_drawn(((0.5, -0.18), 0.5), ((0.5, -0.22), None), ((0.1, -0.06), 0.5), ((0.1, -0.09), None), ((0.5, 0.98), 1),
                          ((0.5, 1.02), None), ((0.98, 0.5), 0.5), ((1.02, 0.5), None))
        self.browser.run("await v.set({field: 'order'})")
        self.assert_drawn(((0.7, 0.3), 1 / 3), ((0.3, 0.7), 0))
        self.assertEqual(self.browser.errors(), [])

    def test_curved_solids_are_drawn_curved(self):
        rest, cells = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, -1]], [[0, 2, 1, 3]]
        edges = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]
        light = 0.55 + 0.45 * 0.86
        for name, curved in (("one", edges[:1]), ("all", edges)):
            folder = self.folder / ("solid curved " + name)
            nodes = [numpy.add(rest[a], rest[b]) / 2 for a, b in curved]
            write_frame(folder, 0, 0, rest + nodes, rest + [nodes[0] - [0, 0.2, 0]] + nodes[1:], cells, [10], curved=curved)
            write_steps(folder, [0])
            self.report(folder)
            self.open(folder / "report.html", "#edges=0&view=0,0,1,0.5,0.5,0")
            inside = [self.browser.place(*p) for p in ((0.5, -0.17), (0.1, -0.05), (0.3, 0.3), (0.02, 0.5))]
            outside = [self.browser.place(*p) for p in ((0.5, -0.23), (0.1, -0.1), (-0.03, 0.5), (0.53, 0.53))]
            body = light * numpy.array(colour(1))
            self.assert_seen(*[(place, body) for place in inside], within=9)
            self.assert_seen(*[(place, [255] * 3) for place in outside])
            self.browser.click(*inside[0])
            self.assertIn("cell 0", self.browser.run("return v.pickText.textContent"))
            # Cells behind z = -0.05 are cut flat, also where the curved edge is: at x = 0.45 down to y = -0.14.
            self.browser.run("await v.set({axis: 'z', cut: 0.95})")
            sections = [self.browser.place(0.45, y, -0.05) for y in (-0.02, -0.1, -0.15)]
            self.assert_seen(*[(place, body) for place in sections], within=9)
        self.assertEqual(self.browser.errors(), [])

    def test_plots_move_the_time(self):
        self.report(self.plane)
        self.open(self.plane / "report.html", "#t=0")
        titles = self.browser.run("return [...document.querySelectorAll('#plots figcaption')].map(e => e.textContent)")
        for title in ("Energy of the step by term [J]elastic –total –", "Vertices4", "Operations of remeshing that were acceptedsplits 0curves 0"):
            self.assertIn(title, titles)
        self.browser.run("const d = document.querySelector('#plots svg'); d.scrollIntoView(); const b = d.getBoundingClientRect();"
                         "d.dispatchEvent(new PointerEvent('pointermove', {clientX: b.left + 0.4 * b.width, clientY: b.top + 9}))")
        self.assertEqual(self.browser.run("return v.state.frame"), 1)
        self.assertIn("elastic 2", self.browser.run("return document.querySelector('#plots figcaption').textContent"))
        self.assertEqual(self.browser.errors(), [])

    def test_stored_forces_are_plotted_by_name(self):
        folder = self.folder / "forces"
        write_plane(folder)
        sums = lambda f: [[f, 2 * f, 0.5], [0.1 * f, 0, 0], [0, 0, 0], [1.1 * f, 2 * f, 0.5]]  # contact, friction, reaction, all
        for step in range(3):
            with h5py.File(folder / f"frames/{step:06}.h5", "a") as file:
                file["/totals/forces"] = numpy.array(sums(10 * step) + sums(-step), float)
                file["/totals/forces"].attrs["names"] = "plate,left jaw"
        titles = lambda: self.browser.run("return Object.fromEntries(r.plots.map(p => [p.title, p.series.map(s => [s.name, ...s.values])]))")
        self.report(folder)
        self.open(folder / "report.html")
        found = titles()
        self.assertEqual(found["Force on plate"], [["x", 0, 11, 22], ["y", 0, 20, 40]])
        self.assertEqual(found["Force on left jaw"], [["x", 0, -1.1, -2.2], ["y", 0, -2, -4]])
        self.assertEqual(found["Friction force on plate"], [["x", 0, 1, 2]])
        self.assertEqual(found["Moment on plate"], [["", 0.5, 0.5, 0.5]])
        self.assertNotIn("Reaction force on plate", found)
        self.assertIn("Force on plate [N]x 22y 40", self.browser.run("return document.getElementById('plots').textContent"))
        # forces.csv also has the steps that no frame has; its last line is being written.
        (folder / "forces.csv").write_text("step,t,name,contact_x,contact_y,contact_moment,friction_x,friction_y,friction_moment,reaction_x,reaction_y,"
                                           "reaction_moment,all_x,all_y,all_moment\n0,0,plate" + ",0" * 12 + "\n1,0.05,plate" + ",3" * 12
                                           + "\n2,0.1,plate" + ",4" * 12 + "\n3,0.3,pl")
        self.report(folder)
        self.open(folder / "report.html")
        self.assertEqual(titles()["Reaction force on plate"], [["x", 0, 3, 4], ["y", 0, 3, 4]])
        self.assertEqual(self.browser.run("return r.plots.find(p => p.title === 'Force on plate').times"), [0, 0.05, 0.1])
        self.assertEqual(self.browser.errors(), [])

    def test_warnings_are_listed_by_kind_with_their_steps(self):
        folder = self.folder / "warned"
        write_plane(folder)
        lines = [json.loads(line) for line in (folder / "steps.jsonl").read_text().splitlines()[:3]]
        lines[0]["warnings"] = ["/a <b>: is not written"]
        lines[1]["warnings"] = ["step 1: distance 1.5e-7 m"]
        lines[2]["warnings"] = ["step 2: distance 2e-12 m"]
        (folder / "steps.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
        summary = {"scene": "s.json", "outcome": "finished", "solver": "eigen", "seconds": {"total": 1},
                   "warnings": [{"text": "/a <b>: is not written", "count": 1}, {"text": "step 1: distance 1.5e-7 m", "count": 2},
                                {"text": "at the end", "count": 2}]}
        (folder / "summary.json").write_text(json.dumps(summary))
        self.report(folder)
        self.open(folder / "report.html")
        found = self.browser.run("return [...document.querySelectorAll('.warnings summary, .warnings div')].map(e => e.textContent)")
        self.assertEqual(found, ["5 warnings", "start /a <b>: is not written", "step 1 to 2 step 1: distance 1.5e-7 m (2 times)",
                                 "at the end (2 times)"])
        self.browser.run("document.querySelectorAll('.warnings button')[1].click()")
        self.assertEqual(self.browser.run("return v.state.frame"), 1)
        self.report(self.plane)
        self.open(self.plane / "report.html")
        self.assertIsNone(self.browser.run("return document.querySelector('.warnings')"))
        self.assertEqual(self.browser.errors(), [])

    def test_bodies_are_seen_through_obstacles(self):
        folder = self.folder / "behind"
        rest = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, -1]]
        write_frame(folder, 0, 0, rest, rest, [[0, 2, 1, 3]], [10])
        with h5py.File(folder / "frames/000000.h5", "a") as file:
            for name in ("x", "faces"):
                del file["/obstacles/" + name]
            file["/obstacles/x"] = numpy.array([[0, 0, 0.5], [1, 0, 0.5], [1, 1, 0.5], [0, 1, 0.5]], float)
            file["/obstacles/faces"] = numpy.array([[0, 1, 2], [0, 2, 3]])
        write_steps(folder, [0])
        self.report(folder)
        self.open(folder / "report.html", "#edges=0&view=0,0,1,0.5,0.5,0")
        inside, beside = self.browser.place(0.2, 0.3, 0), self.browser.place(0.8, 0.6, 0.5)
        light = 0.55 + 0.45 * 0.86
        wall, body = light * 255 * numpy.array([0.95, 0.955, 0.97]), light * numpy.array(colour(1))
        self.assert_seen((beside, wall), (inside, 0.75 * body + 0.25 * wall), within=9)
        self.browser.run("await v.look({azimuth: 180})")  # the wall is behind
        turned = tuple(self.browser.place(0.1, 0.1, 0)[::-1])
        self.see(lambda picture: self.assertGreater(numpy.abs(picture[turned] - wall).max(), 40))
        self.browser.run("await v.look({azimuth: 0}); await v.set({obstacles: false})")
        self.assert_seen((inside, body), within=9)
        self.assert_seen((beside, [255] * 3))
        self.assertEqual(self.browser.errors(), [])

    def test_a_peak_does_not_take_all_colours(self):
        folder, n = self.folder / "peak", 100
        rest = numpy.array([[i // 2, i % 2] for i in range(n + 2)], float)
        cells = [[i, i + 2, i + 1] if i % 2 == 0 else [i, i + 1, i + 2] for i in range(n)]
        write_frame(folder, 0, 0, rest, rest, cells, [1e6] + list(range(1, n)))
        write_steps(folder, [0])
        self.report(folder)
        self.open(folder / "report.html")
        self.assertAlmostEqual(self.browser.run("return v.range[1]"), 98)
        self.assertIn("≥ 98", self.browser.run("return v.legend.textContent"))
        self.browser.run("await v.set({most: 1e6})")
        self.assertNotIn("≥", self.browser.run("return v.legend.textContent"))

    def test_it_plays_and_obeys_keys(self):
        self.report(self.plane)
        self.open(self.plane / "report.html", "#t=0")
        self.browser.run("v.canvas.dispatchEvent(new KeyboardEvent('keydown', {key: '.'}))")
        self.assertEqual(self.browser.run("return v.state.frame"), 1)
        self.browser.run("await v.set({frame: 0}); v.canvas.dispatchEvent(new KeyboardEvent('keydown', {key: ' '}))")
        self.wait_for("return v.playing", False)
        self.assertEqual(self.browser.run("return v.state.frame"), 2)
        self.assertEqual(self.browser.errors(), [])

    def test_plots_where_there_is_no_webgl(self):
        self.report(self.plane)
        browser = Browser("--disable-3d-apis")
        try:
            self.assertEqual(browser.open(self.plane / "report.html"), "")
            self.assertIsNone(browser.run("return v"))
            self.assertIn("Plots only", browser.run("return document.getElementById('why').textContent"))
            self.assertTrue(browser.run("return document.getElementById('why').offsetWidth > 0"))
            self.assertGreater(browser.run("return document.querySelectorAll('#plots svg').length"), 3)
        finally:
            browser.close()

    def test_needs_nothing_beside_it(self):
        self.report(self.plane, "-o", self.folder / "alone.html")
        self.report(self.plane, "-o", self.folder / "again.html")
        self.assertTrue((self.folder / "alone.html").read_bytes() == (self.folder / "again.html").read_bytes())
        text = (self.folder / "alone.html").read_text()
        self.assertEqual(re.findall(r"(?:src|href)=\"(?!data:|#).{9}", text), [])
        self.assertEqual(re.findall(r"https?://(?!www\.w3\.org/2000/svg).{9}", text), [])
        self.assertTrue("<title>plane &lt;run&gt; &amp; co</title>" in text)
        self.open(self.folder / "alone.html")
        self.assertEqual(self.browser.run("return document.title"), "plane <run> & co")

    def test_leaves_out_what_it_must_and_says_so(self):
        folder = self.folder / "large"
        random = numpy.random.default_rng(1)
        rest = numpy.array([[i % 20, i // 20] for i in range(400)], float)
        cells = [[a, a + 1, a + 21] for a in range(379) if a % 20 < 19] + [[a, a + 21, a + 20] for a in range(379) if a % 20 < 19]
        for step in range(120):
            x = rest + random.uniform(-0.1, 0.1, rest.shape)
            write_frame(folder, step, 0.1 * step, rest, x, cells, random.uniform(1, 2, len(cells)))
        write_steps(folder, [0.1 * step for step in range(120)])
        self.assertIn("120 frames", self.report(folder).stdout)
        whole = (folder / "report.html").stat().st_size
        self.assertIn("31 of 120 stored frames: every 4th", self.report(folder, "--every", "4").stdout)
        limit = f"{0.75 * whole / 1e6:.2g}"
        self.assertIn(f"61 of 120 stored frames: every 2nd, for at most {limit} MB", self.report(folder, "--max-mb", limit).stdout)
        self.assertLess((folder / "report.html").stat().st_size, 1e6 * float(limit))
        self.open(folder / "report.html")
        self.assertIn("61 of 120 stored frames", self.browser.run("return document.getElementById('foot').textContent"))
        self.assertEqual(self.browser.run("return r.run.frames[r.run.frames.length - 1].step"), 119)

    def test_positions_are_those_of_the_frames(self):
        folder = self.folder / "masticator"
        subprocess.run([ITR, "run", EXAMPLES / "masticator.json", "-o", folder, "--set", "/time/tend=2.2", "--threads", "1", "--report"],
                       check=True, capture_output=True)
        self.open(folder / "report.html")
        stored = sorted((folder / "frames").glob("*.h5"))
        said = re.search(r"within (\S+) m of displacements", self.browser.run("return document.getElementById('foot').textContent"))
        for index in (0, 17, len(stored) - 1):
            with h5py.File(stored[index]) as file:
                x, rest, cells = file["/fields/x"][:], file["/mesh/rest"][:], file["/mesh/simplices"][:]
                density, v = file["/fields/elastic_density"][:], file["/fields/v"][:]
            found = self.browser.run(
                f"await v.set({{frame: {index}}}); const f = v.frame, o = r.run.meta.origin, e = f.field('elastic_density').values, s = f.field('v').values;"
                "return {x: f.mesh.vertices.filter(i => r.run.kind[i] === 0).reduce((l, i) => (l.push([r.run.rest[0][i] + o[0], "
                "r.run.rest[1][i] + o[1], v.x[3*i] + o[0], v.x[3*i+1] + o[1], s[i]]), l), []), e: [...f.mesh.cells].map(c => e[c])}")
            got, expected = numpy.array(found["x"]), numpy.column_stack([rest, x, numpy.linalg.norm(v, axis=1)])
            order = lambda rows: rows[numpy.lexsort((rows[:, 1].round(6), rows[:, 0].round(6)))]
            self.assertEqual(got.shape, expected.shape)
            self.assertEqual(len(found["e"]), len(cells))
            difference = numpy.abs(order(got) - order(expected))
            self.assertLess(difference[:, :4].max(), 1.01 * float(said[1]) + 1e-6)  # with the digits of a float
            self.assertLess((difference[:, 4] / numpy.maximum(order(expected)[:, 4], 1e-6 * expected[:, 4].max() + 1e-300)).max(), 2e-3)
            self.assertLess(numpy.abs(numpy.sort(found["e"]) - numpy.sort(density)).max(), 2e-3 * density.max() + 1e-20)
        self.assertEqual(self.browser.errors(), [])

    def write_study(self, folder):
        """Two runs of the square: on two cells, and on four that move on by 0.1 x."""
        more = SQUARE + [[0.25, 0.75]]
        write_frame(folder / "runs/coarse", 4, 1, SQUARE, SQUARE, [[0, 1, 2], [0, 2, 3]], [1, 2])
        write_frame(folder / "runs/time-1", 4, 1, SQUARE, SQUARE, [[0, 1, 2], [0, 2, 3]], [1, 2])
        moved = numpy.array(more, float) + [[0.1 * x, 0] for x, y in more]
        write_frame(folder / "runs/fine", 4, 1, more, moved, [[0, 1, 2], [0, 2, 4], [2, 3, 4], [3, 0, 4]], [1, 1, 2, 4])
        run = lambda name, k: {"run": name, "series": "uniform", "label": f"n_refs {k}", "set": [f"/geometry/0/n_refs={k}", '/a="b c"'],
                               "solver": "", "status": "finished", "vertices": 4 + k, "unknowns": 10 * 4 ** k, "memory_mb": 20 + k,
                               "processor_seconds": 0.5 * 8 ** k, "against": "reference", "errors": {"l2": 0.1 / 4 ** k, "h1": 0.3 / 2 ** k}}
        small = {**run("small", 2), "errors": {"l2": None, "h1": 0.05}}
        time = {**run("time-1", 0), "series": "time", "against": "time-4", "errors": {"l2": 1e-9, "h1": 1e-9}}
        failed = {"run": "worse", "series": "itr", "label": "tolerance 1 J", "set": [], "solver": "", "status": "failed", "reason": "too <long>"}
        study = {"scene": "my scene.json", "settings": "", "version": "0", "reference": "`reference`", "times": 1, "verdicts": [], "orders": [],
                 "answers": ["Refining pays by <b>4</b>."], "runs": [run("coarse", 0), run("fine", 1), small, time, failed],
                 "worth": {"l2": 0.01, "h1": 0.02}, "doubts": ["`small` is not told."]}
        (folder / "study.json").write_text(json.dumps(study))
        measured = (one for one in study["runs"] if "errors" in one)
        rows = [Row(Run(one["run"], ALL_SERIES[one["series"]], one["label"], {}, reference=one["against"]), certified=True,
                    errors=dict.fromkeys(measure.name for measure in MEASURES) | one["errors"],
                    **{cost: one[cost] for cost in COSTS}) for one in measured]
        worth = dict.fromkeys(measure.name for measure in MEASURES) | study["worth"]
        (folder / "study.svg").write_text(make_svg(Results("", worth=worth, rows=rows)))

    def test_a_study_is_shown_with_two_runs_side_by_side(self):
        folder = self.folder / "study"
        self.write_study(folder)
        self.assertIn("3 runs", self.report(folder).stdout)
        self.open(folder / "report.html")
        browser = self.browser
        self.assertEqual(browser.run("await Promise.all(r.views.map(v => v.ready)); return [r.shown, r.points.length, r.views.map(v => v.state.field)]"),
                         [["fine", "time-1"], 15, ["difference", "difference"]])  # 2 and 3 points by 3 costs
        self.assertIn("small is not told.", browser.run("return document.querySelector('.doubts').textContent"))
        rows = browser.run("return [...document.querySelectorAll('.words tr')].map(row => [...row.children].slice(-2).map(e => e.textContent))")
        self.assertEqual(rows[1:], [["10 %", "30 %"], ["2.5 %", "15 %"], ["< 1 %", "5 %"], ["1e-7 %", "1e-7 %"], ["", ""]])
        self.assertEqual(browser.run("return r.points.slice(6, 9).map(p => [p.run.run, p.mark.closest('g[id]').id])"),
                         [[name, "uniform-h1-processor_seconds"] for name in ("coarse", "fine", "small")])
        across = browser.run("return r.points.slice(6, 9).map(p => p.mark.getBoundingClientRect()).map(box => [box.x, box.y])")
        self.assertEqual((across, sorted(across, key=lambda at: at[0])), (sorted(across, key=lambda at: at[1]), across))  # errors fall
        self.assertIn("what the reference is worth", browser.run("return document.querySelector('#plots svg').textContent"))
        self.assertIn("Refining pays by <b>4</b>.", browser.run("return document.querySelector('.words:not(.point)').textContent"))
        # The difference is 0.1 x, from 0 on the left to 0.1 m on the right, in both.
        browser.run("await r.show(1, 'fine'); await r.show(1, 'coarse'); r.views.forEach(v => v.set({edges: false})); await Promise.all(r.views.map(v => v.ready))")
        self.assertIn("0.1", browser.run("return r.views[0].legend.textContent"))
        place = lambda i, x, y: browser.run(f"const w = r.views[{i}], b = w.stage.getBoundingClientRect(), s = w.project([{x}, {y}, 0]);"
                                            "return [Math.round(b.left + s[0]), Math.round(b.top + s[1])]")
        at = [place(i, x * (1.1 if i == 0 else 1), y) for i in (0, 1) for x, y in ((0.25, 0.5), (0.75, 0.5), (0.9, 0.2))]
        self.assert_seen(*[(point, colour(x)) for point, x in zip(at, (0.25, 0.75, 0.9) * 2)], within=8)
        # One camera and one field for both.
        browser.run("r.views[0].zoomAt(2); await r.views[0].set({field: 'elastic_density'}); await r.views[1].ready")
        self.assertEqual(browser.run("return r.views.map(v => [v.camera.zoom, v.state.field, v.range[1]])"), [[2, "elastic_density", 4]] * 2)
        # A point tells its run and the command; a click shows it.
        browser.run("r.points.find(p => p.run.run === 'coarse').mark.dispatchEvent(new MouseEvent('click')); await r.show(1, 'fine')")
        self.assertEqual(browser.run("return [...new Set([...document.querySelectorAll('.chosen')].map(m => m.textContent))].length"), 1)
        self.assertEqual(browser.run("return r.shown"), ["coarse", "fine"])
        self.assertEqual(browser.run("return document.querySelector('.words p > code').textContent"),
                         "itr run 'my scene.json' -o coarse --set /geometry/0/n_refs=0 --set '/a=\"b c\"'")
        browser.run("[...document.querySelectorAll('.words tr')].pop().click()")
        self.assertIn("failed: too <long>", browser.run("return document.querySelector('.words pre').textContent"))
        self.assertEqual(browser.errors(), [])
        self.assertIn("the mesh of fine is left out", self.report(folder, "--max-mb", "0.0001").stdout)
        self.open(folder / "report.html", "?plots")
        self.assertEqual(browser.run("return [document.querySelector('#plots svg').getBoundingClientRect().width > 300, r.points.length]"), [True, 15])
        self.assertEqual(browser.errors(), [])

    def test_a_run_that_stops_is_shown_as_far_as_it_came(self):
        folder = self.folder / "stopped"
        done = subprocess.run([ITR, "run", EXAMPLES / "ball_wall.json", "-o", folder, "--threads", "1", "--report", "--set",
                               "/solver/nonlinear/max_iterations=2"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 3, done.stderr)
        self.open(folder / "report.html")
        self.assertIn("stopped in step", self.browser.run("return document.getElementById('said').textContent"))
        self.assertGreater(self.browser.run("return r.run.frames.length"), 3)
        self.assertEqual(self.browser.errors(), [])

    def test_what_cannot_be_shown_is_said(self):
        (self.folder / "empty").mkdir()
        self.assertIn("no stored frame", self.report(self.folder / "empty", status=2).stderr)
        (self.folder / "empty/study.json").write_text("[1")
        self.assertIn("no results of a study", self.report(self.folder / "empty", status=2).stderr)
        self.assertIn("--every", self.report(self.plane, "--every", "0", status=2).stderr)


@unittest.skipUnless(FIREFOX and XVFB, "needs firefox-esr and xvfb")
class ReportInFirefox(Cases):
    start = Firefox
    test_cells = Report.test_cells_have_their_colours_at_their_places
    test_edits = Report.test_edges_obstacles_and_edits_are_drawn
    test_click = Report.test_a_click_tells_ids_and_values
    test_link = Report.test_a_link_opens_the_same_view
    test_cut = Report.test_a_cut_shows_the_cells_inside
    test_plots = Report.test_plots_move_the_time
    test_keys = Report.test_it_plays_and_obeys_keys
    test_study = Report.test_a_study_is_shown_with_two_runs_side_by_side
    write_study = Report.write_study


if __name__ == "__main__":
    if not CHROMIUM or not DRIVER:
        print("skipped: needs chromium and chromium-driver (tests/install_packages.sh)")
        sys.exit(SKIPPED)
    unittest.main()
