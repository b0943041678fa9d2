# SPDX-License-Identifier: BSD-3-Clause
"""Scans: what the laser reads, with causes of its mean, its noise and its readings."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .model import DATUM, GATE, SLOPE, STEP, Cause, F, Run, arr, sigma, turn
from .room import Room, Shape, raster

P = dict[str, float]


@dataclass
class Fan:
    """Where the laser is on the robot, and its beams."""

    x: float
    y: float
    yaw: float
    angle_min: float
    step: float
    beams: int
    lag: float  # between beams [s]


@dataclass
class Look:
    """Everything about each reading: scans x beams."""

    run: Run
    fan: Fan
    t: F
    bearing: F  # in the robot's frame
    x: F
    y: F
    th: F
    r: F
    face: F
    oblique: F  # cosine of the incidence
    grey: F
    j: F  # how a range changes with the robot's pose in its own frame: ... x 3
    ok: F  # 1 where a reading is expected away from edges

    @property
    def mean(self) -> F:
        """Mean of a reading without causes."""
        return SLOPE * self.r + DATUM

    @property
    def direction(self) -> F:
        """Direction in the room."""
        return self.th + self.bearing


def _get(causes: list[Cause], name: str, key: str) -> tuple[float, int]:
    for c in causes:
        if c.id == name:
            return c.p[key], c.form
    return 0.0, 0


def times(run: Run, fan: Fan, causes: list[Cause], stamp: F) -> F:
    """When each beam is taken."""
    i = np.arange(fan.beams)
    stretch, f = _get(causes, "laser.sweep", "stretch")
    late, g = _get(causes, "laser.latency", "delay")
    skew, h = _get(causes, "laser.clock_skew", "skew")
    part = i / fan.beams
    own = i * fan.lag * (1 + stretch * (1.0 if f == 0 else 2 * part if f == 1 else 1.5 * (part > 0.5)))
    t = stamp - late * (1 + (np.sin(stamp * 2.1) if g == 1 else np.sign(np.sin(stamp * 5.3)) * 0.7 if g == 2 else 0.0))
    half = 2 * skew * np.maximum(t - run.pt[-1] / 2, 0)
    t = (t / (1 + skew), t - skew * t * t / 60, t - half)[h]
    return arr(t[:, None] + own[None, :])


def moved(room: Room, causes: list[Cause], seed: int) -> Room:
    """The room as it is, where the map is not right."""
    for c in causes:
        if c.id == "world.map_error":
            rng, out = np.random.default_rng(seed), []
            for s in room.shapes:
                d = rng.standard_normal(2) * c.p.get("sd", 0.0)
                k = 1 + c.p.get("scale", 0.0)
                ky = k if c.form == 0 else 1.0
                if s.sort == "outline":
                    b = s.b * np.hypot(k * np.cos(s.a), ky * np.sin(s.a))
                    b = b + rng.standard_normal(len(b)) * c.p.get("sd", 0.0)
                    out.append(Shape(s.sort, s.a, b, s.grey))
                else:
                    a = s.a.copy()
                    a[0], a[1] = a[0] * k + d[0], a[1] * ky + d[1]
                    out.append(Shape(s.sort, a, s.b, s.grey))
            return raster(out, min(room.res, 0.0025 if room.solid.size * room.res**2 < 60 else 0.005))
    return room


def look(room: Room, run: Run, fan: Fan, causes: list[Cause], poses: tuple[F, F, F] | None = None) -> Look:
    """Cast the beams of all scans from where the robot really was, or from other poses (scans x beams)."""
    t = times(run, fan, causes, run.st)
    bearing = fan.angle_min + fan.step * np.arange(fan.beams) + fan.yaw + _get(causes, "laser.mount_yaw", "yaw")[0]
    mx = fan.x + _get(causes, "laser.mount_x", "x")[0]
    my = fan.y + _get(causes, "laser.mount_y", "y")[0]
    x, y, th = run.at(t) if poses is None else poses
    px, py = turn(th, np.array(mx), np.array(my))
    a = th + bearing
    r, hit = room.cast((x + px).ravel(), (y + py).ravel(), a.ravel())
    r, hit = r.reshape(t.shape), hit.reshape(t.shape)
    seen = hit >= 0
    face = np.where(seen, room.face.ravel()[hit], 0.0)
    which = np.where(seen, room.which.ravel()[hit], 0)
    facing = np.maximum(-np.cos(face - a), 0.02)
    jx, jy = np.cos(face - th) / facing, np.sin(face - th) / facing
    ray = np.where(seen, r, 0.0) * np.sin(face - a) / facing
    j = np.stack([jx, jy, jx * -my + jy * mx + ray], axis=-1)
    mu = np.where(seen, SLOPE * r + DATUM, 9.0)
    left, right = np.roll(mu, 1, axis=1), np.roll(mu, -1, axis=1)
    flat = np.abs(left + right - 2 * mu) < 0.06 + 0.02 * mu
    ok = seen & (mu < GATE[1] - 0.02) & (mu > GATE[0] + 0.02) & flat & (facing > 0.12)
    ok[:, 0] = ok[:, -1] = False
    wide = np.broadcast_to(bearing, t.shape)
    return Look(run, fan, t, wide, x, y, th, r, face, facing, room.grey()[which], j, ok.astype(float))


def speeds(k: Look) -> tuple[F, F, F]:
    """Rates in the body frame at each beam, of the path that was driven."""
    h = 0.02
    a, b = k.run.at(k.t - h), k.run.at(k.t + h)
    vx, vy = turn(-k.th, (b[0] - a[0]) / (2 * h), (b[1] - a[1]) / (2 * h))
    return vx, vy, (b[2] - a[2]) / (2 * h)


def _geometry(k: Look, c: Cause) -> F:
    """First order of what moves the laser."""
    if c.id == "laser.mount_x":
        return k.j[..., 0] * c.p["x"]
    if c.id == "laser.mount_y":
        return k.j[..., 1] * c.p["y"]
    if c.id == "laser.mount_yaw":  # turned about itself, not about the robot
        facing = k.oblique
        return arr(k.r * np.sin(k.face - k.direction) / facing * c.p["yaw"])
    v = speeds(k)
    late = times(k.run, k.fan, [c], k.run.st) - times(k.run, k.fan, [], k.run.st)
    return arr((k.j[..., 0] * v[0] + k.j[..., 1] * v[1] + k.j[..., 2] * v[2]) * late)


def _tilt(k: Look, p: P, f: int) -> F:
    e = p["pitch"] * np.cos(k.bearing) + p["roll"] * np.sin(k.bearing)
    return arr(k.r * ((1 / np.cos(e) - 1) if f == 0 else np.maximum(e, 0) ** 2))


def _warmup(k: Look, p: P, f: int) -> F:
    q = k.t / p["tau"]
    return p["amplitude"] * (np.exp(-q), np.maximum(1 - q / 2, 0.0), 0.5 * np.exp(-q / 2) + 0.5 * np.exp(-q * 3))[f]


def _temperature(k: Look, p: P, f: int) -> F:
    d = k.run.column("temperature", k.t) - 20.0
    return p["coefficient"] * (d, d * np.abs(d) / 4, np.maximum(d, 0) * 1.5)[f]


def _cyclic(k: Look, p: P, f: int) -> F:
    q = 2 * np.pi * k.r / p["wavelength"] + p["phase"]
    waves = (np.sin(q), 2 / np.pi * np.arcsin(np.sin(q)) * 1.2, np.sin(q) + 0.5 * np.sin(2 * q + 1))
    return arr(p["amplitude"] * waves[f])


def _incidence(k: Look, p: P, f: int) -> F:
    i = np.minimum(1 / k.oblique, 8.0) - 1
    return p["k"] * (i, (i + 1) ** 2 / 3 - 1 / 3, np.maximum(i - 0.5, 0) * 1.5)[f]


def _beams(k: Look, p: P, f: int) -> F:
    rng = np.random.default_rng(int(p["seed"]))
    own = rng.standard_normal(k.fan.beams) * p["sd"]
    b = k.bearing[0]
    mirror = (np.sin(b + p["phase"]), np.sin(2 * b + p["phase"]), np.sign(np.sin(b * 3 + p["phase"])))[f]
    return np.broadcast_to(own + p["amplitude"] * mirror, k.r.shape)


Add = Callable[[Look, P, int], F]
MEAN: dict[str, Add] = {
    "laser.tilt": _tilt,
    "laser.offset": lambda k, p, f: p["offset"] * (1 + 0.5 * (f == 1) * np.sin(k.t / 8) + 0.4 * (f == 2) * (k.r < 1.2)),
    "laser.scale": lambda k, p, f: p["scale"] * (k.r, 3 * np.tanh(k.r / 2), np.maximum(k.r - 1, 0) * 1.5)[f],
    "laser.quadratic": lambda k, p, f: p["quadratic"] * (k.r**2, k.r**3 / 2.5, np.maximum(k.r - 1, 0) ** 2 * 2)[f],
    "laser.warmup": _warmup,
    "laser.temperature": _temperature,
    "laser.cyclic": _cyclic,
    "laser.incidence_bias": _incidence,
    "laser.reflectance": lambda k, p, f: p["bias"] * (k.grey if f == 0 else k.grey**2 * 2 if f == 1 else k.grey > 0.2),
    "laser.beam_bias": _beams,
}
SPREAD: dict[str, Add] = {
    "laser.range_noise": lambda k, p, f: 1 + p["share"] * (1.0 + 0 * k.r, k.r / 1.5, 1.5 * (k.r > 1))[f],
    "laser.incidence_noise": lambda k, p, f: (
        1
        + p["gain"]
        * (np.minimum(1 / k.oblique, 8) - 1, np.sqrt(1 / k.oblique**2 - 1).clip(0, 6), 2.0 * (k.oblique < 0.6))[f]
    ),
}
SHAPED = ("laser.mount_x", "laser.mount_y", "laser.mount_yaw", "laser.sweep", "laser.latency", "laser.clock_skew")


def signal(k: Look, c: Cause) -> F:
    """By how much a cause changes the mean of each reading, to first order."""
    from .unknown import RANGE

    with np.errstate(invalid="ignore"):
        if c.id in SHAPED:
            s = _geometry(k, c)
        elif c.id in MEAN:
            s = MEAN[c.id](k, c.p, c.form)
        elif c.id in RANGE:
            s = RANGE[c.id](k, c.p)
        else:
            return np.zeros(k.r.shape)
    return np.where(k.ok > 0, np.where(np.isfinite(s), s, 0.0), 0.0)


def width(k: Look, causes: list[Cause]) -> F:
    """Standard deviation of each reading, without the step of 1 mm."""
    from .unknown import SCATTER

    with np.errstate(invalid="ignore"):
        sd = np.where(np.isfinite(k.r), sigma(k.r), 0.003)
        for c in causes:
            if c.id in SPREAD:
                sd = sd * np.maximum(SPREAD[c.id](k, c.p, c.form), 0.05)
            elif c.id in SCATTER:
                sd = sd * np.maximum(SCATTER[c.id](k, c.p), 0.05)
    return sd


def readings(k: Look, causes: list[Cause], rng: np.random.Generator) -> tuple[F, F]:
    """Readings as they are written, and how surely each one shows a cause of the scatter (twice the log ratio)."""
    from .unknown import RANGE, errors, finish

    n, told = errors(k, causes, rng)
    with np.errstate(invalid="ignore"):
        m = k.mean + 0.0
        for c in causes:
            if c.id in MEAN:
                m = m + MEAN[c.id](k, c.p, c.form)
            elif c.id in RANGE:
                m = m + RANGE[c.id](k, c.p)
        z = m + width(k, causes) * n
    return finish(k, z, causes, rng, told)


def gate(z: F) -> F:
    """Steps of a millimetre, then the gate."""
    z = np.round(z / STEP) * STEP
    return np.where(z < GATE[0], np.nan, np.where(z > GATE[1], np.inf, z))
