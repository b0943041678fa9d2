# SPDX-License-Identifier: BSD-3-Clause
"""Which scans of a recording its laser is criticised by, where that laser was, and what else was known then."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from kurumaisu import effects, geometry
from kurumaisu.critic.ranges.scans.beams import RATES, Shots, Track, hits_of, moved_by_pose, predict, smoothed
from kurumaisu.critic.ranges.scans.valid_readings import usable_beams
from kurumaisu.critic.ranges.scans.walls import walls_at
from kurumaisu.critic.values.recording import LaserMount, Recording, Run, Series
from kurumaisu.critic.values.robust import third_difference_sd
from kurumaisu.effects import LAGS, FirstOrder
from kurumaisu.params import Laser, Model, Mount
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import BoolArray, FloatArray, IntArray
from kurumaisu.world import load_world

MOST_SCANS = 150  # that are criticised, evenly taken from all: 100 000 readings
_FAN, _MORE = 682, 2.0  # beams of such a scan; of scans of fewer beams there may be more, at most so many times
_FEWEST_SCANS = 5
_DAY = 86400.0  # [s] a first stamp beyond this is a date, not a time since the laser was switched on
_GAP, _LONG = 0.3, 3.0  # [s], and usual times between poses, from which some are missing
_STAYS = 0.02  # [m, rad] from pose to pose within which the chair may have stood meanwhile
_HELD = 5e-3  # [m, rad] that a chair may move while a scan lasts, and stands
_SPAN = 0.5  # [s] about the first or the last pose, over which that is seen: poses are noisy
_PAST = 0.5  # [s] steps in which what was recorded is followed into the past
_ABOUT = 0.15  # [s] before and after a scan, between which its rates are taken
_PAUSE = 5.0  # [s] without a pose, after which the chair may stand elsewhere
_APART = 1e-3  # [s] from the middle of a pause, at which the stand before ends and the next one begins
_STEP = 8.0  # sds of the poses' jitter that lie between two of them where the chair stands
_SPREAD = 2.2  # sds of the jitter, itself known to a third from few poses, that poses of one place scatter by
_FEWEST = 5  # poses of a stand
_MOSTLY = 0.5  # share of what might be a stand that is one: of a slow drive some poses always lie together
_OFF = 4.0  # sds of the jitter by which poses at the ends of a stand are off where the chair still rolls, or does again
_CLIP = 3.0  # robust sds at which a reading counts as an outlier
_ROUNDS = 3  # of fitting poses to scans
_TRIES = 40
_LEFT = 0.5  # share of the readings of straight walls that are away from edges of stairs, below which too few are left
_ROUGHER = 1.1  # times as far as readings scatter about the others, up to which nobody can say which walls they are of
_SEARCHED = np.array([0.003, 0.003, 0.001])  # [m, rad] of them about what was fitted, 1 sd, at first
_COARSER = 1.3  # times the model's angle between beams, from which they may have been thinned out
_LATER = 0.01  # [s] by which all beams are fired later, to see what a delay does
_NEAR = 0.1  # [m] beyond which a reading is of another wall


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
    most = int(MOST_SCANS * np.clip(_FAN / laser.beams, 1.0, _MORE))  # about as much to do as so many of an URG-04LX
    chosen = [chosen[i] for i in np.unique(np.linspace(0, len(chosen) - 1, most).astype(int))]
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
        laser = replace(laser, mount=Mount(mount.x, mount.y, laser.mount.z, mount.yaw))
    for fan in (mount, next((run.fan for run in runs if run.fan is not None), None)):
        if fan is not None:
            increment = laser.time_increment if fan.time_increment is None else fan.time_increment
            known = {name: getattr(fan, name) for name in ("angle_min", "angle_increment", "beams")}
            laser = replace(laser, **known, time_increment=increment)
    return laser


def stands_averaged(times: FloatArray, poses: FloatArray, creeping: Sequence[float] = ()) -> FloatArray:
    """Return poses (n, 3), those of each stand replaced by their mean; times (n,) [s].

    creeping: times [s] in stands that are none.

    A reference errs alike while the chair stands. Taken for so many independent poses it would seem to be far better
    known than it is. One scan taken while the chair rolls out would be off by all that it rolls.
    """
    if len(times) < _FEWEST:
        return poses
    jitter = np.maximum(third_difference_sd(poses), 1e-9)
    step = np.abs(np.diff(poses, axis=0)) / jitter
    pauses = np.flatnonzero(np.diff(times) > _PAUSE) + 1
    cuts = np.union1d(np.flatnonzero((step > _STEP).any(axis=1)) + 1, pauses)
    apart = {0, len(times), *pauses.tolist()}  # nobody drove there
    out, inside = poses.copy(), np.clip(creeping, times[0], times[-1])
    for rows in np.split(np.arange(len(times)), cuts):
        still = rows[_still(poses[rows], jitter, rows[0] not in apart, rows[-1] + 1 not in apart)]
        if len(still) and ((inside >= times[still[0]]) & (inside <= times[still[-1]])).any():
            continue
        if len(still) >= max(_FEWEST, _MOSTLY * len(rows)) and _stands(poses[still], jitter):
            out[still] = poses[still].mean(axis=0)
    return out


def with_pause_rows(times: FloatArray, poses: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return times (m,) [s] and poses (m, 3) with rows in the middle of pauses: until or from there a stand lasts.

    Between two stands the chair was carried, nobody knows when. A straight way from one to the other would have it
    creep at the first and the last scans of both, and a late stamp or a long sweep would seem to show.
    """
    same = np.r_[False, (poses[1:] == poses[:-1]).all(axis=1), False]
    row = np.arange(len(times) - 1)
    gap = (np.diff(times) > _PAUSE) & ~same[1:-1]
    late, early = row[gap & same[row]], row[gap & same[row + 2]]
    middle = 0.5 * (times[1:] + times[:-1])
    order = np.argsort(np.r_[np.arange(len(times)), late + 0.25, early + 0.75], kind="stable")
    every = np.r_[times, middle[late] - _APART, middle[early] + _APART]
    return every[order], np.concatenate([poses, poses[late], poses[early + 1]])[order]


def _stands(poses: FloatArray, jitter: FloatArray) -> bool:
    """Tell whether poses scatter as much as their jitter, and no more."""
    return bool((poses.std(axis=0) <= _SPREAD * jitter).all())


def _still(poses: FloatArray, jitter: FloatArray, before: bool, behind: bool) -> slice:
    """Return the rows of a stand (n, 3) without those at its ends in which the chair may still roll.

    before, behind: whether it was driven there, so that nobody knows when within the last interval it came to rest.
    """
    off = (poses - np.median(poses, axis=0)) / jitter
    one = (np.abs(off) > _OFF).any(axis=1)
    two = (np.abs(off[1:] + off[:-1]) > np.sqrt(2) * _OFF).any(axis=1)  # each with the next one
    ahead, back = ~(one | np.r_[two, False]), ~(one | np.r_[False, two])[::-1]
    low = int(np.argmax(ahead)) + 1 if before else 0
    high = len(poses) - (int(np.argmax(back)) + 1 if behind else 0)
    return slice(low, max(high, low))


def with_likelier_walls(shots: Shots) -> Shots:
    """Return shots with straight walls in place of pixels, unless the readings have their stairs: then with those.

    Where these are so fine that they are lost in the noise, nobody can say: straight walls have both, then.

    Whether they have is seen where the scans put the chair: a reference that errs by more than a pixel tells nothing.
    """
    if shots.walls.drawn is None:
        return shots
    even = replace(shots, tracks=tuple(map(smoothed, shots.tracks)))
    place = _fitted(even)
    _, met = _errors(even, place)
    # Pixels have no slopes that lead to where the chair was.
    straight, drawn = (
        _least_scatter(replace(even, walls=walls), place, met) for walls in (shots.walls, shots.walls.drawn)
    )
    if met.any() and drawn / _ROUGHER < straight < _ROUGHER * drawn:
        return shots
    if straight < drawn or not met.any():
        return replace(shots, walls=replace(shots.walls, drawn=None))
    _, left = _errors(replace(even, walls=shots.walls.drawn), place)
    return replace(shots, walls=replace(shots.walls.drawn, stairs=bool(left.sum() < _LEFT * met.sum())))


def _fitted(shots: Shots) -> FloatArray:
    """Return by how much the poses (k, b, 3) [m, rad] of all beams are to be moved to where the readings put them.

    Over a scan they may be off as they would be at another rate.
    """
    place = np.zeros_like(shots.shift)
    doubt = np.tile(np.array([track.doubt for track in shots.tracks])[shots.run][:, [0, 0, 1]], 2)  # of poses, 1 sd
    during = np.linspace(-1.0, 1.0, shots.laser.beams)[:, np.newaxis]
    moves = moved_by_pose(shots, hits_of(shots, (), 0))
    moves = np.concatenate([moves, moves * during], axis=2)
    at = np.zeros_like(doubt)
    for _ in range(_ROUNDS):
        off, seen = _errors(shots, place)
        if not seen.any():
            break
        off = off - np.median(off[seen])  # what all are off is no pose
        sd = SIGMA_PER_MAD * np.median(np.abs(off[seen]))
        for k in range(len(place)):
            one, left = moves[k, seen[k]], np.clip(off[k, seen[k]], -_CLIP * sd, _CLIP * sd)
            prior = (sd / doubt[k]) ** 2
            at[k] += np.linalg.solve(one.T @ one + np.diag(prior), one.T @ left - prior * at[k])
        place = at[:, np.newaxis, :3] + at[:, np.newaxis, 3:] * during
    return place


def _errors(shots: Shots, place: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return how far readings (k, b) [m] are off from moved poses, and which of them are of walls."""
    seen = hits_of(shots, (), 0, shift=place)
    base = predict(shots, (), seen, 0)
    off = shots.measured - base
    return off, usable_beams(shots, seen, base) & np.isfinite(off)


def _least_scatter(shots: Shots, place: FloatArray, met: BoolArray) -> float:
    """Return how far readings of walls scatter [m], a constant apart, from the best poses about place (k, b, 3)."""
    rng = np.random.default_rng(0)
    least, best = np.full(len(place), np.inf), place
    far = 0.0
    for n in range(_TRIES + 1 if met.any() else 0):
        size = _SEARCHED * (1 - n / _TRIES) if n else np.zeros(3)
        tried = best + (size * rng.standard_normal((len(place), 3)))[:, np.newaxis]
        off = np.where(met, shots.measured - predict(shots, (), hits_of(shots, (), 0, shift=tried), 0), np.nan)
        off -= np.nanmedian(off)
        far = far or _CLIP * float(np.nanmedian(np.abs(off)))
        scatter = np.nansum(np.square(np.clip(off, -far, far)), axis=1)
        better = scatter < least
        least, best = np.where(better, scatter, least), np.where(better[:, np.newaxis, np.newaxis], tried, best)
    return float(np.sqrt(least.sum() / max(met.sum(), 1)))


def with_sweep_time(recording: Recording, model: Model) -> Recording:
    """Return a recording whose laser has the time between its beams [s]: of the model's, or as much more as its angle.

    As it is where the recording says it, or nothing tells; of both, what the readings are nearer to, beside a delay.
    """
    laser, usual = recording.laser, model.laser
    if laser is None or laser.time_increment is not None or why_not_usable(recording) is not None:
        return recording
    coarser = abs(laser.angle_increment / usual.angle_increment)
    if coarser < _COARSER or usual.time_increment <= 0 or any(run.fan is not None for run in recording.runs):
        return recording
    shots = gather(recording, model)
    turned = _share_of_turn(shots, coarser)
    increment = usual.time_increment * (coarser if turned > 1 / 2 else 1.0)
    return replace(recording, laser=replace(laser, time_increment=increment))


def _share_of_turn(shots: Shots, coarser: float) -> float:
    """Return which share of what more time between beams would do to the readings is in them.

    Beside what a delay does, and a clock that runs fast or slow.
    """
    left = shots.measured - _readings(shots, shots.said)
    even = replace(shots, tracks=tuple(map(smoothed, shots.tracks)))
    now = _readings(even, shots.said)
    slower, later = (_readings(even, said) - now for said in (coarser * shots.said, shots.said + _LATER))
    since = (shots.stamps / max(float(np.abs(shots.stamps).max()), 1.0))[:, np.newaxis]
    with np.errstate(invalid="ignore"):
        use = (np.abs(left) < _NEAR) & (np.abs(slower) < _NEAR) & (np.abs(later) < _NEAR)
    columns = np.stack([slower[use], later[use], (since * later)[use]], axis=1)
    return float(np.linalg.lstsq(columns, left[use], rcond=None)[0][0]) if use.any() else 0.0


def _readings(shots: Shots, said: FloatArray) -> FloatArray:
    """Return what the model reads (k, b) [m] with beams fired at other times (b,) [s] after the stamp."""
    moved = replace(shots, said=said)
    return predict(moved, (), hits_of(moved, (), 0), 0)
