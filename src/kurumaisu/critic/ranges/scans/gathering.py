# SPDX-License-Identifier: BSD-3-Clause
"""Which scans of a recording its laser is criticised by, where that laser was, and what else was known then."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from kurumaisu import effects, geometry
from kurumaisu.critic.ranges.scans.beams import RATES, Shots, Track
from kurumaisu.critic.ranges.scans.likelier_walls import with_likelier_walls
from kurumaisu.critic.ranges.scans.standstill import stands_averaged, with_pause_rows
from kurumaisu.critic.ranges.scans.walls import walls_at
from kurumaisu.critic.values.recording import LaserMount, Recording, Run, Series
from kurumaisu.effects import LAGS, FirstOrder
from kurumaisu.params import Laser, Model, Mount
from kurumaisu.types import FloatArray, IntArray
from kurumaisu.world import load_world

MOST_SCANS = 250  # that are criticised, evenly taken from all: 170 000 readings
_FAN, _MORE = 682, 2.0  # beams of such a scan; of scans of fewer beams there may be more, at most so many times
_FEWEST_SCANS = 5
_DAY = 86400.0  # [s] a first stamp beyond this is a date, not a time since the laser was switched on
_GAP, _LONG = 0.3, 3.0  # [s], and usual times between poses, from which some are missing
_STAYS = 0.02  # [m, rad] from pose to pose within which the chair may have stood meanwhile
_HELD = 5e-3  # [m, rad] that a chair may move while a scan lasts, and stands
_SPAN = 0.5  # [s] about the first or the last pose, over which that is seen: poses are noisy
_PAST = 0.5  # [s] steps in which what was recorded is followed into the past
_ABOUT = 0.15  # [s] before and after a scan, between which its rates are taken


def why_not_usable(recording: Recording) -> str | None:
    """Return why a recording's laser cannot be criticised, and what supplies what is missing; None when it can."""
    scanned = [run for run in recording.runs if run.name in recording.train and run.scan is not None]
    if not scanned:
        return "no scans were recorded; room_poses records them"
    if recording.world is None:
        return "there is no map: give world in meta.yaml, a Stage world with measured walls"
    posed = [run for run in scanned if _referred(run)]
    if not posed and any(run.pose is not None for run in scanned):
        return "the reference pose was computed from these scans; measure one, as room_poses does"
    if not posed:
        return "there is no reference pose at the scans; give pose.csv, as room_poses does"
    if sum(len(_within(run)) for run in posed) < _FEWEST_SCANS:
        return f"fewer than {_FEWEST_SCANS} scans lie within the times of the reference poses; record room_poses"
    return None


def _referred(run: Run) -> bool:
    """Tell whether a run has poses that its scans can be judged by."""
    return run.pose is not None and run.pose_source == "measured"


def gather(recording: Recording, model: Model, creeping: Mapping[str, Sequence[float]] = MappingProxyType({})) -> Shots:
    """Return the scans of the runs to fit, thinned evenly. missing(recording) must be None.

    creeping: by run, times [s] in stands that are none.
    """
    assert recording.world is not None
    laser = laser_of(model.laser, recording.laser, recording.runs)
    runs = [run for run in recording.runs if run.name in recording.train and run.scan is not None and _referred(run)]
    chosen = [(i, index) for i, run in enumerate(runs) for index in _within(run)]
    chosen = [chosen[i] for i in np.unique(np.linspace(0, len(chosen) - 1, _most_scans(laser)).astype(int))]
    zero = time_zero(runs)
    tracks, stamps, measured = [], [], []
    names = set.intersection(*(set(run.covariates) for run in runs))
    known, past = [], []
    for i, run in enumerate(runs):
        assert run.scan is not None
        assert run.pose is not None
        still = stands_averaged(run.pose.t, run.pose.values[:, :3], creeping.get(run.name, ()))
        tracks.append(Track(*with_pause_rows(run.pose.t - zero, still), recording.truth or Track.doubt))
        rows = [index for j, index in chosen if j == i]
        stamps.append(run.scan.t[rows] - zero)
        measured.append(run.scan.values[rows])
        known.append(columns_at(run, sorted(names - set(RATES)), run.scan.t[rows]))
        past.append(past_at(run, run.scan.t[rows]))
    readings, owner = np.concatenate(measured), np.array([i for i, _ in chosen])
    rates = rates_at(tracks, owner, np.concatenate(stamps))
    shots = Shots(
        laser=laser,
        own=model.effects,
        walls=walls_at(load_world(recording.world), laser.mount.z),
        tracks=tuple(tracks),
        stamps=np.concatenate(stamps),
        run=owner,
        measured=readings,
        said=laser.time_increment * np.arange(laser.beams),
        shift=np.zeros((*readings.shape, 3)),
        known={**together(known), **rates},
        past=together(past),
        zero=zero,
        runs=tuple(run.name for run in runs),
    )
    return with_likelier_walls(shots)


def columns_at(run: Run, names: Iterable[str], stamps: FloatArray) -> dict[str, FloatArray]:
    """Return the columns of these names that a run has, at stamps (k,) [s]."""
    there = {name: run.covariates[name] for name in names if name in run.covariates}
    return {name: np.interp(stamps, series.t, series.values[:, 0]) for name, series in there.items()}


def past_at(run: Run, stamps: FloatArray) -> dict[str, FloatArray]:
    """Return the columns of a run that act late, at stamps (k,) [s], behind by first-order lags of LAGS [s], (k, l).

    As a run begins, each has long been what it is.
    """
    out = {}
    for name in effects.LAGGED & set(run.covariates):
        series = run.covariates[name]
        middles = np.arange(series.t[0], series.t[-1] + _PAST, _PAST)
        given = np.interp(middles, series.t, series.values[:, 0])
        behind = [FirstOrder(float(given[0])).follow(given, _PAST, lag) for lag in LAGS.tolist()]
        out[name] = np.stack([np.interp(stamps, middles, each) for each in behind], axis=-1)
    return out


def together(parts: Sequence[Mapping[str, FloatArray]]) -> dict[str, FloatArray]:
    """Return, one after the other, what all parts have, by name."""
    names = [name for name in parts[0] if all(name in part for part in parts)]
    return {name: np.concatenate([part[name] for part in parts]) for name in names}


def rates_at(tracks: Sequence[Track], run: IntArray, stamps: FloatArray) -> dict[str, FloatArray]:
    """Return the chair's rates at stamps (k,) [s], whose tracks are those of indices run (k,)."""
    moved = np.empty((len(stamps), 3))
    for i, track in enumerate(tracks):
        rows = run == i
        ends = [geometry.interpolate(track.times, track.poses, stamps[rows] + after) for after in (-_ABOUT, _ABOUT)]
        moved[rows] = geometry.between(*ends) / (2 * _ABOUT)
    return dict(zip(RATES, np.where(np.abs(moved) < effects.RESTS, 0.0, moved)[:, [0, 2]].T, strict=True))


def time_zero(runs: Sequence[Run]) -> float:
    """Return the time 0 of a laser [s] by the clock of its runs: its first scan, where stamps are dates."""
    first = min(float(run.scan.t[0]) for run in runs if run.scan is not None)
    return first if first > _DAY else 0.0


def _within(run: Run) -> IntArray:
    """Return the scans of a run whose whole time lies within that of its poses, and not where some are missing.

    Over a gap that it drove through, and where it drove on after the last pose, nobody knows where the chair was.
    """
    assert run.scan is not None
    if run.pose is None:
        return np.empty(0, dtype=np.int64)
    slack = 0.1  # [s] that a scan takes, and of extrapolation at the ends where the chair stands
    scans, times, poses = run.scan.t, run.pose.t, run.pose.values[:, :3]
    early, late = (slack if _moves(run.pose, end, slack) < _HELD else 0.0 for end in (0, -1))
    inside = (scans >= times[0] - early) & (scans <= times[-1] - slack + 2 * late)
    inside &= np.isfinite(run.scan.values).any(axis=1)
    steps = np.diff(times)
    moved = np.abs(geometry.between(poses[:-1], poses[1:])).max(axis=1, initial=0.0) > _STAYS
    gaps = np.r_[False, moved & (steps > np.maximum(_GAP, _LONG * np.median(steps) if len(steps) else 0.0)), False]
    for when in (scans, scans + slack):
        inside &= ~gaps[np.searchsorted(times, when, side="right")]
    return np.asarray(np.flatnonzero(inside))


def _moves(pose: Series, end: int, seconds: float) -> float:
    """Return how far [m, rad] the chair moves in some seconds [s] about the first pose (0) or the last one (-1)."""
    near = np.flatnonzero(np.abs(pose.t - pose.t[end]) < _SPAN)
    if len(near) < 2:
        near = np.arange(len(pose.t))[-2:] if end else np.arange(len(pose.t))[:2]
    first, last = near[[0, -1]]
    moved = np.abs(geometry.between(pose.values[first, :3], pose.values[last, :3])).max()
    return float(moved * seconds / max(pose.t[last] - pose.t[first], seconds))


def laser_of(laser: Laser, mount: LaserMount | None, runs: Sequence[Run]) -> Laser:
    """Return the model's laser, mounted and fanned as the recording says."""
    if mount is not None:
        place = Mount(mount.x, mount.y, laser.mount.z, mount.yaw)
        laser = replace(
            laser,
            mount=place,
            angle_min=mount.angle_min,
            angle_increment=mount.angle_increment,
            beams=mount.beams,
            time_increment=laser.time_increment if mount.time_increment is None else mount.time_increment,
        )
    known = next((run.fan for run in runs if run.fan is not None), None)
    if known is not None:
        laser = replace(
            laser,
            angle_min=known.angle_min,
            angle_increment=known.angle_increment,
            beams=known.beams,
            time_increment=known.time_increment,
        )
    return laser


def _most_scans(laser: Laser) -> int:
    """Return how many scans are about as much to do as MOST_SCANS of an URG-04LX."""
    return int(MOST_SCANS * np.clip(_FAN / laser.beams, 1.0, _MORE))
