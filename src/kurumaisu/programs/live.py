# SPDX-License-Identifier: BSD-3-Clause
"""The simulated chair on the page for browsers: driven by keys or stick, paused, put elsewhere, started anew."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kurumaisu.critic.experiment import rehearse
from kurumaisu.errors import Error
from kurumaisu.experiments import Limits
from kurumaisu.geometry import PLANAR, compose
from kurumaisu.params import Model
from kurumaisu.sim.chair.scanner import Scan
from kurumaisu.sim.chair.simulator import ChairSimulator, Command, Observation
from kurumaisu.sim.live.pacing import Pacer
from kurumaisu.sim.live.requests import Requests
from kurumaisu.sim.robots.machinery import Machinery
from kurumaisu.sim.robots.scenery import Piece, bounds, scenery
from kurumaisu.types import FloatArray
from kurumaisu.viewer import Body, Fan, Hub, Outcome, State, World
from kurumaisu.viewer.effects import Switches

_GLANCE = 0.1  # [s] of a pause, after which it is seen whether all is to end


@dataclass(frozen=True)
class Stick:
    """Velocities [m/s, rad/s] of a full stick; dead_man [s] of silence after which the chair stops."""

    v: float
    w: float
    dead_man: float


class LiveChair:
    """Simulates in a thread of its own, and shows it in a hub. Nothing happens before start."""

    mode = "sim"
    abilities = frozenset({"pause", "step", "speed", "reset", "seed", "set_pose", "drive", "effect", "save_model"})

    def __init__(
        self,
        hub: Hub,
        title: str,
        simulator: ChairSimulator,
        model: Model,
        file: Path,
        stick: Stick,
        limits: Limits,
        rate: float,
    ) -> None:
        """file: the model's; limits: the base's own; rate [Hz] of moments that are shown, by the clock."""
        self.title = title
        self.limits: Mapping[str, float] | None = {"v": stick.v, "w": stick.w}
        self._hub, self._simulator, self._model, self._file = hub, simulator, model, file
        self._switches = Switches()
        self._stick, self._base, self._period = stick, limits, 1 / rate
        self._asked, self._heard = np.zeros(2), -np.inf  # v [m/s], w [rad/s], and when, by the clock [s]
        self._commanded, self._volts = np.zeros(2), (0.0, 0.0)
        self._pacer, self._requests = Pacer(1.0), Requests()
        self._paused = self._closed = self._watched = False
        self._shown: tuple[Machinery, float] | None = None  # what runs, and when it was shown, by the clock [s]
        self._scan: Scan | None = None  # that is yet to be shown
        self._thread = threading.Thread(target=self._run, name="simulation", daemon=True)

    def start(self) -> None:
        """Begin to simulate."""
        self._seen = self._simulator.reset(self._simulator.seed)
        self._show()
        self._hub.effects(self._switches.set(self._model.effects))
        self._thread.start()

    def close(self) -> None:
        """Stop."""
        self._closed = True
        self._requests.close()
        self._thread.join()

    def watch(self, watched: bool) -> None:
        """Hear whether anybody looks: where nobody does, nothing is drawn, though time goes on."""
        self._watched = watched

    def command(self, name: str, arguments: Mapping[str, Any]) -> Outcome:
        """Obey, between two steps. Raise Error where that cannot be."""
        if name == "drive":
            return self._drive(**arguments)
        obey: dict[str, Callable[..., Outcome]] = {
            "pause": self._pause,
            "step": self._step,
            "speed": self._speed,
            "reset": self._reset,
            "seed": self._reset,
            "set_pose": self._put,
            "effect": self._switch,
            "save_model": lambda: self._switches.model(self._file),
        }
        try:
            outcome: Outcome = self._requests.ask(lambda: obey[name](**arguments))
        except RuntimeError as error:
            raise Error(f"{name}: {error}") from error
        return outcome

    def _drive(self, v: float, w: float, body: str | None = None) -> Outcome:
        if body is not None and body != self._chair:
            raise Error(f"drive: {body!r} cannot be driven")
        self._asked = np.clip([v, w], [-self._stick.v, -self._stick.w], [self._stick.v, self._stick.w])
        self._heard = time.monotonic()
        return Outcome("")

    def _pause(self, on: bool) -> Outcome:
        self._paused = on
        self._show()
        return Outcome("paused" if on else "runs")

    def _step(self) -> Outcome:
        if not self._paused:
            raise Error("step: pause first")
        self._advance()
        self._show()
        return Outcome(f"at {self._seen.time:.3f} s")

    def _speed(self, value: float) -> Outcome:
        self._pacer.speed = value
        self._show()
        return Outcome(f"speed {value:g}")

    def _reset(self, value: int | None = None) -> Outcome:
        self._seen = self._simulator.reset(self._simulator.seed if value is None else value)
        self._shown = None  # bodies may be others
        self._show()
        return Outcome(f"back at the start, seed {self._simulator.seed}")

    def _put(self, body: str, x: float, y: float, yaw: float) -> Outcome:
        piece = next((piece for piece in scenery(self._simulator.machinery) if piece.id == body), None)
        if piece is None or not piece.movable:
            raise Error(f"set_pose: there is no body {body!r} that can be moved")
        self._simulator.set_pose(body, [x, y, float(piece.pose[2]), yaw])
        self._show()
        return Outcome(f"{piece.name} moved")

    def _switch(self, effect: str, enabled: bool, values: Mapping[str, float]) -> Outcome:
        setting = self._switches.asked(effect, values)
        acting = {one.id: one for one in self._switches.acting} | {effect: setting}
        if not enabled:
            del acting[effect]
        self._simulator.switch(tuple(acting.values()))
        self._switches.remember(setting)
        self._hub.effects(self._switches.set(tuple(acting.values())))
        self._show()
        return Outcome(f"{effect} {'is on' if enabled else 'is off'}")

    def _run(self) -> None:
        while not self._closed:
            self._requests.serve()
            if self._paused:
                self._requests.wait(_GLANCE)
            elif self._pacer.wait(self._requests):
                self._advance()
                self._pacer.step(self._simulator.step_time)
                if self._watched and self._shown is not None and time.monotonic() >= self._shown[1] + self._period:
                    self._show()

    def _advance(self) -> None:
        held = time.monotonic() - self._heard <= self._stick.dead_man
        self._commanded = self._asked if held else np.zeros(2)
        volts = rehearse.voltages(self._model, self._base, np.array([[0.0, *self._commanded]]))[0]
        self._volts = (float(volts[1]), float(volts[2]))
        self._seen = self._simulator.step(Command(*self._volts, *np.sign(volts[3:])))
        if self._seen.scan is not None:
            self._scan = self._seen.scan

    def _show(self) -> None:
        """Show this moment, and first the bodies, if they are others."""
        machinery = self._simulator.machinery
        if self._shown is None or machinery is not self._shown[0]:
            self._describe(machinery)
        self._shown = machinery, time.monotonic()
        scan, self._scan = self._scan, None
        scans = {} if scan is None else {(self._places[self._simulator.row], 0): self._fan(scan)}
        self._hub.state(self._state(machinery, self._seen), scans)

    def _state(self, machinery: Machinery, seen: Observation) -> State:
        poses = {body: _pose(pose) for body, pose in self._still.items()}
        poses |= {
            self._ids[row]: _pose(frame) for row, frame in enumerate(machinery.frames[:-1, PLANAR]) if row in self._ids
        }
        return State(
            t=seen.time,
            wall=time.time(),
            speed=self._pacer.speed,
            paused=self._paused,
            poses=poses,
            hit=tuple(self._ids[row] for row in np.flatnonzero(machinery.stalled).tolist() if row in self._ids),
            truth=poses[self._chair],
            v=float(seen.rates[0]),
            w=float(seen.rates[2]),
            commanded=(float(self._commanded[0]), float(self._commanded[1])),
            volts=self._volts,
            seed=self._simulator.seed,
        )

    def _describe(self, machinery: Machinery) -> None:
        pieces = scenery(machinery)
        self._ids = {piece.row: piece.id for piece in pieces if piece.row >= 0}
        self._places = {piece.row: place for place, piece in enumerate(pieces) if piece.row >= 0}
        self._still = {piece.id: piece.pose[PLANAR] for piece in pieces if piece.row < 0 and piece.kind != "wall"}
        self._chair = self._ids[self._simulator.row]
        bodies = tuple(_body(piece, piece.id == self._chair) for piece in pieces)
        self._hub.world(World(bodies, bounds(pieces), self._chair))

    def _fan(self, scan: Scan) -> Fan:
        laser = self._model.laser
        mount = np.array([laser.mount.x, laser.mount.y, laser.mount.yaw])
        error = np.full(len(scan.ranges), np.nan)
        np.subtract(scan.ranges, scan.truths, out=error, where=np.isfinite(scan.ranges) & np.isfinite(scan.truths))
        return Fan(
            pose=_pose(compose(scan.pose, mount)),
            angle_min=laser.angle_min,
            angle_increment=laser.angle_increment,
            range_min=laser.range_min,
            range_max=laser.range_max,
            ranges=scan.ranges,
            error=error,
            intensities=scan.returns,
        )


def _pose(row: FloatArray) -> tuple[float, float, float]:
    x, y, yaw = row.tolist()
    return x, y, yaw


def _body(piece: Piece, drivable: bool) -> Body:
    """Return a body as a page has it: walls have no pose there, so their outlines are in the world's frame."""
    pose = piece.pose[PLANAR] if piece.kind == "wall" else np.zeros(3)
    polygons = [_moved(pose, polygon) for polygon in piece.polygons]
    segments = _moved(pose, piece.segments.reshape(-1, 2)).reshape(-1, 4)
    return Body(
        id=piece.id,
        name=piece.name,
        kind=piece.kind,  # type: ignore[arg-type]  # scenery's kinds are the page's
        color="#" + "".join(f"{round(255 * share):02x}" for share in piece.color[:3]),
        movable=piece.movable,
        polygons=tuple(tuple((x, y) for x, y in polygon.tolist()) for polygon in polygons),
        segments=tuple(tuple(ends) for ends in segments.tolist()),
        drivable=drivable,
    )


def _moved(pose: FloatArray, points: FloatArray) -> FloatArray:
    """Return points (k, 2) of a pose's (3,) frame in the world's."""
    moved: FloatArray = np.round(compose(pose, np.column_stack([points, np.zeros(len(points))]))[:, :2], 4)
    return moved
