# SPDX-License-Identifier: BSD-3-Clause
"""Things that happen to chairs and lasers and are in no catalogue, with the words that would be right about each.

An answer is right when it names the channel and any of the covariates: what a thing follows has often two names.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.bench.hidden.generator.motion import STEP, Fault, Form, Rates, Sizes
from kurumaisu.bench.hidden.generator.scanning import Scans
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class Unknown:
    """Something outside the catalogue: form, typical size, channel and covariates it is right to name."""

    form: Form
    typical: float
    channel: str
    covariates: tuple[str, ...]
    extra: Callable[[np.random.Generator], Sizes] = lambda _: {}

    def draw(self, rng: np.random.Generator) -> Sizes:
        """Return sizes of either sign."""
        return {"size": self.typical * float(rng.choice([-1.0, 1.0])), **self.extra(rng)}

    def fault(self, sizes: Sizes, form: str) -> Fault:
        """Return the fault of these sizes; there is one form only."""
        return Fault(self.form, sizes)


def carpet(r: Rates, s: Sizes) -> Rates:
    """V less by a share `size` on half of the floor, beyond x = `edge` in the map.

    Where the chair is depends on how much it was held up, and on its noise: another path than the one asked for.
    """
    heading = r.headings()
    cos, sin = np.cos(heading), np.sin(heading)
    ahead = (cos * r.v * STEP).tolist()
    shaken = (r.moving * (cos * r.noise[:, 0] - sin * r.noise[:, 1]) * STEP).tolist()
    x, line = float(r.start[0]), s["edge"]
    held = np.empty(len(ahead))
    for k, (step, shake) in enumerate(zip(ahead, shaken, strict=True)):
        held[k] = s["size"] * (x > line)
        x += step * (1 - held[k]) + shake
    return replace(r, v=r.v * (1 - held))


def heading_veer(r: Rates, s: Sizes) -> Rates:
    """A turn of `size` [rad/s] by the sine of the heading that the chair has come to, as of wind on a sail."""
    turns = (STEP * (r.w + r.moving * r.noise[:, 2])).tolist()
    heading = float(r.start[2] - s["bearing"])
    pull = np.empty(len(turns))
    for k, (turn, moving) in enumerate(zip(turns, r.moving.tolist(), strict=True)):
        pull[k] = s["size"] * moving * math.sin(heading + turn / 2)
        heading += turn + STEP * pull[k]
    return replace(r, w=r.w + pull)


def eccentric(r: Rates, s: Sizes) -> Rates:
    """V in waves of the distance travelled: a wheel out of round by a share `size`, once per `girth` [m]."""
    way = np.cumsum(np.abs(r.v)) * STEP
    return replace(r, v=r.v * (1 + s["size"] * np.sin(2 * np.pi * way / s["girth"])))


def step_in_time(r: Rates, s: Sizes) -> Rates:
    """V faster by a share `size` from a moment on: somebody let the brake go."""
    return replace(r, v=r.v * (1 + s["size"] * (r.t > s["moment"])))


def mixed_gain(r: Rates, s: Sizes) -> Rates:
    """V faster by a share `size` per unit of how hard it drives and turns at once."""
    return replace(r, v=r.v * (1 + s["size"] * np.abs(r.v * r.w) / 0.1))


def bump(r: Rates, s: Sizes) -> Rates:
    """A resonance: v less by `size` [m/s] around 0.4 m/s."""
    return replace(r, v=r.v - s["size"] * np.sign(r.v) * np.exp(-((np.abs(r.v) - 0.4) ** 2) / (2 * 0.06**2)))


def swing(r: Rates, s: Sizes) -> Rates:
    """A slow turn to and fro with the time, `size` [rad/s], period 25 s."""
    return replace(r, w=r.w + s["size"] * r.moving * np.sin(2 * np.pi * r.t / 25.0 + s["phase"]))


def threshold_slip(r: Rates, s: Sizes) -> Rates:
    """W less by a share `size` as soon as it turns faster than 0.4 rad/s."""
    return replace(r, w=np.where(np.abs(r.w) > 0.4, r.w * (1 - s["size"]), r.w))


def flat_spot(r: Rates, s: Sizes) -> Rates:
    """V less by a share `size` for a tenth of a turn of a wheel: where it was stood on for a winter."""
    turn = np.cumsum(np.abs(r.v)) * STEP / s["girth"] - s["spot"]
    return replace(r, v=r.v * (1 - s["size"] * np.exp(-((turn - np.round(turn)) ** 2) / (2 * 0.05**2))))


def derating(r: Rates, s: Sizes) -> Rates:
    """V less from a moment on, within 8 s by a share `size`: the controller is hot and saves itself."""
    return replace(r, v=r.v * (1 - s["size"] * np.clip((r.t - s["moment"]) / 8.0, 0.0, 1.0)))


def puncture(r: Rates, s: Sizes) -> Rates:
    """A turn of `size` per metre driven from a moment on: a tyre goes flat."""
    return replace(r, w=r.w + s["size"] * r.v * (r.t > s["moment"]))


def draught(r: Rates, s: Sizes) -> Rates:
    """A turn of `size` [rad/s] beside an open door: within half a metre of y = `door` in the map."""
    turns = (STEP * (r.w + r.moving * r.noise[:, 2])).tolist()
    ahead = (STEP * (r.v + r.moving * r.noise[:, 0])).tolist()
    aside = (STEP * r.moving * r.noise[:, 1]).tolist()
    heading, y = float(r.start[2]), float(r.start[1] - s["door"])
    push = np.empty(len(turns))
    for k, (turn, moving) in enumerate(zip(turns, r.moving.tolist(), strict=True)):
        push[k] = s["size"] * moving * math.exp(-(y**2) / (2 * 0.5**2))
        turn += STEP * push[k]
        y += ahead[k] * math.sin(heading + turn / 2) + aside[k] * math.cos(heading + turn / 2)
        heading += turn
    return replace(r, w=r.w + push)


def sector_bias(c: Scans, s: Sizes) -> Scans:
    """Readings `size` [m] longer in a sector of the fan 0.7 rad wide, as behind a scratched window."""
    return _longer(c, s["size"] * (np.abs(c.bearings - s["bearing"]) < 0.35))


def place_bias(c: Scans, s: Sizes) -> Scans:
    """Readings `size` [m] longer where the left half of a room is hit: wallpaper."""
    return _longer(c, s["size"] * (np.cos(c.angles) < 0))


def ambient_bias(c: Scans, s: Sizes) -> Scans:
    """Readings `size` [m] longer by the cosine of the heading: the sun."""
    return _longer(c, s["size"] * np.cos(c.headings - s["bearing"])[:, None])


def near_step(c: Scans, s: Sizes) -> Scans:
    """Readings `size` [m] longer beyond a distance: a change of the amplifier's range."""
    return _longer(c, s["size"] * (c.ranges > s["edge"]))


def pulse_bias(c: Scans, s: Sizes) -> Scans:
    """Readings `size` [m] longer for every other half minute of the time: a neighbour's supply."""
    return _longer(c, s["size"] * (np.sin(2 * np.pi * c.stamps / s["period"]) > 0)[:, None])


def _longer(c: Scans, bias: FloatArray) -> Scans:
    return replace(c, mean=c.mean + bias)


def _uniform(name: str, low: float, high: float) -> Callable[[np.random.Generator], Sizes]:
    return lambda rng: {name: float(rng.uniform(low, high))}


_bearing = _uniform("bearing", -np.pi, np.pi)
UNKNOWN_BASE: dict[str, Unknown] = {
    "carpet": Unknown(Form("floor", carpet), 0.1, "base.v", ("x", "position"), _uniform("edge", -0.5, 0.5)),
    "heading_veer": Unknown(Form("floor", heading_veer), 0.03, "base.w", ("heading",), _bearing),
    "eccentric": Unknown(Form("floor", eccentric), 0.05, "base.v", ("distance",), _uniform("girth", 0.8, 1.3)),
    "step_in_time": Unknown(Form("floor", step_in_time), 0.05, "base.v", ("t", "time"), _uniform("moment", 15.0, 45.0)),
    "mixed_gain": Unknown(Form("floor", mixed_gain), 0.05, "base.v", ("vw", "|vw|")),
    "bump": Unknown(Form("floor", bump), 0.02, "base.v", ("v", "|v|")),
    "swing": Unknown(Form("floor", swing), 0.02, "base.w", ("t", "time"), _uniform("phase", -np.pi, np.pi)),
    "threshold_slip": Unknown(Form("floor", threshold_slip), 0.1, "base.w", ("w", "|w|")),
    "flat_spot": Unknown(
        Form("floor", flat_spot),
        0.1,
        "base.v",
        ("distance",),
        lambda rng: {"girth": float(rng.uniform(0.8, 1.3)), "spot": float(rng.random())},
    ),
    "derating": Unknown(Form("floor", derating), 0.1, "base.v", ("t", "time"), _uniform("moment", 15.0, 40.0)),
    "puncture": Unknown(Form("floor", puncture), 0.05, "base.w", ("t", "time"), _uniform("moment", 15.0, 45.0)),
    "draught": Unknown(Form("floor", draught), 0.05, "base.w", ("y", "position"), _uniform("door", -0.5, 0.5)),
}
UNKNOWN_LASER: dict[str, Unknown] = {
    "sector_bias": Unknown(
        Form("bias", sector_bias), 0.01, "laser.bias", ("bearing", "beam"), _uniform("bearing", -1.5, 1.5)
    ),
    "place_bias": Unknown(
        Form("bias", place_bias), 0.01, "laser.bias", ("hit x", "hit position", "wall", "world bearing")
    ),
    "ambient_bias": Unknown(Form("bias", ambient_bias), 0.01, "laser.bias", ("heading",), _bearing),
    "near_step": Unknown(Form("bias", near_step), 0.01, "laser.bias", ("range", "r"), _uniform("edge", 1.2, 2.2)),
    "pulse_bias": Unknown(
        Form("bias", pulse_bias), 0.01, "laser.bias", ("t", "time"), _uniform("period", 130.0, 300.0)
    ),
}
