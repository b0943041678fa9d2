# SPDX-License-Identifier: BSD-3-Clause
"""What a drive leaves unsaid: rates of odometry, headings of a reference, and the end of a command."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.data.odometry import COLUMNS, driven_by, rates_between
from kurumaisu.critic.rates.yaw_rate import heading, with_yaw_rate
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.errors import Error
from kurumaisu.geometry import wrap
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import FloatArray

_SHORTEST = 0.05  # [m] least way whose direction is looked at, and
_NOISES = 40.0  # times the noise of a position: a heading is known to 2 degrees then
_LONGEST = 10.0  # [s] that a way may take
_STEADY = 5.0  # [s] over which directions of ways are averaged beside a guide that is steady
_LARGEST_TURN = 1.0  # [rad] within a way: the chord of an arc of even curvature points as its middle does


def completed(run: Run, hold: float | None, faults: Faults, axis: str | None = None) -> Run:
    """Return a run with all columns of odometry and pose; hold: for how long a command holds [s], None: until the next.

    axis: of the imu that is up, as with_yaw_rate has it. faults gets what was worked out, and what could not be.
    """
    odom = run.odom
    if odom is not None and odom.columns != COLUMNS:
        poses = np.column_stack([odom.column(name) for name in COLUMNS[:3]])
        odom = Series(odom.t, np.column_stack([poses, rates_between(odom.t, poses)]), COLUMNS)
    command = run.command if run.command is None or hold is None else _ended(run.command, hold)
    run, words = with_yaw_rate(replace(run, odom=odom, command=command), axis)
    for line in words:
        faults.add(line)
    if run.pose is None or "theta" in run.pose.columns:
        return run
    guide = _guide(run)
    try:
        pose, way = with_headings(run.pose, guide)
    except Error as error:
        faults.add(f"{run.name}: the reference {error}: not used")
        return replace(run, pose=None)
    between = "straight lines" if guide is None else guide.name
    faults.add(
        f"{run.name}: the reference has no headings: they are the directions of ways of {way:.2g} m, and follow "
        f"{between} in between; what was measured is taken to be above the middle of the axle"
    )
    return replace(run, pose=pose, courses=True)


def _ended(command: Series, hold: float) -> Series:
    """Return commands with a row of 0 wherever one has held for so long [s] and no other has come."""
    ends = np.append(command.t[1:], np.inf) - command.t > hold
    t = np.concatenate([command.t, command.t[ends] + hold])
    values = np.vstack([command.values, np.zeros((int(ends.sum()), command.values.shape[1]))])
    order = np.argsort(t, kind="stable")
    return Series(t[order], values[order], command.columns)


def _guide(run: Run) -> Guide | None:
    """Return what says best how a robot turned, and whether it drove ahead: an imu knows nothing of that by itself."""
    if run.odom is not None:
        plain = Guide("the odometry", run.odom.t, run.odom.column("theta"), run.odom.column("v"))
    elif run.command is not None:
        # Held until the next, as rows between which they change evenly.
        t = np.repeat(run.command.t, 2)[1:]
        rates = np.repeat(np.column_stack([run.command.column("v"), run.command.column("w")]), 2, axis=0)[:-1]
        plain = Guide("the commands", t, driven_by(t, rates)[:, 2], rates[:, 0])
    else:
        return None
    return (
        plain
        if run.imu is None
        else Guide("the imu", run.imu.t, heading(run.imu), plain.speeds(run.imu.t), steady=True)
    )


@dataclass(frozen=True)
class Guide:
    """How a robot turned and which way it drove, roughly: times (n,) [s], headings (n,) [rad] from 0, v (n,) [m/s].

    steady: it is a gyro, off by a bias and a share of its turns, and by little else within seconds.
    """

    name: str
    t: FloatArray
    theta: FloatArray
    v: FloatArray
    steady: bool = False

    def speeds(self, at: FloatArray) -> FloatArray:
        """Return v (m,) [m/s] at times at (m,), held from row to row."""
        return np.asarray(self.v[np.clip(np.searchsorted(self.t, at, side="right") - 1, 0, None)])


def with_headings(positions: Series, guide: Guide | None) -> tuple[Series, float]:
    """Return positions x, y with theta, and over how long a way each heading was measured [m].

    Directions of ways correct the guide's heading, which fills in between and while the robot stands; without a guide
    headings are interpolated, and the robot is taken to drive forward.
    Raise Error where there are not two ways.
    """
    t, places = positions.t, positions.values[:, :2]
    way = max(_SHORTEST, _NOISES * _noise(places))
    theta = np.zeros(len(t)) if guide is None else np.interp(t, guide.t, guide.theta)
    ahead = np.ones(len(t)) if guide is None else np.sign(guide.speeds(t))
    found = []
    for i, j in _ways(t, places, theta, ahead, way):
        x, y = ahead[i] * (places[j] - places[i])
        found.append(((t[i] + t[j]) / 2, np.arctan2(y, x) - theta[i : j + 1].mean()))
    if len(found) < 2:
        raise Error(f"has positions without headings, and no two ways of {way:.2g} m to tell headings from")
    times, offsets = np.array(found).T
    offsets = np.unwrap(offsets)
    offsets -= offsets[0] - wrap(offsets[0])
    if guide is not None and guide.steady:
        turned = theta + _trend(times, offsets, theta[np.searchsorted(t, times)], t, theta)
    else:
        turned = theta + np.interp(t, times, offsets)
    values = np.column_stack([places, turned])
    return Series(t, values, ("x", "y", "theta")), way


def _trend(times: FloatArray, offsets: FloatArray, at: FloatArray, t: FloatArray, theta: FloatArray) -> FloatArray:
    """Return by how much a steady guide is off at times t (n,), when it says theta, by offsets (k,) where it says at.

    What a bias and a share of its turns leave is averaged over some seconds.
    """
    scale = max(float(np.ptp(theta)), 1.0)

    def columns(when: FloatArray, said: FloatArray) -> FloatArray:
        return np.column_stack([np.ones(len(when)), (when - t[0]) / max(t[-1] - t[0], 1.0), said / scale])

    known = columns(times, at)
    found, *_ = np.linalg.lstsq(known, offsets, rcond=None)
    left = offsets - known @ found
    smooth = np.empty(len(times))
    first, end = (np.searchsorted(times, times + side * 3 * _STEADY) for side in (-1, 1))
    for i, near in enumerate(map(slice, first, end)):
        weight = np.exp(-0.5 * ((times[near] - times[i]) / _STEADY) ** 2)
        smooth[i] = weight @ left[near] / weight.sum()
    return np.asarray(columns(t, theta) @ found + np.interp(t, times, smooth))


def _noise(places: FloatArray) -> float:
    """Return the sd of a position [m], from how far each is off the middle of its neighbours."""
    if len(places) < 3:
        return 0.0
    off = places[1:-1] - (places[:-2] + places[2:]) / 2
    return float(SIGMA_PER_MAD * np.median(np.abs(off - np.median(off, axis=0))) / np.sqrt(1.5))


def _ways(t: FloatArray, places: FloatArray, theta: FloatArray, ahead: FloatArray, way: float) -> list[tuple[int, int]]:
    """Return first and last rows of ways that follow each other, each as short as `way` [m] allows."""
    found: list[tuple[int, int]] = []
    i = 0
    while i < len(t) - 1:
        j = i + 1
        while j < len(t) and np.hypot(*(places[j] - places[i])) < way and t[j] - t[i] < _LONGEST:
            j += 1
        inside = slice(i, j + 1)
        if j < len(t) and t[j] - t[i] < _LONGEST and ahead[i] and (ahead[i:j] == ahead[i]).all():
            if np.ptp(theta[inside]) < _LARGEST_TURN:
                found.append((i, j))
            i = j
        else:
            i += 1
    return found
