# SPDX-License-Identifier: BSD-3-Clause
"""A made-up chair that circles in a made-up room, for tests of the viewer's server and page.

By hand: scripts/run python tests/viewer_rig.py
"""

import math
import threading
import time

import numpy as np

from kurumaisu import settings
from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.viewer import (
    Body,
    Estimate,
    Fan,
    Group,
    Hub,
    Note,
    Outcome,
    Server,
    State,
    Value,
    ViewerSettings,
    World,
    read_settings,
)
from kurumaisu.viewer.commands import COMMANDS

HALF = 4.0  # [m] half of the room's edge
RADIUS = 2.0  # [m] of the circle
SPEED = 0.5  # [m/s]
BEAMS = 682
ABILITIES = frozenset(COMMANDS) - {"seek", "play", "rate", "run"}
CHAIR, BOX = 1, 2  # places in the world's bodies


def viewer_settings(**changes) -> ViewerSettings:
    """Return the shipped settings with a free port, and with other values for some keys."""
    top = settings.load(shipped("launch/viewer.yaml"))
    tree = {key: top.take(key) for key in top.names() if key in ViewerSettings.__annotations__}
    return read_settings(settings.Section({**tree, "port": 0, **changes}, "rig"))


def world() -> World:
    corners = [(-HALF, -HALF), (HALF, -HALF), (HALF, HALF), (-HALF, HALF)]
    walls = tuple((*a, *b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True))
    chair = ((0.5, 0.3), (-0.5, 0.3), (-0.5, -0.3), (0.5, -0.3))
    box = ((0.25, 0.25), (-0.25, 0.25), (-0.25, -0.25), (0.25, -0.25))
    return World(
        bodies=(
            Body("0", "room", "wall", "#404040", movable=False, segments=walls),
            Body("1", "chair", "robot", "#334d99", movable=True, polygons=(chair,)),
            Body("2", "<b>box</b>", "obstacle", "#b06030", movable=True, polygons=(box,)),
        ),
        bounds=(-HALF, -HALF, HALF, HALF),
    )


def room_ranges(pose, bearings):
    """Ranges from inside of the room to its walls."""
    x, y, yaw = pose
    c, s = np.cos(yaw + bearings), np.sin(yaw + bearings)
    with np.errstate(divide="ignore"):
        along_x = np.where(c > 0, (HALF - x) / c, (-HALF - x) / c)
        along_y = np.where(s > 0, (HALF - y) / s, (-HALF - y) / s)
    return np.minimum(np.abs(along_x), np.abs(along_y))


class Rig:
    """A source; every command is kept, some are obeyed."""

    def __init__(self, hub: Hub, mode: str = "sim", abilities: frozenset[str] = ABILITIES) -> None:
        self.title, self.mode, self.abilities = "made up", mode, abilities
        self.limits = {"v": 0.5, "w": 0.8}
        self.hub = hub
        self.commands: list[tuple[str, dict]] = []
        self.watched: list[bool] = []
        self.paused, self.estop, self.t = False, False, 0.0
        self.recording: str | None = None
        self.speed = 1.0
        self.seed = 42
        self.slow = threading.Event()  # set: commands but drive and estop wait until it is cleared
        self.poses = {"0": (0.0, 0.0, 0.0), "1": (RADIUS, 0.0, math.pi / 2), "2": (-1.0, 1.0, 0.3)}
        self.effects = {"laser.offset": (False, 0.0), "laser.noise": (False, 0.01)}
        self._noise = np.random.default_rng(1)
        hub.world(world())
        self.show_effects()

    def watch(self, watched: bool) -> None:
        self.watched.append(watched)

    def command(self, name, arguments) -> Outcome:
        self.commands.append((name, dict(arguments)))
        while self.slow.is_set() and name not in ("drive", "estop"):
            time.sleep(0.01)
        return getattr(self, f"do_{name}", lambda **_: Outcome("done"))(**arguments)

    def do_pause(self, on):
        self.paused = on
        return Outcome("paused" if on else "runs")

    def do_step(self):
        self.t += 0.01
        self.show()
        return Outcome(f"at {self.t:.3f} s")

    def do_speed(self, value):
        self.speed = value
        return Outcome(f"{value:g} times as fast")

    def do_seed(self, value):
        self.seed = value
        return self.do_reset()

    def do_reset(self):
        self.t = 0.0
        return Outcome("at the start")

    def do_set_pose(self, body, x, y, yaw):
        if body not in self.poses or body == "0":
            raise Error(f"set_pose: there is no body {body!r} that can be moved")
        self.poses[body] = (x, y, yaw)
        self.show()
        return Outcome("moved")

    def do_estop(self, on):
        self.estop = on
        self.show()
        return Outcome("stopped" if on else "released")

    def do_effect(self, effect, enabled, values):
        if effect not in self.effects:
            raise Error(f"effect: there is no {effect!r}")
        self.effects[effect] = (enabled, values.get("size", self.effects[effect][1]))
        self.show_effects()
        return Outcome("acts" if enabled else "is off")

    def do_record(self, on):
        self.recording = "made_up.bag" if on else None
        return Outcome("recording" if on else "made_up.bag")

    def do_save_model(self):
        return Outcome("a model", "name: made up\neffects: []\n")

    def show_effects(self):
        def group(id, enabled, size):
            return Group(id, f"A made-up {id}: r + size", enabled, (Value("size", "how much", "m", -0.2, 0.2, size),))

        self.hub.effects(tuple(group(id, *values) for id, values in self.effects.items()))

    def show(self):
        """Put the moment into the hub."""
        if not self.paused:
            turn = self.t * SPEED / RADIUS
            self.poses["1"] = (RADIUS * math.cos(turn), RADIUS * math.sin(turn), turn + math.pi / 2)
        x, y, yaw = pose = self.poses["1"]
        bearings = np.linspace(-2.0943951, 2.0862138, BEAMS)
        true = room_ranges(pose, bearings)
        enabled, size = self.effects["laser.offset"]
        ranges = true + self._noise.normal(0.0, 0.01, BEAMS) + (size if enabled else 0.0)
        ranges[:3] = np.nan, np.inf, np.nan
        fan = Fan(pose, -2.0943951, 4.1806093 / (BEAMS - 1), 0.06, 4.095, ranges, ranges - true, np.full(BEAMS, 800.0))
        state = State(
            t=self.t,
            wall=time.time(),
            rtf=0.0 if self.paused else self.speed,
            speed=self.speed,
            paused=self.paused,
            poses=dict(self.poses),
            hit=("2",) if self.estop else (),
            truth=pose,
            odom=(x + 0.1, y, yaw),
            estimate=Estimate((x, y + 0.05, yaw), (0.01, 0.0, 0.01, 0.001)),
            v=SPEED,
            w=SPEED / RADIUS,
            commanded=(SPEED, SPEED / RADIUS),
            volts=(0.5, 0.2),
            estop=self.estop,
            recording=self.recording,
            seed=self.seed,
            notes=(Note("warning", "MADE_UP <script>alert(1)</script>"),),
        )
        self.hub.state(state, {(CHAIR, 0): fan})
        self.hub.particles(np.column_stack([self._noise.normal((x, y), 0.05, (200, 2)), np.full(200, yaw)]))


class Running:
    """A rig behind a server, which runs at so many frames a second."""

    def __init__(self, control: bool = True, rate: float = 30.0, **changes) -> None:
        self.hub = Hub()
        self.rig = Rig(self.hub, **{k: changes.pop(k) for k in ("mode", "abilities") if k in changes})
        self.server = Server(viewer_settings(**changes), self.hub, self.rig, control)
        self.server.start()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(1 / rate,), daemon=True)
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        if self._stop.is_set():
            return
        self._stop.set()
        self._thread.join()
        self.server.close()

    def _run(self, period):
        while not self._stop.wait(period):
            if not self.rig.paused:
                self.rig.t += period * self.rig.speed
            self.rig.show()


if __name__ == "__main__":
    with Running(port=8642) as running:
        print(running.server.new_address(), flush=True)
        threading.Event().wait()
