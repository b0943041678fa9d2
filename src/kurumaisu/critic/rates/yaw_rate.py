# SPDX-License-Identifier: BSD-3-Clause
"""The yaw rate of a robot by its inertial sensor: about the axis that is up, without what it reads at rest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.critic.rates.mean_rates import STEP, grid, of_input, of_integral, of_samples, shift_correlation
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.errors import Error
from kurumaisu.types import BoolArray, FloatArray

AXES = ("x", "y", "z", "-x", "-y", "-z")
_LEAST = 0.02  # [rad/s] sd of a turning below which it says nothing
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
_MOVES_ON = 1.5  # [s] for which a robot may move on that was asked to rest
_REST = (0.005, 0.005)  # [m/s], [rad/s] mean rates below which odometry stands
RATE = ("w",)  # column of what is known to be the robot's yaw rate
RATES, ACCELERATIONS = ("wx", "wy", "wz"), ("ax", "ay", "az")
UNUSED = "none"  # the axis of a sensor that is not to be used
_FEWEST_ROWS = 20  # rows
_TOGETHER = 5.0  # [s] with what says how the robot turned
_NOTHING = 1e-9  # [rad/s] of rounding
_SHORTEST = 1.0  # [s] of rest of which the bias is taken


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
        if usual.best == 0:  # too little turned
            continue
        if other.best > _ALIKE and other.nats > usual.nats + _WIN:
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


def _matched(rates: FloatArray, w: FloatArray) -> tuple[_Match, _Match]:
    """Return how rates (n, 3) follow w (n,) best, at shifts that a robot may have and at any other."""
    axes = [shift_correlation(axis, w, (_NOTHING, _LEAST), _LONGEST) for axis in rates.T]
    correlation, slope, nats = (
        np.array(rows) for rows in zip(*((a.correlation, a.slope, a.nats) for a in axes), strict=True)
    )
    lags = axes[0].lags
    usual = (lags >= _EARLY) & (lags <= _LATE)
    best = [int(np.argmax(np.where(allowed, nats.max(axis=0), -1.0))) for allowed in (usual, ~usual)]
    one, other = (_Match(float(lags[at]), correlation[:, at], slope[:, at], float(nats[:, at].max())) for at in best)
    return one, other


@dataclass(frozen=True)
class Turning:
    """What a part says of turning: means over SPAN about the times of the grid, (n,) [rad/s], nan where unknown."""

    name: str
    verb: str
    w: FloatArray


def turnings(run: Run, at: FloatArray) -> Iterator[Turning]:
    """Yield what says how a run turned, that first which says it best."""
    if run.odom is not None and len(run.odom.t) > 2:
        yield Turning("the odometry", "turns", of_integral(run.odom.t, run.odom.column("theta")[:, None], at)[:, 0])
    if run.pose is not None and "theta" in run.pose.columns and len(run.pose.t) > 2:
        yield Turning("the reference", "turns", of_integral(run.pose.t, run.pose.column("theta")[:, None], at)[:, 0])
    if run.command is not None and len(run.command.t) > 2:
        held = np.column_stack([run.command.column(name) for name in "vw"])
        yield Turning("the commands", "ask for", of_input(run.command.t, held, at).values[:, 1])


def stands(run: Run, at: FloatArray) -> BoolArray:
    """Return which spans about times (n,) find the robot at rest, (n,): all that says how it moves says so."""
    known, rest = np.zeros(len(at), dtype=np.bool_), np.ones(len(at), dtype=np.bool_)
    if run.odom is not None and len(run.odom.t) > 2:
        rates = np.abs(np.column_stack([run.odom.column(name) for name in "vw"]))
        moved = of_samples(run.odom.t, rates, at)
        known |= np.isfinite(moved).all(axis=1)
        rest &= (moved < _REST).all(axis=1) | np.isnan(moved).any(axis=1)
    if run.command is not None and len(run.command.t) > 2:
        asked = np.column_stack([_asked(run.command, at - late) for late in (0.0, _MOVES_ON / 2, _LATE)])
        known |= np.isfinite(asked).all(axis=1)
        rest &= ~(asked > 1e-9).any(axis=1)
    return np.asarray(known & rest)


def _asked(command: Series, at: FloatArray) -> FloatArray:
    """Return the mean |v| + |w| asked for about times (n,), each command held until the next, (n,)."""
    rates = np.abs(np.column_stack([command.column(name) for name in "vw"]))
    return np.asarray(of_input(command.t, rates, at).values.sum(axis=1))


def with_yaw_rate(run: Run, axis: str | None = None) -> tuple[Run, list[str]]:
    """Return a run whose imu is the robot's yaw rate, and in words how that is known; without imu if it is of no use.

    axis: which is said to be up, or UNUSED; None: that is found out.
    """
    imu = run.imu
    if imu is None:
        return run, []
    if axis == UNUSED:
        return replace(run, imu=None), []
    try:
        series, words = _yaw_rate(run, imu, axis)
    except UnusableError as error:
        return replace(run, imu=None), [f"{run.name}: the imu is not used: {error}"]
    return replace(run, imu=series), [f"{run.name}: {words}"]


def heading(imu: Series) -> FloatArray:
    """Return how far a robot has turned (n,) [rad] at the times of its yaw rate."""
    w = imu.column(RATE[0])
    return np.append(0.0, np.cumsum((w[1:] + w[:-1]) / 2 * np.diff(imu.t)))


def _yaw_rate(run: Run, imu: Series, axis: str | None) -> tuple[Series, str]:
    if len(imu.t) < _FEWEST_ROWS or len(at := grid(imu.t[0], imu.t[-1])) < _FEWEST_ROWS:
        raise UnusableError(f"it has {len(imu.t)} rows over {imu.t[-1] - imu.t[0]:.3g} s")
    rows = _columns(imu, RATES)
    known = [name for name in (*RATE, *RATES) if name in imu.columns]
    if not np.ptp(np.column_stack([imu.column(name) for name in known]), axis=0).any():
        raise UnusableError("its rates never change")
    others = list(turnings(run, at))
    if not others:
        raise UnusableError("there is neither odometry nor commands nor a reference to tell which of its axes is up")
    together = max(int(np.isfinite(other.w).sum()) for other in others)
    if together * STEP < _TOGETHER:
        raise UnusableError(f"it was recorded with {others[0].name} for {together * STEP:.3g} s only: another clock?")
    rest = stands(run, at)
    ours = imu.columns[0] == RATE[0]
    if ours:
        rows[:, 2] = imu.column(RATE[0])
    rates = of_samples(imu.t, rows, at)
    mounting = found(rates, others, None if ours else _gravity(imu, at, rest), _given(axis, ours=ours))
    w, bias = _without_bias(rates @ mounting.up, rest & np.isfinite(rates).all(axis=1), others[0].w, mounting)
    words = f"{mounting.name} is up ({mounting.why})" if not ours else f"w is the robot's yaw rate, {mounting.why}"
    words = f"the imu's {words}; {bias}"
    return Series(imu.t, (rows @ mounting.up - w)[:, None], RATE), words


def _given(axis: str | None, *, ours: bool) -> Mounting | None:
    """Return what is said of the mounting; ours: that the rate is the robot's."""
    if ours:
        return Mounting(said("z"), "w", "as its name says")
    return None if axis is None else Mounting(said(axis), axis, "as meta.yaml says")


def _columns(imu: Series, names: tuple[str, ...]) -> FloatArray:
    """Return columns (m, 3), 0 where the series has not that one."""
    return np.column_stack([imu.column(n) if n in imu.columns else np.zeros(len(imu.t)) for n in names])


def _gravity(imu: Series, at: FloatArray, rest: BoolArray) -> FloatArray | None:
    """Return the mean acceleration (3,) [m/s^2] at rest, if the robot ever does, where it can be gravity's."""
    if not set(ACCELERATIONS) <= set(imu.columns):
        return None
    felt = of_samples(imu.t, _columns(imu, ACCELERATIONS), at)
    use = np.isfinite(felt).all(axis=1)
    use = use & rest if (use & rest).any() else use
    mean = np.asarray(felt[use].mean(axis=0)) if use.any() else np.zeros(3)
    return mean if _GRAVITY[0] < np.linalg.norm(mean) < _GRAVITY[1] else None


def _without_bias(w: FloatArray, rest: BoolArray, turning: FloatArray, mounting: Mounting) -> tuple[float, str]:
    """Return what to take off mean rates (n,) [rad/s], and in words what it is: rest (n,): when the robot stands."""
    if rest.sum() * STEP >= _SHORTEST:
        bias = float(np.median(w[rest]))
        return bias, f"bias {_told(bias)}, by {rest.sum() * STEP:.0f} s at rest"
    late = round(mounting.late / STEP)
    shifted = np.roll(turning, late)
    both = np.isfinite(w) & np.isfinite(shifted)
    both[: max(late, 0)] = both[len(both) + min(late, 0) :] = False
    _, bias = np.polyfit(shifted[both], w[both], 1) if both.sum() > 2 and np.ptp(shifted[both]) else (1.0, 0.0)
    return float(bias), f"bias {_told(float(bias))}, by how it turns, as the robot never stands: less sure"


def _told(bias: float) -> str:
    bias = 0.0 if abs(bias) < _NOTHING else bias
    return f"{bias:+.2g} rad/s ({np.degrees(bias):+.2g} deg/s)"
