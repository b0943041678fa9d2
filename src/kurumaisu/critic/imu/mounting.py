# SPDX-License-Identifier: BSD-3-Clause
"""How an inertial sensor is mounted: which of its directions is up, as its rate follows how the robot turned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu.critic.imu.motion import SPAN, STEP, Turning
from kurumaisu.errors import Error
from kurumaisu.types import BoolArray, FloatArray

AXES = ("x", "y", "z", "-x", "-y", "-z")
_LEAST = 0.02  # [rad/s] sd of a turning below which it says nothing
_FEWEST = 10.0  # [s] of it that are known
_ALIKE = 0.7  # correlation from which a rate follows another
_EARLY, _LATE = -0.5, 1.5  # [s] by which a robot may turn before and after what is said of it
_LONGEST = 60.0  # [s] shifts of clocks that are tried
_WIN = 15.0  # nats by which another clock must win
_UPRIGHT = np.cos(np.radians(10.0))  # a direction nearer than this to an axis is that axis
_GRAVITY = (9.3, 10.3)  # [m/s^2]
_PLAIN = (0.2, 5.0)  # times that a robot may turn further than is said of it
_NEAR = 1.2  # of the log of a unit's factor
_UNITS = {
    180 / np.pi: "deg/s: multiply them by 0.01745",
    np.pi / 180: "of a robot whose own turns are in degrees",
    1e3: "mrad/s: multiply them by 0.001",
}


class UnusableError(Error):
    """Why the rates are of no use."""


@dataclass(frozen=True)
class Mounting:
    """Which direction of the sensor is up, (3,), a unit vector; late [s]: how much later it turns than is said.

    name: what to call the direction; why: what it is known by.
    """

    up: FloatArray
    name: str
    why: str
    late: float = 0.0


@dataclass(frozen=True)
class _Match:
    """How rates (n, 3) follow a turning: correlations and slopes, (3,), at the shift [s] where one follows it best."""

    shift: float
    correlation: FloatArray
    slope: FloatArray
    nats: float

    @property
    def best(self) -> float:
        return float(np.abs(self.correlation).max())


def said(axis: str) -> FloatArray:
    """Return the direction of an axis of AXES, (3,)."""
    return np.asarray(np.eye(3)["xyz".index(axis[-1])] * (-1.0 if axis[0] == "-" else 1.0))


def found(
    rates: FloatArray, turnings: Sequence[Turning], gravity: FloatArray | None, given: Mounting | None
) -> Mounting:
    """Return how a sensor is mounted whose mean rates (n, 3) are known, by how it turned, else by gravity.

    gravity: mean acceleration at rest (3,) [m/s^2], None: not known; given: what is said to be up.
    Raise UnusableError where nothing says it, or the rates are of no use.
    """
    for turning in turnings:
        usual, other = _matched(rates, turning.w)
        if usual is None:
            continue
        if other is not None and other.best > _ALIKE and other.nats > usual.nats + _WIN:
            raise UnusableError(
                f"its clock differs: it follows how {turning.name} {turning.verb} {abs(other.shift):.1f} s "
                f"{'late' if other.shift > 0 else 'early'} (correlation {other.best:.2f}, else {usual.best:.2f})"
            )
        if usual.best < _ALIKE:
            raise UnusableError(
                f"none of its axes follows how {turning.name} {turning.verb} (correlation {usual.best:.2f} at most)"
            )
        return _by_turning(usual, turning, gravity, given)
    if given is not None:
        return given
    if gravity is not None:
        up, name = _named(gravity / np.linalg.norm(gravity))
        return Mounting(up, name, "gravity points there")
    raise UnusableError("too little turned to tell which of its axes is up: say `imu: {axis: z}` in meta.yaml")


def gravity_of(accelerations: FloatArray) -> FloatArray | None:
    """Return the mean of accelerations (n, 3) [m/s^2] if it can be what gravity makes of a sensor at rest."""
    mean = np.asarray(accelerations.mean(axis=0))
    return mean if _GRAVITY[0] < np.linalg.norm(mean) < _GRAVITY[1] else None


def _by_turning(match: _Match, turning: Turning, gravity: FloatArray | None, given: Mounting | None) -> Mounting:
    follows = np.where(np.abs(match.correlation) > _ALIKE / 2, match.slope, 0.0)
    up, name = _named(follows / np.linalg.norm(follows))
    why = f"as {turning.name} {turning.verb}: correlation {match.best:.2f}"
    if given is not None:
        up, name, why = given.up, given.name, given.why
    factor = float(up @ match.slope)
    if factor < 0:
        raise UnusableError(f"{name} is up, {why}, but then it turns against {turning.name} (factor {factor:.2f})")
    if not _PLAIN[0] < factor < _PLAIN[1]:
        unit = min(_UNITS, key=lambda known: abs(np.log(factor / known)))
        near = abs(np.log(factor / unit)) < _NEAR
        looks = f"its rates look like {_UNITS[unit]}" if near else "no known unit explains this"
        raise UnusableError(f"it turns {factor:.3g} times as fast as {turning.name}: {looks}")
    if gravity is not None and gravity @ up < -0.5 * np.linalg.norm(gravity):
        why += "; by its acceleration it is down: is that of the other sign, or do all others turn clockwise?"
    return Mounting(up, name, why, match.shift)


def _named(direction: FloatArray) -> tuple[FloatArray, str]:
    """Return a unit vector (3,), on an axis where it nearly is, and what to call it."""
    i = int(np.argmax(np.abs(direction)))
    name = ("-" if direction[i] < 0 else "") + "xyz"[i]
    if abs(direction[i]) > _UPRIGHT:
        return said(name), name
    words = ", ".join(f"{part:.2f}" for part in direction)
    return direction, f"({words}), {np.degrees(np.arccos(abs(direction[i]))):.0f} deg off {name},"


def _matched(rates: FloatArray, w: FloatArray) -> tuple[_Match | None, _Match | None]:
    """Return the best match at shifts that a robot may have, and at any other; None where too little turned."""
    known = np.isfinite(w)
    if known.sum() * STEP < _FEWEST or float(np.std(w[known])) < _LEAST:
        return None, None
    reach = min(round(_LONGEST / STEP), len(w) - 1)
    matches = [match for shift in range(-reach, reach + 1) if (match := _at(rates, w, shift)) is not None]
    usual = [match for match in matches if _EARLY <= match.shift <= _LATE]
    other = [match for match in matches if not _EARLY <= match.shift <= _LATE]
    best = [max(some, key=lambda match: match.nats) if some else None for some in (usual, other)]
    return best[0], best[1]


def _at(rates: FloatArray, w: FloatArray, shift: int) -> _Match | None:
    """Return how rates (n, 3) follow w (n,) that many steps later; None where too little is known."""
    late, early = rates[max(shift, 0) :], w[max(-shift, 0) :]
    length = min(len(late), len(early))
    late, early = late[:length], early[:length]
    both: BoolArray = np.isfinite(early) & np.isfinite(late).all(axis=1)
    if both.sum() * STEP < max(_FEWEST, 0.4 * len(w) * STEP):
        return None
    x, y = early[both] - early[both].mean(), late[both] - late[both].mean(axis=0)
    spread = np.sqrt((y**2).mean(axis=0) * (x**2).mean())
    product = (y * x[:, None]).mean(axis=0)
    if np.std(x) < _LEAST:
        return None
    correlation = np.where(spread > 1e-12, product / np.maximum(spread, 1e-12), 0.0)
    number = len(x) * STEP / SPAN
    nats = float(-0.5 * number * np.log1p(-min(float((correlation**2).max()), 0.9999)))
    return _Match(shift * STEP, correlation, product / (x**2).mean(), nats)
