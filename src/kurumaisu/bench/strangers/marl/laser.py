# SPDX-License-Identifier: BSD-3-Clause
"""What beams meet, and with it causes in mean readings and in the scatter of single ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kurumaisu.bench.strangers.marl.causes import Cause, Causes, size_of
from kurumaisu.bench.strangers.marl.driving import Drive
from kurumaisu.bench.strangers.marl.motions import at, between, compose
from kurumaisu.bench.strangers.marl.rooms import Room, cast, line, slopes
from kurumaisu.bench.strangers.marl.things import RESOLUTION
from kurumaisu.types import BoolArray, FloatArray, IntArray


class View:
    """What the beams of scans at stamps t meet, with the robot at poses (3, s) there and moving as path says."""

    def __init__(
        self,
        d: Drive,
        room: Room,
        t: FloatArray,
        poses: FloatArray,
        causes: Causes = (),
        path: FloatArray | None = None,
        hit: IntArray | None = None,
    ) -> None:
        assert d.laser
        las, path = d.laser, d.path if path is None else path
        self.d, self.laser, self.t, self.n, self.dark = d, las, t, las.beams, room.dark
        stretch, latency = 1 + size_of(causes, "laser.sweep"), size_of(causes, "laser.latency")
        within = np.arange(self.n) * las.beam_time * stretch - latency
        beam_t = (t * (1 - size_of(causes, "laser.clock_skew")))[:, None] + within
        q = compose(self._each(poses), between(self._each(at(path, t)), at(path, beam_t.ravel())))
        mx, my = las.x + size_of(causes, "laser.mount_x"), las.y + size_of(causes, "laser.mount_y")
        c, s = np.cos(q[2]), np.sin(q[2])
        self.o = np.stack([q[0] + c * mx - s * my, q[1] + s * mx + c * my], 1)
        self.bearing = np.tile(las.bearing, len(t))
        self.a = q[2] + las.yaw + size_of(causes, "laser.mount_yaw") + self.bearing
        seg = next((c.own["seg"] for c in causes if c.id == "world.map_error"), room.seg)
        self.hit = cast(self.o, self.a, seg) if hit is None else hit
        self.seg = seg[self.hit]
        self.r, self.cos = line(self.o, self.a, self.seg)
        self.time = self._each(t)

    def _each(self, x: FloatArray) -> FloatArray:
        """Return values of scans for each of their beams."""
        return np.repeat(x, self.n, -1)

    def jacobian(self) -> FloatArray:
        """Return d range / d (x, y, heading of the pose) in the map frame (n, 3)."""
        ex, ey, den = slopes(self.a, self.seg)
        den = np.where(np.abs(den) < 1e-9, 1e-9, den)
        h = 1e-5
        turned, _ = line(self.o, self.a + h, self.seg)
        lever = self.o - self._each(at(self.d.path, self.t)[:2]).T
        jx, jy = -ey / den, ex / den
        return np.stack([jx, jy, (turned - self.r) / h - jx * lever[:, 1] + jy * lever[:, 0]], 1)

    def edge(self) -> BoolArray:
        """Return whether a neighbouring beam meets another surface, well before or behind."""
        r, hit = self.r.reshape(-1, self.n), self.hit.reshape(-1, self.n)
        jump = (np.abs(np.diff(r)) > 0.06) & (np.diff(hit) != 0)
        e = np.zeros(r.shape, bool)
        e[:, 1:] |= jump
        e[:, :-1] |= jump
        return e.ravel()

    def around(self) -> tuple[FloatArray, FloatArray]:
        """Return the shortest and the longest range of a beam and its neighbours."""
        r = self.r.reshape(-1, self.n)
        three = np.roll(r, 1, 1), r, np.roll(r, -1, 1)
        return np.min(three, 0).ravel(), np.max(three, 0).ravel()


OVER: dict[str, Callable[[View], FloatArray]] = {  # what something unknown follows, shaped to about -1..1
    "humidity": lambda q: np.tanh(1.5 * (q.d.covariates["humidity"](q.time) - 50) / 10),
    "bearing": lambda q: np.exp(-(((q.bearing - q.laser.bearing.mean() - 0.2) / 0.12) ** 2)),
    "direction": lambda q: np.sin(3 * q.a + 1.0),
    "hit_x": lambda q: np.sin(2.3 * (q.o[:, 0] + q.r * np.cos(q.a))),
    "hit_y": lambda q: np.sin(2.6 * (q.o[:, 1] + q.r * np.sin(q.a))),
    "abs_v": lambda q: np.interp(q.time, q.d.t, np.abs(q.d.v)) / q.d.robot.v,
    "abs_w": lambda q: np.minimum(np.interp(q.time, q.d.t, np.abs(q.d.w)) / q.d.robot.w, 1),
    "time": lambda q: (np.sin(q.time / 6.1) + np.sin(q.time / 3.7 + 1) > 1.1) * 1.0,
    "range": lambda q: np.exp(-(((q.r - 0.45 * min(q.laser.far, 6)) / 0.15) ** 2)),
}


def _tilted(q: View, c: Cause) -> FloatArray:
    """Return ranges of a tilted fan, which meets the floor in places."""
    e = -c.size * np.cos(q.bearing - c.own["way"])
    r = q.r / np.cos(e)
    return np.where(e < -1e-6, np.minimum(r, q.laser.height / np.sin(np.maximum(-e, 1e-6))), r)


def _warmup(q: View, r: FloatArray, c: Cause) -> FloatArray:
    t, tau = q.time + q.d.start, c.own["tau"]
    return np.asarray(0.5 * np.exp(-t / tau * 2) + 0.5 / (1 + t / tau) if c.other else np.exp(-t / tau))


def _temperature(q: View, r: FloatArray, c: Cause) -> FloatArray:
    if not c.other:
        return q.d.covariates["temperature"](q.time) - 20
    late = q.d.covariates["temperature"](q.time - 40.0) - 20
    return np.asarray(late + 0.15 * late * np.abs(late) / 5)


def _cyclic(q: View, r: FloatArray, c: Cause) -> FloatArray:
    phase = 2 * np.pi * r / c.own["wavelength"] + c.own["phase"]
    return np.asarray(2 / np.pi * np.arcsin(np.sin(phase)) * 1.2 if c.other else np.sin(phase))


def _beam_bias(q: View, r: FloatArray, c: Cause) -> FloatArray:
    own = c.own["draw"][: q.n]
    b = own if c.other else np.sin(q.laser.bearing + c.own["phase"]) * 0.7 + own * 0.5
    return np.tile(b, len(q.t))


def _incidence(q: View, r: FloatArray, c: Cause) -> FloatArray:
    return np.minimum(np.sqrt(1 / q.cos**2 - 1) ** 1.5 if c.other else 1 / q.cos - 1, 8)


ADDED: dict[str, Callable[[View, FloatArray, Cause], FloatArray | float]] = {  # to mean readings, for a size of 1
    "laser.offset": lambda q, r, c: 1 + 0.25 * np.sin(q.bearing / 2) if c.other else 1,
    "laser.scale": lambda q, r, c: np.asarray(r**1.2 if c.other else r),
    "laser.quadratic": lambda q, r, c: r**2.6 / 2**0.6 if c.other else r * r,
    "laser.warmup": _warmup,
    "laser.temperature": _temperature,
    "laser.cyclic": _cyclic,
    "laser.incidence_bias": _incidence,
    "laser.reflectance": lambda q, r, c: q.dark[q.hit] * (r / 2 if c.other else np.ones(1)),
    "laser.beam_bias": _beam_bias,
}


def _saturated(m: FloatArray, c: Cause) -> FloatArray:
    far = c.own["far"] / (1 + c.size)
    if not c.other:
        return np.minimum(m, far)
    return np.where(m > far, far * 1.02 - 0.02 * far * np.exp(-(np.maximum(m, far) - far)), m)


def mean(q: View, causes: Causes) -> FloatArray:
    """Return mean readings."""
    r = next((_tilted(q, c) for c in causes if c.id == "laser.tilt"), q.r)
    m = q.laser.kind.scale * r + q.laser.kind.datum
    for c in causes:
        if c.id in ADDED:
            m = m + c.size * ADDED[c.id](q, r, c)
        elif c.id == "laser.saturation":
            m = _saturated(m, c)
        elif c.channel == "laser.range":
            m = m + c.size * OVER[c.of](q)
    return m


def sd(q: View, causes: Causes) -> FloatArray:
    """Return the scatter of single readings, rounding included."""
    sigma = q.laser.kind.sigma
    s = np.maximum(sigma[0] + sigma[1] * q.r + sigma[2] * q.r * q.r, 5e-4)
    for c in causes:
        if c.id == "laser.range_noise":
            s = s + c.size * 0.0015 * q.r if c.other else s * (1 + c.size)
        elif c.id == "laser.incidence_noise":
            s = s * (1 + c.size * np.minimum((1 / q.cos**2 - 1) ** 0.5 if c.other else 1 / q.cos - 1, 6))
        elif c.channel == "laser.spread":
            s = s * np.exp(c.size * OVER[c.of](q))
    return np.asarray(np.sqrt(s * s + RESOLUTION**2 / 12))
