# SPDX-License-Identifier: BSD-3-Clause
"""What the page's tests show: the whole catalogue of effects, many robots, a recording; beside what viewer_rig has.

By hand: scripts/run python tests/viewer_page_rig.py
"""

import json
import math
import os
import threading
import time
from dataclasses import replace
from urllib.parse import urlsplit

import numpy as np
from playwright.sync_api import expect
from viewer_rig import BEAMS, CHAIR, HALF, Rig, room_ranges, viewer_settings, world

from kurumaisu import effects
from kurumaisu.errors import Error
from kurumaisu.viewer import Body, Fan, Goal, Group, Hub, Note, Outcome, PlaybackState, Server, Value, World

HOSTILE = "<img src=x onerror=alert(1)>"
BAG = frozenset({"seek", "play", "rate"})
LONG = 60.0  # [s] of the recording
TOOLBAR, LEGEND = 44, 80  # [px] that they cover of the picture
PERIOD = 1 / 30  # [s] between frames


def catalogue(acting):
    """Return every effect; acting: {id: {name: value}} of those that are on."""
    return tuple(
        Group(
            effect.id,
            effect.sentence,
            effect.id in acting,
            tuple(
                Value(
                    p.name,
                    "",
                    p.unit,
                    p.lower,
                    p.upper,
                    acting.get(effect.id, {}).get(p.name, p.null),
                    p.null,
                    p.scale if p.null == 0 else p.null,
                )
                for p in effect.parameters
            ),
        )
        for effect in effects.ALL
    )


def crowd(count):
    """Return a world of many robots, some people and things, one of them with a name that wants to be HTML.

    With some robots, each of them can be driven, and the chair, too.
    """
    chair = ((0.5, 0.3), (-0.5, 0.3), (-0.5, -0.3), (0.5, -0.3))
    octagon = tuple((0.25 * math.cos(a), 0.25 * math.sin(a)) for a in np.arange(8) * math.pi / 4)
    colors = ("#334d99", "#b06030", "#3d8060", "#806090")
    robots = [Body(f"r{i}", f"robot {i}", "robot", colors[i % 4], True, (chair,), drivable=True) for i in range(count)]
    bad = Body("bad", HOSTILE, "obstacle", "red;}", True, (octagon,))
    person = Body("person", "person 1", "person", "#806090", True, (octagon,))
    others = [replace(body, drivable=count > 0 and body.kind == "robot") for body in world().bodies]
    return World((*others, bad, person, *robots), world().bounds)


class PageHub(Hub):
    """Shows of every moment what PageRig has besides."""

    rig = None

    def state(self, state, scans):
        super().state(self.rig.dressed(state), {**scans, **self.rig.more_scans()})


class PageRig(Rig):
    """Adds the catalogue, a crowd, notes and a playback to a rig."""

    def __init__(self, hub, robots=0, **others):
        self.acting = {}
        self.robots = robots
        self.contacts = {}
        self.goal = None
        self.added, self.gone, self._last = {}, set(), 90  # by ids; the last one's number
        self.rear = None  # [m] that a second ranger of the chair, which looks back, sees everywhere
        self.playback = PlaybackState(100.0, 100.0 + LONG, 100.0, 1.0, False) if others.get("mode") == "bag" else None
        super().__init__(hub, **others)
        hub.rig = self
        hub.world(crowd(robots))
        self.poses |= {"bad": (2.5, -2.5, 0.0), "person": (-2.0, -1.0, 1.0)}
        for i in range(robots):
            self.poses[f"r{i}"] = (-3.2 + 1.6 * (i % 5), 3.0 - 1.5 * (i // 5), 0.6 * i)

    def do_effect(self, effect, enabled, values):
        self.acting.pop(effect, None)
        if enabled:
            self.acting[effect] = values
        self.show_effects()
        return Outcome("acts" if enabled else "is off")

    def do_set_pose(self, body, x, y, yaw):
        if x > HALF or x < -HALF:
            raise Error(f"set_pose: {body} would stand in a wall")
        return super().do_set_pose(body, x, y, yaw)

    def asked(self, name):
        """Return the arguments of every command of a name so far."""
        return [arguments for one, arguments in list(self.commands) if one == name]

    def do_add(self, kind, x, y, yaw, length, width, **_to):
        if x > HALF:
            raise Error(f"{kind} 1: would stand in a wall")
        self._last += 1
        a, b = length / 2, width / 2
        body = Body(
            f"#{self._last}",
            f"{kind} {self._last}",
            "obstacle",
            "#8b7355",
            True,
            (((a, b), (-a, b), (-a, -b), (a, -b)),),
        )
        self.added[body.id] = body
        self.poses[body.id] = (x, y, yaw)
        self.show_world()
        return Outcome(f"{body.name} was added", body.id)

    def do_delete(self, body):
        self.gone.add(body)
        self.show_world()
        return Outcome("deleted")

    def do_restore(self, body):
        if body not in self.gone:
            raise Error(f"model {body}: was not deleted")
        self.gone.remove(body)
        self.show_world()
        return Outcome("it is back")

    def do_frames(self):
        names = [("odom", "base_link", 20.0), ("base_link", "laser", None), ("map", HOSTILE, 1.0)]
        rows = [{"parent": p, "child": c, "node": "/somebody", "rate": rate} for p, c, rate in names]
        return Outcome("", json.dumps(rows))

    def do_save_world(self):
        return Outcome("at 1.000 s: 3 models", "a world\n")

    def do_goal(self, x, y, yaw):
        self.goal = Goal((x, y, yaw))
        return Outcome("published on /move_base_simple/goal, no nodes listening")

    def do_go(self, body=None):
        self.goal = replace(self.goal, body=body or "1", driving=True, text="driving there")
        return Outcome("driving there")

    def do_forget_goal(self):
        self.goal = None
        return Outcome("no goal")

    def do_reset(self):
        self.added, self.gone, self._last = {}, set(), 90
        self.show_world()
        return super().do_reset()

    def show_world(self):
        """Put what there is now into the hub."""
        known = crowd(self.robots)
        bodies = [body for body in (*known.bodies, *self.added.values()) if body.id not in self.gone]
        self.hub.world(replace(known, bodies=tuple(bodies)))

    def do_seek(self, t):
        self.playback = replace(self.playback, t=t)
        return Outcome("there")

    def do_play(self, on):
        self.playback = replace(self.playback, playing=on)
        return Outcome("plays" if on else "holds")

    def show_effects(self):
        self.hub.effects(catalogue(self.acting))

    def dressed(self, state):
        """Return the moment with a playback and a note that wants to be HTML."""
        return replace(
            state,
            goal=self.goal,
            playback=self.playback,
            contacts=dict(self.contacts),
            notes=(Note("warning", f"MADE_UP {HOSTILE}"),),
        )

    def more_scans(self):
        """Return a scan of each robot of the crowd, and the chair's second one."""
        scans = {(5 + i, 0): self._scan(self.poses[f"r{i}"]) for i in range(self.robots)}
        if self.rear is not None:
            x, y, yaw = self.poses["1"]
            scans[CHAIR, 1] = Fan((x, y, yaw + math.pi), -0.5, 1.0 / 50, 0.1, 8.0, np.full(51, self.rear))
        return scans

    def _scan(self, pose):
        bearings = np.linspace(-2.0943951, 2.0862138, BEAMS)
        true = room_ranges(pose, bearings)
        error = self._noise.normal(0.0, 0.01 + 0.03 * np.abs(bearings) / 2, BEAMS)
        inside = 400.0 + 300.0 * np.cos(bearings)
        return Fan(pose, -2.0943951, 4.1806093 / (BEAMS - 1), 0.06, 4.095, true + error, error, inside)


class Shown:
    """A rig behind a server that can be ended and started again at the same port."""

    def __init__(self, control=True, port=0, **rig):
        self.hub = PageHub()
        self.rig = PageRig(self.hub, **rig)
        self._control = control
        self._port = port
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self.start()
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join()
        self.server.close()

    def start(self):
        self.server = Server(viewer_settings(port=self._port), self.hub, self.rig, self._control)
        self.server.start()
        self._port = urlsplit(self.server.address).port

    @property
    def link(self):
        """Where the page is, with a token if there are any."""
        return self.server.new_address() if self._control else self.server.address

    def _run(self):
        while not self._stop.wait(PERIOD):
            if not self.rig.paused:
                self.rig.t += PERIOD
            self.rig.show()


def open_browser(playwright):
    """Return Debian's Chromium without a screen; as root, as in a container, it has no sandbox."""
    sandbox = [] if os.geteuid() else ["--no-sandbox"]
    return playwright.chromium.launch(executable_path="/usr/bin/chromium", args=sandbox)


class Visit:
    """A page and what it complains of."""

    def __init__(self, browser, link, **context):
        self.context = browser.new_context(**{"viewport": {"width": 1280, "height": 800}, **context})
        self.page = self.context.new_page()
        self.page.set_default_timeout(10_000)
        self.errors = []
        self.page.on("console", lambda m: self.errors.append(m.text) if m.type in ("error", "warning") else None)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("dialog", lambda dialog: self.errors.append(f"dialog: {dialog.message}"))
        self.page.goto(link)
        expect(self.page.locator("#connection")).to_have_text("Connected")
        expect(self.page.locator("#read-t")).not_to_have_text("–")

    def spot(self, x, y):
        """Return where a point of the world is in the picture when all of it is shown: pixels from its corner."""
        box, scale = self.page.locator("#front").bounding_box(), self.scale()
        middle = box["height"] / 2 + (TOOLBAR - LEGEND) / 2
        return box["x"] + box["width"] / 2 + x * scale, box["y"] + middle - y * scale

    def scale(self):
        """Return how many pixels a metre has when all of the world is shown, between toolbar and legend."""
        box = self.page.locator("#front").bounding_box()
        return 0.94 * min(box["width"], box["height"] - TOOLBAR - LEGEND) / (2 * HALF)

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        self.context.close()
        assert kind or not self.errors, self.errors


def until(condition, what, seconds=10.0):
    """Wait for something on the server's side; return what it gives."""
    end = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < end, f"not within {seconds} s: {what}"
        time.sleep(0.005)
    return found


if __name__ == "__main__":
    with Shown(port=8642, robots=10) as shown:
        print(shown.link, flush=True)
        threading.Event().wait()
