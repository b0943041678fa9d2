# SPDX-License-Identifier: BSD-3-Clause
"""The scans of a recording, where and when each beam was fired, and what the model predicts for it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from kurumaisu import effects, geometry
from kurumaisu.critic.ranges.scans.standstill import stands_averaged, with_pause_rows
from kurumaisu.critic.ranges.scans.walls import Rays, Walls, walls_at
from kurumaisu.critic.values.recording import LaserMount, Recording, Run
from kurumaisu.effects import LAGS, Beams, Echoes, FirstOrder, LaserChain, incidence, slanted
from kurumaisu.params import EffectSetting, Laser, Model, Mount
from kurumaisu.types import FloatArray, IntArray
from kurumaisu.world import load_world

MOST_SCANS = 250  # that are criticised, evenly taken from all: 170 000 readings
_FAN, _MORE = 682, 2.0  # beams of such a scan; of scans of fewer beams there may be more, at most so many times
_FEWEST_SCANS = 5
_DAY = 86400.0  # [s] a first stamp beyond this is a date, not a time since the laser was switched on
RATES = ("v", "w")  # [m/s, rad/s] of the chair, by the reference
_LEAST = 1e-4  # [m] deviation of a reading
_MOVE = 1e-3  # [m, rad] of a pose, to see how readings depend on it
_GAP, _LONG = 0.3, 3.0  # [s], and usual times between poses, from which some are missing
_STAYS = 0.02  # [m, rad] from pose to pose within which the chair may have stood meanwhile
_PAST = 0.5  # [s] steps in which what was recorded is followed into the past
_ABOUT = 0.15  # [s] before and after a scan, between which its rates are taken


@dataclass(frozen=True)
class Track:
    """Reference poses of a run: times (p,) [s], poses (p, 3); doubt: of their place [m] and heading [rad], 1 sd."""

    times: FloatArray
    poses: FloatArray
    doubt: tuple[float, float] = (0.005, 0.005)


@dataclass(frozen=True)
class Shots:
    """Scans that can be predicted.

    stamps (k,) [s] since the laser's time 0, which is `zero` [s] by the clock of the runs; run (k,): index into tracks
    and runs, their names; measured (k, b) [m], nan no valid reading,
    inf no return; said (b,) [s] after the stamp at which beams are fired by the model. Times of tracks count alike.
    known: what else was recorded, by name, at each scan (k,), and the chair's rates; past (k, l): of what acts late,
    behind by each of LAGS.
    shift (k, b, 3): how far the tracks have been moved from the reference, to where the readings put the chair. All is
    linearised there; a rate taken from noisy poses would be a noisy covariate.
    """

    laser: Laser
    own: tuple[EffectSetting, ...]
    walls: Walls
    tracks: tuple[Track, ...]
    stamps: FloatArray
    run: IntArray
    measured: FloatArray
    said: FloatArray
    shift: FloatArray
    known: Mapping[str, FloatArray]
    past: Mapping[str, FloatArray]
    zero: float
    runs: tuple[str, ...]


@dataclass(frozen=True)
class BeamHits:
    """What beams meet, (k, b): ranges [m], level ones without tilt, incidence [rad], returns [1]; and the beams.

    origins (k, b, 3): poses of the laser when each is fired.
    """

    ranges: FloatArray
    level: FloatArray
    incidence: FloatArray
    returns: FloatArray
    beams: tuple[Beams, ...]
    origins: FloatArray


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
        tracks.append(Track(*with_pause_rows(run.pose.t - zero, still)))
        rows = [index for j, index in chosen if j == i]
        stamps.append(run.scan.t[rows] - zero)
        measured.append(run.scan.values[rows])
        known.append(columns_at(run, sorted(names - set(RATES)), run.scan.t[rows]))
        past.append(past_at(run, run.scan.t[rows]))
    readings, owner = np.concatenate(measured), np.array([i for i, _ in chosen])
    rates = rates_at(tracks, owner, np.concatenate(stamps))
    return Shots(
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

    Over a gap that it drove through, nobody knows where the chair was.
    """
    assert run.scan is not None
    if run.pose is None:
        return np.empty(0, dtype=np.int64)
    slack = 0.1  # [s] of extrapolation at the ends, and that a scan takes
    scans, times, poses = run.scan.t, run.pose.t, run.pose.values[:, :3]
    inside = (scans >= times[0] - slack) & (scans <= times[-1] + slack) & np.isfinite(run.scan.values).any(axis=1)
    steps = np.diff(times)
    moved = np.abs(geometry.between(poses[:-1], poses[1:])).max(axis=1, initial=0.0) > _STAYS
    gaps = np.r_[False, moved & (steps > np.maximum(_GAP, _LONG * np.median(steps) if len(steps) else 0.0)), False]
    for when in (scans, scans + slack):
        inside &= ~gaps[np.searchsorted(times, when, side="right")]
    return np.asarray(np.flatnonzero(inside))


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


def model_effects_with(shots: Shots, settings: Sequence[EffectSetting]) -> tuple[EffectSetting, ...]:
    """Return the model's own effects with these in place of those of the same id."""
    given = {setting.id for setting in settings}
    return (*(own for own in shots.own if own.id not in given), *settings)


def with_own(shots: Shots, setting: EffectSetting) -> Shots:
    """Return the shots of a model that has an effect besides."""
    return replace(shots, own=(*shots.own, setting))


def hits_of(
    shots: Shots,
    settings: Sequence[EffectSetting],
    seed: int,
    *,
    shift: FloatArray | None = None,
    like: BeamHits | None = None,
) -> BeamHits:
    """Return what the beams meet with these effects.

    seed: of what is drawn; shift (3,): added to all poses; like: has nearly the same incidence, which is taken over.
    """
    every = model_effects_with(shots, settings)
    chain = effects.build_laser(every, np.random.default_rng(seed))
    segments = shots.walls.segments
    for effect in effects.build_world(every, np.random.default_rng([seed, 1])):
        segments = effect.apply(segments)
    rays = Rays(replace(shots.walls, segments=segments))
    beams = [chain.aim(_stated_beams(shots, stamp)) for stamp in shots.stamps.tolist()]
    poses = poses_at(shots, np.array([each.times for each in beams]))
    if shift is not None:
        poses = poses + shift
    placed = geometry.compose(poses, np.array([each.mount for each in beams])[:, np.newaxis, :])
    origins = placed.reshape(-1, 3)
    bearings = np.concatenate([each.bearings for each in beams])
    level, returns = rays.cast(origins, bearings)
    shape = shots.measured.shape
    angles = incidence(rays.ranges, origins, bearings, level).reshape(shape) if like is None else like.incidence
    level = level.reshape(shape)
    ranges = np.array([slanted(row, each) for row, each in zip(level, beams, strict=True)])
    return BeamHits(ranges, level, angles, returns.reshape(shape), tuple(beams), placed)


def firing_times(shots: Shots, scan: int) -> FloatArray:
    """Return when the beams (b,) [s] of a scan leave by the model, its own effects at work."""
    chain = effects.build_laser(shots.own, np.random.default_rng(0))
    return chain.aim(_stated_beams(shots, float(shots.stamps[scan]))).times


def _stated_beams(shots: Shots, stamp: float) -> Beams:
    """Return the beams of a scan as its message says."""
    place = shots.laser.mount
    mount = np.array([place.x, place.y, place.yaw])
    return Beams(stamp, stamp + shots.said, mount, place.z, shots.laser.bearings, np.zeros(shots.laser.beams))


def poses_at(shots: Shots, times: FloatArray) -> FloatArray:
    """Return base_link (k, b, 3) at times (k, b)."""
    out = np.empty((*times.shape, 3))
    for i, track in enumerate(shots.tracks):
        rows = shots.run == i
        out[rows] = geometry.interpolate(track.times, track.poses, times[rows])
    return out


def read(
    shots: Shots, seen: BeamHits, chain: LaserChain, noise: FloatArray, moved: FloatArray | float = 0.0
) -> FloatArray:
    """Return readings (k, b) [m] of what is met by a chain, for standard deviates (k, b); neither rounded nor gated.

    moved (k, b) [m]: added to the mean, as errors of the poses are.
    """
    mean, sd = shots.laser.error.mean(seen.ranges) + moved, shots.laser.error.deviation(seen.ranges)
    known = {name: values[:, np.newaxis] for name, values in shots.known.items()}
    parts = (seen.ranges, seen.incidence, seen.returns, mean, sd, noise, seen.ranges, seen.origins, known, shots.past)
    return chain.read(Echoes(shots.stamps[:, np.newaxis], shots.laser.bearings, *parts))


def predict(
    shots: Shots, settings: Sequence[EffectSetting], seen: BeamHits, seed: int, noise: float = 0.0
) -> FloatArray:
    """Return the mean readings (k, b) [m], nan where nothing is met; noise: deviations that each is off.

    Without what is random scan by scan.
    """
    shaping = tuple(s for s in model_effects_with(shots, settings) if acts_on_readings(s.id))
    chain = effects.build_laser(shaping, np.random.default_rng(seed))
    mean = read(shots, seen, chain, np.full_like(seen.ranges, noise))
    return np.where(np.isfinite(mean), mean, np.nan)


def deviations(shots: Shots, seen: BeamHits, base: FloatArray) -> FloatArray:
    """Return the sds (k, b) [m] of readings of mean base (k, b) [m] by the model, the least where nothing is met."""
    return np.maximum(np.nan_to_num(predict(shots, (), seen, 0, noise=1.0) - base), _LEAST)


def moved_by_pose(shots: Shots, seen: BeamHits, base: FloatArray | None = None) -> FloatArray:
    """Return the change (k, b, 3) of the mean readings per metre and radian of the pose; 0 where nothing is met.

    seen: what is met; base (k, b) [m]: what is read of it, where one side of a difference will do.
    """
    out = []
    for axis in np.eye(3):
        signs = (-1.0, 1.0) if base is None else (1.0,)
        moved = [] if base is None else [base]
        for sign in signs:
            hits = hits_of(shots, (), 0, shift=sign * axis * _MOVE, like=seen)
            moved.append(predict(shots, (), hits, 0))
        out.append((moved[1] - moved[0]) / (len(signs) * _MOVE))
    return np.asarray(np.nan_to_num(np.stack(out, axis=-1)))


def _most_scans(laser: Laser) -> int:
    """Return how many scans are about as much to do as MOST_SCANS of an URG-04LX."""
    return int(MOST_SCANS * np.clip(_FAN / laser.beams, 1.0, _MORE))


def thin(shots: Shots, most: int) -> Shots:
    """Return at most so many of the scans, evenly taken."""
    return some_scans(shots, np.unique(np.linspace(0, len(shots.stamps) - 1, most).astype(int)))


def some_scans(shots: Shots, rows: IntArray) -> Shots:
    """Return some of the scans."""
    return replace(
        shots,
        stamps=shots.stamps[rows],
        run=shots.run[rows],
        measured=shots.measured[rows],
        shift=shots.shift[rows],
        known={name: values[rows] for name, values in shots.known.items()},
        past={name: values[rows] for name, values in shots.past.items()},
    )


def acts_on_readings(name: str) -> bool:
    """Return whether an effect acts on the mean or the deviation of readings, or on where beams leave from."""
    effect = effects.by_id(name)
    return issubclass(effect, effects.LaserEffect) and effect.stage <= effects.LaserStage.SPREAD
