# SPDX-License-Identifier: BSD-3-Clause
"""Effects of laser and map, usual form or other; then things that no catalogue has: floors, heat, lenses, sun, dirt."""

from collections.abc import Callable
from typing import Any

import numpy as np

from kurumaisu.bench.strangers.loch import laser
from kurumaisu.bench.strangers.loch.base import Out, enter, low_pass
from kurumaisu.bench.strangers.loch.laser import LASER, Mask, Shot, rng_of
from kurumaisu.bench.strangers.loch.motion import CATALOGUE, DT, Array, Hidden, State


def _map(s: Shot, k: float, h: Hidden) -> Out:
    """A tape that was stretched; other form: each thing stands elsewhere by some."""
    if h.form:
        return {"walls": laser.walls(s.boxes, rng_of(s, h, False).normal(0, abs(k), (len(s.boxes), 2)))}
    return {"walls": laser.Walls(s.walls.p * (1 + k), s.walls.d * (1 + k), s.walls.shine)}


def _warm(s: Shot, h: Hidden) -> Array:
    """How cold the laser still is; other form: electronics and housing warm at two speeds."""
    t = s.t + s.drive.start
    slow = np.exp(-t / (200 + 300 * h.u[0]))
    return np.asarray((0.5 * slow + 0.5 * np.exp(-t / 60) if h.form else slow)[:, None])


def column(s: Shot, name: str, usual: float) -> Array:
    """A column of the recording at the scans, about its usual value."""
    return (np.interp(s.t, s.drive.t, s.drive.columns[name]) - usual)[:, None]


def _oblique(s: Shot, h: Hidden) -> Array:
    """Tangent of incidence; other form: twice its sine's square."""
    c = np.maximum(s.cos, 0.15)
    return np.asarray(2 * (1 - c**2) if h.form else np.sqrt(1 - c**2) / c)


def _beams(s: Shot, k: float, h: Hidden) -> Out:
    """Each beam has its own offset; other form: a wave over the fan, as of a mirror that wobbles."""
    a = s.fan.angles
    wave = np.sin(2 * a + 6 * h.u[0]) + 0.4 * np.sin(5 * a)
    return {"mean": s.mean + k * (wave if h.form else rng_of(s, h, False).normal(0, 1, len(a)))}


def _common(s: Shot, k: float, h: Hidden) -> Out:
    """An error for all beams of a scan, with a memory; other form: without one."""
    e, rho = rng_of(s, h).normal(size=len(s.t)), 0.0 if h.form else 0.8
    for i in range(1, len(e)):
        e[i] = rho * e[i - 1] + (1 - rho**2) ** 0.5 * e[i]
    return {"common": s.common + k * e[:, None], "common_sd": k}


def _event(s: Shot, hit: Mask, change: Callable[[Array], Array | float]) -> Out:
    """Readings that are something else altogether."""
    return {"event": s.event | hit, "post": [*s.post, lambda r: np.where(hit, change(r), r)]}


def _tails(s: Shot, k: float, h: Hidden) -> Out:
    """Some readings are far off, to both sides; other form: exponentially far, and only too long."""
    rng = rng_of(s, h)
    hit = rng.random(s.mean.shape) < k
    far = rng.exponential(0.08, hit.shape) if h.form else rng.normal(0, 0.1, hit.shape)
    return _event(s, hit, lambda r: r + far)


def _edges(s: Shot, k: float, h: Hidden) -> Out:
    """At edges something between near and far; other form: nearer to the beam's own side."""
    rng, jump = rng_of(s, h), np.diff(s.mean, axis=1, append=s.mean[:, -1:])
    share = rng.beta(2, 4, jump.shape) if h.form else rng.random(jump.shape)
    two = np.diff(s.hit, axis=1, append=s.hit[:, -1:]) != 0  # along one wall there is nothing between
    return _event(s, two & (np.abs(jump) > 0.1) & (rng.random(jump.shape) < k), lambda r: r + share * jump)


def _lost(s: Shot, k: float, h: Hidden) -> Out:
    """Too little light comes back, anywhere alike, or in other form from dark, far and oblique things."""
    weak = (1.3 - s.shine) * s.r / 2 / np.maximum(s.cos, 0.3) if h.form else 1.0
    return _event(s, rng_of(s, h).random(s.mean.shape) < np.minimum(k * weak, 0.9), lambda r: np.nan)


def _far(s: Shot, k: float, h: Hidden) -> Out:
    """Nothing comes back from beyond; other form: it reads the largest value instead."""
    beyond = 1 / k if h.form else np.inf
    return {"event": s.event | (s.mean > 1 / k), "post": [*s.post, lambda r: np.where(r > 1 / k, beyond, r)]}


def _glare(s: Shot, k: float, h: Hidden) -> Out:
    """Another laser's light, in a sector that wanders, in bursts; other form: in single beams of a wide one."""
    rng = rng_of(s, h)
    on = (np.sin(s.t / (2 + 3 * h.u[0]) + 6 * rng.random()) > 0.6)[:, None]
    middle = 2.0 * np.sin(s.t * (0.1 + 0.3 * h.u[1]))[:, None]
    hit = on & (np.abs(s.fan.angles - middle) < (0.9 if h.form else 0.3))
    hit &= rng.random(hit.shape) < k * (0.4 if h.form else 1.0)
    noise = rng.uniform(0.1, 3.9, hit.shape)
    return _event(s, hit, lambda r: noise)


def _coarse(s: Shot, k: float, h: Hidden) -> Out:
    """Coarse steps; other form: cut off, not rounded."""
    up = k / 2 if h.form else 0.0
    return {
        "sd": np.hypot(s.sd, k / 12**0.5),
        "mean": s.mean - up,
        "post": [*s.post, lambda r: (np.floor(r / k + 0.5) if h.form else np.round(r / k)) * k],
    }


def _period(s: Shot, h: Hidden) -> Array:
    """Phase error over the modulation's half wave; other form: with a harmonic, as of a clipped signal."""
    a = 2 * np.pi * (s.r / (1.0 + 2.0 * h.u[0]) + h.u[1])
    return np.asarray(np.sin(a) + h.form * 0.35 * np.sin(2 * a))


def _mean(f: Callable[[Shot, Hidden], Array | float]) -> Callable[[Shot, float, Hidden], Out]:
    """A curve that is added to the means."""
    return lambda s, k, h: {"mean": s.mean + k * f(s, h)}


def _spread(f: Callable[[Shot, Hidden], Array | float]) -> Callable[[Shot, float, Hidden], Out]:
    """A curve by which the scatter grows."""
    return lambda s, k, h: {"sd": s.sd * (1 + k * f(s, h))}


for _heads, _words, _f in (
    (
        "geometry mount_x x .02 - .4",
        "bracket further forward, or a little aside, too",
        lambda s, k, h: {"x": s.x + k, "y": s.y + 0.1 * k * h.form},
    ),
    (
        "geometry mount_y y .02 - .4",
        "bracket to one side, or a little forward, too",
        lambda s, k, h: {"y": s.y + k, "x": s.x + 0.1 * k * h.form},
    ),
    (
        "geometry mount_yaw yaw .02 - .4",
        "bracket turned, or loose, so that it creeps",
        lambda s, k, h: {"yaw": s.yaw + k * (1 + h.form * (s.t / 200 - 0.3))[:, None]},
    ),
    (
        "geometry tilt - .06 + .2",
        "bent forward, or to one side",
        lambda s, k, h: {"pitch": 0.3 * k, "roll": k} if h.form else {"pitch": k},
    ),
    (
        "geometry sweep - .4 - 1",
        "motor at another speed, or uneven",
        lambda s, k, h: {
            "sweep": s.sweep * (1 + k) + h.form * 0.2 * k * s.sweep[-1] * np.sin(2 * np.pi * s.sweep / s.sweep[-1])
        },
    ),
    (
        "geometry latency delay .05 + .9",
        "stamped late, or now more, now less",
        lambda s, k, h: {"late": s.late - k * (rng_of(s, h).gamma(4.0, 0.25, len(s.t)) if h.form else 1)},
    ),
    (
        "geometry clock_skew - .001 - .02",
        "the laser's quartz, or set right every 45 s",
        lambda s, k, h: {"late": s.late - k * (s.t % 45 * 1.5 if h.form else s.t)},
    ),
    (
        "reading offset offset .001 - .3",
        "another datum, or not right before the window",
        _mean(lambda s, h: 1 - h.form * np.exp(-s.r / 0.4)),
    ),
    (
        "reading scale scale .001 - .1",
        "another clock of the counter, or more so far away",
        _mean(lambda s, h: s.r * (0.8 + 0.1 * s.r if h.form else 1)),
    ),
    (
        "reading quadratic quadratic .0005 - .05",
        "square, or from half a metre on",
        _mean(lambda s, h: 1.6 * np.maximum(s.r - 0.5, 0) ** 2 if h.form else s.r**2),
    ),
    ("reading warmup - .003 - .2", "cold at first, or two parts at two speeds", _mean(_warm)),
    (
        "reading temperature coefficient .0003 - .01",
        "by the air's temperature, or more so when hot",
        _mean(lambda s, h: column(s, "temperature", 20) * (1 + h.form * 0.05 * np.abs(column(s, "temperature", 20)))),
    ),
    ("reading cyclic - .001 - .05", "phase error, or with a harmonic", _mean(_period)),
    ("reading incidence_bias - .001 - .05", "by the tangent, or the sine's square", _mean(_oblique)),
    (
        "reading reflectance - .003 - .15",
        "dark things read off, or by the logarithm of the light",
        _mean(lambda s, h: -0.5 * np.log(s.shine) if h.form else 1 - s.shine),
    ),
    ("reading beam_bias - .001 + .05", "each beam has its offset, or a wave over the fan", _beams),
    (
        "reading range_noise - .1 +n 10",
        "more scatter, or the farther the more",
        _spread(lambda s, h: s.r / 2 if h.form else 1.0),
    ),
    ("reading incidence_noise - .1 +n 5", "scatter by the tangent, or the sine's square", _spread(_oblique)),
    ("reading common_mode sd .0005 + .05", "scans err as a whole, or each anew", _common),
    ("reading beam_correlation rho .1 +n .9", "neighbours err alike", lambda s, k, h: {"rho": min(k, 0.95)}),
    ("reading heavy_tails outliers .01 +n .3", "some are far off, or only too long", _tails),
    ("reading mixed_pixels probability .2 +n .95", "mixed at edges, or mostly the near side", _edges),
    ("reading dropout probability .02 +n .5", "lost readings, or of dark, far, oblique things", _lost),
    ("reading saturation inverse_far .28,.33 +n .8", "nothing from afar, or the largest value", _far),
    ("reading crosstalk - .2 +n .9", "bursts from another laser, or in single beams", _glare),
    ("reading quantisation step .005 +n .1", "coarse steps, or cut off", _coarse),
):
    enter(LASER, "laser.", _heads, _words, _f)
enter(LASER, "world.", "geometry map_error scale .005 - .05", "stretched map, or moved things", _map)
STORIES: dict[str, tuple[str, list[str]]] = {}
FIELDS = {
    "base.v": "v",
    "base.w": "w",
    "reference.x": "x",
    "reference.y": "y",
    "reference.heading": "th",
    "laser.range": "mean",
    "laser.noise": "sd",
}


def _since_rest(s: State) -> Array:
    """Time since the chair last stood."""
    i = np.arange(len(s.cv))
    return np.asarray((i - np.maximum.accumulate(np.where(s.moving > 0, -1, i))) * DT)


def _pulses(s: State, h: Hidden) -> Array:
    """Moments that come now and then, one side always."""
    t0 = np.cumsum(np.random.default_rng([s.drive.seed, int(1e6 * h.u[0])]).uniform(5, 13, 40))
    return np.asarray(sum(np.exp(-(((s.t - t) / 0.35) ** 4)) for t in t0))


def _bell(a: Array, middle: float, width: float) -> Array:
    """One hump."""
    return np.asarray(np.exp(-(((a - middle) / width) ** 2)))


def _step(a: Array, middle: float, width: float) -> Array:
    """From none to all."""
    return np.asarray(1 / (1 + np.exp(-(a - middle) / width)))


def _law(name: str, curve: Any) -> Any:
    """A curve that is added to what it follows, or by which scatter grows."""
    if name == "sd":
        return lambda s, k, h: {"sd": s.sd * (1 + k * curve(s, h))}
    return lambda s, k, h: {name: getattr(s, name) + k * curve(s, h)}


for _head, _say, _curve in (
    (
        "base.v carpet x 0.1 +p -",
        "a thick carpet in one part of the room brakes the chair",
        lambda s, h: -s.v * _step(s.guide.x, h.u[0] - 0.5, 0.15),
    ),
    (
        "base.w ridge y 0.05 p -",
        "a rut in the floor turns the chair where y has a certain value",
        lambda s, h: _bell(s.guide.y, h.u[0] - 0.5, 0.6) * s.moving,
    ),
    (
        "base.w hum time 0.03 - -",
        "an oscillation of the controller turns the chair to and fro",
        lambda s, h: np.sin(2 * np.pi * (s.t / (15 + 15 * h.u[0]) + h.u[1])),
    ),
    (
        "base.w cross_fall heading 0.03 p -",
        "the floor falls to one side and turns the chair downhill",
        lambda s, h: np.sin(s.guide.th - 6 * h.u[0]) * s.moving,
    ),
    (
        "base.w shimmy abs_v,v 0.05 - -",
        "at one speed a caster shimmies and pulls to one side",
        lambda s, h: _bell(np.abs(s.v), 0.25 + 0.15 * h.u[0], 0.08),
    ),
    (
        "base.v cold_brake time_since_rest 0.3 + -",
        "the parking brake drags for seconds after each start",
        lambda s, h: -s.v * np.exp(-_since_rest(s) / (2 + 2 * h.u[0])),
    ),
    (
        "base.w torque_steer acceleration 0.05 - -",
        "one motor pulls harder while the chair speeds up",
        lambda s, h: low_pass(np.gradient(low_pass(s.cv, 0.1), DT), 0.1),
    ),
    (
        "base.v motor_heat motor_temperature 0.01 + -",
        "hot motors are weaker",
        lambda s, h: -s.v * (s.drive.columns["motor_temperature"] - 40),
    ),
    (
        "base.w seat seat_angle 0.1 - -",
        "the tilted seat shifts the weight, which turns the chair",
        lambda s, h: (s.drive.columns["seat_angle"] - 0.2) * s.moving,
    ),
    ("base.w spin time 0.1 - -", "now and then a wheel loses its grip for a moment", _pulses),
    ("reference.x lens_x x 0.03 p -", "the camera's lens distorts x", lambda p, h: np.sin(2.2 * p.x + 6 * h.u[0])),
    (
        "reference.y lens_y x 0.03 p -",
        "the camera's lens distorts y along x",
        lambda p, h: np.sin(2.2 * p.x + 6 * h.u[0]),
    ),
    (
        "reference.heading compass heading 0.03 p -",
        "iron near the compass bends the heading",
        lambda p, h: np.sin(2 * p.th + 6 * h.u[0]),
    ),
    (
        "reference.y mast time 0.05 p -",
        "the mast with the camera sways",
        lambda p, h: np.sin(2 * np.pi * (p.t / (8 + 8 * h.u[0]) + h.u[1])),
    ),
    (
        "laser.range sun hit_x 0.003 - -",
        "sun on one part of the room shifts the readings of what it shines on",
        lambda s, h: _step(s.hx, 2 * h.u[0] - 1, 0.2),
    ),
    (
        "laser.range haze direction 0.003 - -",
        "light from one side shifts the readings towards it",
        lambda s, h: _bell(np.cos(s.direction - 6 * h.u[0]), 1.0, 0.4),
    ),
    (
        "laser.range strip hit_y 0.003 - -",
        "a strip of light shifts the readings of what lies in it",
        lambda s, h: _bell(s.hy, 3 * h.u[0] - 1.5, 0.7),
    ),
    (
        "laser.range whirl w 0.005 - -",
        "the laser's mirror bends as the chair turns",
        lambda s, h: np.interp(s.t, s.path.t, low_pass(s.path.w, 0.1))[:, None],
    ),
    (
        "laser.range supply supply 0.005 - -",
        "ranges follow the supply voltage",
        lambda s, h: column(s, "supply", 5.0) * 4,
    ),
    (
        "laser.noise shake abs_v,v 0.3 +n -",
        "the mast shakes as the chair drives, so readings scatter",
        lambda s, h: np.interp(s.t, s.path.t, np.abs(s.path.v))[:, None] / 0.3,
    ),
    (
        "laser.noise dirt bearing 0.3 +n -",
        "a smear on the window makes one sector's readings scatter",
        lambda s, h: _bell(s.fan.angles, 2 * h.u[0] - 1, 0.35),
    ),
    (
        "laser.noise lamp time 0.3 +n -",
        "a lamp that is switched on and off makes all readings scatter",
        lambda s, h: (np.sin(s.t / (3 + 4 * h.u[0]) + 6 * h.u[1]) > 0.3)[:, None] * 1.0,
    ),
):
    _channel, _rest = _head.split(" ", 1)
    _stage = {"base": "plane", "reference": "reference", "laser": "reading"}[_channel.split(".")[0]]
    _into = LASER if _stage == "reading" else CATALOGUE
    enter(_into, "unknown.", f"{_stage} {_rest}", _say, _law(FIELDS[_channel], _curve))
    STORIES["unknown." + _rest.split()[0]] = (_channel, _rest.split()[1].split(","))
EFFECTS = {**CATALOGUE, **LASER}
