# SPDX-License-Identifier: BSD-3-Clause
"""One run made ready for replay: inputs on a uniform grid, reference poses, measured increments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from kurumaisu import _core, geometry
from kurumaisu._core import AxisInverse
from kurumaisu.critic.base.voltage_signs import voltage_signs
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.effects import LATE
from kurumaisu.errors import Error
from kurumaisu.params import Model
from kurumaisu.types import BoolArray, FloatArray, IntArray

_POINTS = 16  # of each increment: commands change once in it, seldom twice
GRID = 0.01  # [s] step of the replay; half a sample of the fastest command rate in use (50 Hz)
_CLOCK = 0.02  # share by which the reference's clock may be off, and more
LONGEST = 100_000.0  # [s] a day: what is longer has its times in another unit, and its grid would fill the memory
_ROLLS = 0.2  # [s] for which a chair may move on after it was asked to rest
_ROUNDING = 1e-9  # [m/s], [rad/s]
_USUAL_V, _USUAL_W = 0.8, 0.8  # [m/s], [rad/s]
_GAP, _USUAL_STEPS = 0.5, 3.0  # [s], and steps of the reference: in what is longer, its headings may miss a turn
# [s] least time between reference poses. Closer ones add cost, hardly information; and odometry is itself measured:
# over short intervals its noise, in the input and in the residual alike, would pass for a gain below 1 (errors in
# variables), while over long ones it averages out.
POSE_INTERVAL = {"voltage": 0.1, "command": 0.1, "odom": 2.0}


def pose_paths(times: FloatArray, poses: FloatArray, edges: FloatArray, path: FloatArray) -> FloatArray:
    """Return how a chair went from each reference pose to the next, (m, 8).

    Means of the heading's cosine and sine and of the way x, y [m] that lies ahead, in the frame of the first pose; and
    by how much each of them grows from its beginning to its end, by least squares.

    times (m + 1,) and poses (m + 1, 3) of the reference; path (n, 3): poses that were asked for at edges (n,) of time.
    The way is half way between what was asked for and what was measured.
    """
    share = (np.arange(_POINTS) + 0.5) / _POINTS
    at = times[:-1, None] + np.diff(times)[:, None] * np.append(share, 1.0)
    begin = np.stack([np.interp(times[:-1], edges, column) for column in path.T], axis=-1)
    asked = np.stack([np.interp(at, edges, column) for column in path.T], axis=-1)
    gone = geometry.between(begin[:, None], asked)
    off = geometry.between(poses[:-1], poses[1:]) - gone[:, -1]
    off[:, 2] = geometry.wrap(off[:, 2])
    # Of what differs, the squares cancel about the middle: a derivative about either end sees a speed and a turn that
    # are both off as a slip.
    off *= 0.5
    gone[:, :-1] += off[:, None] * share[:, None]
    gone[:, -1] += off
    ahead = gone[:, -1:, :2] - gone[:, :-1, :2]
    heading = gone[:, :-1, 2, None]
    along = np.concatenate([np.cos(heading), np.sin(heading), ahead], axis=-1)
    late = share - 0.5
    slope = np.einsum("mpk,p->mk", along, late / (late @ late))
    return np.concatenate([along.mean(axis=1), slope], axis=1)


@dataclass(frozen=True)
class FreeMoments:
    """Moments of a width [s] about their middles [s] in which a channel of the rates is anything, with an sd."""

    channel: str
    middles: FloatArray
    width: float
    sd: float


@dataclass(frozen=True)
class Drive:
    """Inputs and reference of one run.

    source: the channel that drives the replay; start [s] of the grid; v, w (n,) rates asked for on the grid;
    times (m + 1,) and poses (m + 1, 3) of the reference; known: what unknown effects may follow, (n,) each on the
    grid, by the names that effects.Motion has; heading [rad] at the start of the grid, None: that of the first pose;
    free: when nobody knows the rates, though poses are there.
    """

    name: str
    source: str
    start: float
    v: FloatArray
    w: FloatArray
    times: FloatArray
    poses: FloatArray
    known: Mapping[str, FloatArray] = field(default_factory=dict)
    heading: float | None = None
    free: FreeMoments | None = None

    @cached_property
    def measured(self) -> FloatArray:
        """Body increments of the reference, (m, 3)."""
        return geometry.between(self.poses[:-1], self.poses[1:])

    @cached_property
    def places(self) -> tuple[IntArray, FloatArray]:
        """Where the reference's times lie among the edges of the grid: the edge before, and the share of its cell."""
        place = np.clip((self.times - self.start) / GRID, 0, len(self.v))
        below = np.minimum(place.astype(int), len(self.v) - 1)
        return below, place - below

    def at_poses(self, edges: FloatArray) -> FloatArray:
        """Return values (n + 1, ...) at the edges of the grid at the reference's times, (m + 1, ...)."""
        below, share = self.places
        low, high = edges.take(below, axis=0), edges.take(below + 1, axis=0)
        return np.asarray(low + (share if edges.ndim == 1 else share[:, None]) * (high - low))

    def in_map(self, steps: FloatArray) -> FloatArray:
        """Return steps (m, 3) that begin at each pose, along the axes of the map; turns stay."""
        out = geometry.compose(self.poses[:-1] * np.array([0.0, 0.0, 1.0]), steps)
        out[:, 2] = steps[:, 2]
        return np.asarray(out)

    @cached_property
    def activity(self) -> FloatArray:
        """Share of each increment's noise that acts, (m,): floor and casters shake a chair that moves."""
        return self._means(self._moving, 0.0)

    @cached_property
    def rolling(self) -> FloatArray:
        """Share of each increment's noise that may act besides, and tells nothing about the noise under way, (m,).

        A chair asked to rest may roll on for a while. One that does not says that nothing shakes it now: it does not
        say that little did before. Nor is it known when within an increment noise that is not slow acts.
        """
        whole = np.maximum(self._means(self._moving, _ROLLS), self.activity)
        return np.asarray(np.sqrt(np.maximum(whole - self.activity**2, 0.0)))  # but for rounding

    @cached_property
    def pace(self) -> FloatArray:
        """Rates asked for while the chair moves during each increment, in units of what is usual, (m,).

        A chair that rolls on keeps its pace, and one at rest has the mean one: else noise that rests with the chair
        would pass for noise that grows.
        """
        rates = (np.abs(self.v) / _USUAL_V + np.abs(self.w) / _USUAL_W) * self._moving
        own, rolling = (
            self._means(rates, before) / np.maximum(self._means(self._moving, before), 1e-9) for before in (0.0, _ROLLS)
        )
        moved = np.where(own > 0, own, rolling)
        usual = float(moved[moved > 0].mean()) if (moved > 0).any() else 0.0
        return np.asarray(np.where(moved > 0, moved, usual))

    @cached_property
    def pose_paths(self) -> FloatArray:
        """How the chair went from each pose to the next, (m, 8): see pose_paths."""
        edges = self.start + GRID * np.arange(len(self.v) + 1)
        asked = _core.integrate(self.v, self.w, np.full(len(self.v), GRID), [0.0, 0.0, 0.0])
        return pose_paths(self.times, self.poses, edges, asked)

    @property
    def _moving(self) -> FloatArray:
        asked = (self.v != 0) | (self.w != 0)
        return np.asarray(asked, dtype=np.float64)

    def seen_at(self, times: FloatArray, poses: FloatArray) -> Drive:
        """Return the drive with other poses (m + 1, 3) at other times (m + 1,)."""
        return replace(self, times=times, poses=poses)

    def _means(self, values: FloatArray, before: float) -> FloatArray:
        """Return means (m,) of values (n,) on the grid, over the increments and the time [s] before each."""
        sums = np.concatenate([[0.0], np.cumsum(values)]) * GRID
        edges = self.start + GRID * np.arange(len(sums))
        since, until = self.times[:-1] - before, self.times[1:]
        held = np.interp(until, edges, sums) - np.interp(since, edges, sums)
        return np.asarray(np.clip(held, 0.0, None) / (until - since))


def prepare(run: Run, model: Model, interval: float | None = None) -> Drive:
    """Return the drive of a run; interval: least time between its poses [s] (default: POSE_INTERVAL).

    Raise Error when it has no reference pose or nothing that drove the robot.
    """
    if run.pose is None:
        raise Error(f"{run.name}: has no reference pose")
    source, times, v, w = _inputs(run, model)
    pose_times, poses = _thin(_turned(run.pose, times, w), times[0], interval or POSE_INTERVAL[source])
    if len(pose_times) < 3:
        raise Error(
            f"{run.name}: has {len(pose_times)} reference poses after the first {source}; at least 3 are needed"
        )
    if pose_times[-1] - min(times[0], pose_times[0]) > LONGEST:
        raise Error(
            f"{run.name}: lasts {pose_times[-1] - min(times[0], pose_times[0]):.6g} s: are its times in seconds?"
        )
    edges = np.arange(min(times[0], pose_times[0]), pose_times[-1] + GRID, GRID)
    return Drive(
        name=run.name,
        source=source,
        start=float(edges[0]),
        v=_mean_rates(times, v, edges),
        w=_mean_rates(times, w, edges),
        times=pose_times,
        poses=poses,
        known=_late(source, times, (v, w), edges),
    )


def prepare_all(run: Run, model: Model, until: float) -> Drive:
    """Return the drive of a run with all its poses, be they few or none, and its inputs until a time [s] at least.

    Raise Error when nothing says what drove the robot.
    """
    source, times, v, w = _inputs(run, model)
    pose = _turned(run.pose or Series(np.empty(0), np.empty((0, 3)), ("x", "y", "theta")), times, w)
    use = pose.t >= times[0]
    first, last = min(times[0], *pose.t[use][:1], until), max([until, *pose.t[use][-1:]])
    if last - first > LONGEST:
        raise Error(f"{run.name}: lasts {last - first:.6g} s: are its times in seconds?")
    # A reference whose clock is off sees the path at other times.
    edges = np.arange(first, last + 2 * GRID + _CLOCK * (last - first), GRID)
    known = _late(source, times, (v, w), edges)
    v, w = _mean_rates(times, v, edges), _mean_rates(times, w, edges)
    return Drive(run.name, source, float(edges[0]), v, w, pose.t[use], pose.values[use, :3], known=known)


def edges_of(values: FloatArray) -> FloatArray:
    """Return values of the steps of a grid, (n, ...), at their edges, (n + 1, ...): half way between two steps."""
    padded = np.concatenate([values[:1], values, values[-1:]])
    return np.asarray(0.5 * (padded[1:] + padded[:-1]))


def split(drive: Drive, parts: int) -> list[Drive]:
    """Return the drive cut into parts of equally many increments; each keeps all inputs, so effects keep their past."""
    return _cut(drive, np.linspace(0, len(drive.times) - 1, parts + 1).astype(int))


def without_spans(drive: Drive, spans: Sequence[tuple[float, float]]) -> list[Drive]:
    """Return the drive without the increments that lie within spans of time [s]; each piece keeps all inputs."""
    since, until = drive.times[:-1], drive.times[1:]
    return _without(drive, np.any([(until > a) & (since < b) for a, b in spans], axis=0)) if spans else [drive]


def pieces(drive: Drive, gap: float) -> list[Drive]:
    """Return the drive without the increments that are longer than a gap [s]; each piece keeps all inputs."""
    return _without(drive, np.diff(drive.times) > gap)


def _without(drive: Drive, out: BoolArray) -> list[Drive]:
    edges = np.concatenate([[-1], np.flatnonzero(out), [len(drive.times) - 1]])
    return [piece for a, b in pairwise(edges) for piece in _cut(drive, np.array([a + 1, b]))]


def _cut(drive: Drive, bounds: IntArray) -> list[Drive]:
    """Return the parts between rows of poses that have two increments at least."""
    heading = float(drive.poses[0, 2]) if drive.heading is None else drive.heading
    return [
        replace(
            drive,
            name=f"{drive.name}[{i + 1}/{len(bounds) - 1}]",
            times=drive.times[a : b + 1],
            poses=drive.poses[a : b + 1],
            heading=heading,
        )
        for i, (a, b) in enumerate(pairwise(bounds))
        if b - a >= 2
    ]


def driven(run: Run) -> bool:
    """Return whether a run says what drove the robot."""
    return run.voltage is not None or run.command is not None or run.odom is not None


def _inputs(run: Run, model: Model) -> tuple[str, FloatArray, FloatArray, FloatArray]:
    """Return the source and its samples t, v, w, each held until the next: voltages, else commands, else odometry."""
    if run.voltage is not None:
        return ("voltage", *from_voltages(run, model))
    if run.command is not None:
        return "command", run.command.t, run.command.column("v"), run.command.column("w")
    if run.odom is not None:
        return ("odom", *_from_odometry(run.odom))
    raise Error(f"{run.name}: has neither voltages nor commands nor odometry")


def from_voltages(run: Run, model: Model) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return t [s] and the rates v, w that a run's voltages stand for, all (n,)."""
    assert run.voltage is not None
    signs = voltage_signs(run.voltage, run.command, run.pose, model)
    v, w = (
        AxisInverse(law).rates(run.voltage.column(volts), signs[:, i])
        for i, (law, volts) in enumerate(((model.translation, "v_f"), (model.steering, "v_s")))
    )
    return run.voltage.t, v, w


def _from_odometry(odom: Series) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the rates that equation (3) needs to drive along the odometry's poses."""
    steps = geometry.between(odom.values[:-1, :3], odom.values[1:, :3])
    dt = np.diff(odom.t)
    turn = steps[:, 2]
    arc = np.hypot(steps[:, 0], steps[:, 1]) / np.sinc(turn / (2 * np.pi))
    forward = np.cos(turn / 2) * steps[:, 0] + np.sin(turn / 2) * steps[:, 1]
    v, w = np.copysign(arc, forward) / dt, turn / dt
    return odom.t, np.append(v, 0.0), np.append(w, 0.0)


def _turned(pose: Series, times: FloatArray, w: FloatArray) -> Series:
    """Return poses that turn in gaps by as many whole turns as the yaw rates w (n,) from times (n,) on come nearest to.

    In a gap a robot may turn by more than half a turn, of which the next heading says nothing.
    """
    steps = np.diff(pose.t)
    gaps = (steps > _GAP) & (steps > _USUAL_STEPS * np.median(steps)) if len(steps) else np.zeros(0, dtype=bool)
    if not gaps.any():
        return pose
    edges = np.append(times, max(times[-1], pose.t[-1]) + GRID)
    asked = np.diff(np.interp(pose.t, edges, np.concatenate([[0.0], np.cumsum(w * np.diff(edges))])))
    turns = np.rint((asked - np.diff(pose.values[:, 2])) / (2 * np.pi)) * gaps
    values = pose.values.copy()
    values[1:, 2] += 2 * np.pi * np.cumsum(turns)
    return replace(pose, values=values)


def _thin(pose: Series, since: float, interval: float) -> tuple[FloatArray, FloatArray]:
    """Return times and poses at least so far apart [s], from the first input on."""
    keep: list[int] = []
    last = -np.inf
    for i, t in enumerate(pose.t):
        if t >= since and t - last >= interval * (1 - 1e-6):
            keep.append(i)
            last = t
    return pose.t[keep], pose.values[keep, :3]


def _late(
    source: str, times: FloatArray, rates: tuple[FloatArray, FloatArray], edges: FloatArray
) -> dict[str, FloatArray]:
    """Return, by its name, the share of each cell of the grid that passed before the last change in it, 0: none.

    Odometry is no command, and what it says did not change at its stamps.
    """
    if source == "odom":
        return {}
    changes = times[np.any(np.diff(np.stack(rates), axis=1, prepend=0.0) != 0, axis=0)]
    cell = np.floor((changes - edges[0]) / GRID).astype(int)
    inside = (cell >= 0) & (cell < len(edges) - 1)
    late = np.zeros(len(edges) - 1)
    late[cell[inside]] = ((changes - edges[0]) / GRID - cell)[inside]
    return {LATE: late}


def _mean_rates(times: FloatArray, values: FloatArray, edges: FloatArray) -> FloatArray:
    """Return the mean over each cell of the grid of samples held until the next; 0 before the first."""
    knots = np.append(times, max(edges[-1], times[-1]) + GRID)
    integral = np.concatenate([[0.0], np.cumsum(values * np.diff(knots))])
    means = np.diff(np.interp(edges, knots, integral)) / GRID
    # Differences of sums leave rests that are not quite 0: by the law, turns that stand for the volts of a threshold.
    return np.asarray(np.where(np.abs(means) < _ROUNDING, 0.0, means))
