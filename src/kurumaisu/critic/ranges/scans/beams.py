# SPDX-License-Identifier: BSD-3-Clause
"""The scans of a recording, where and when each beam was fired, and what the model predicts for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import savgol_filter

from kurumaisu import effects, geometry
from kurumaisu.critic.ranges.scans.walls import Rays, Walls
from kurumaisu.effects import Beams, Echoes, LaserChain, incidence, slanted
from kurumaisu.params import EffectSetting, Laser
from kurumaisu.types import FloatArray, IntArray

RATES = ("v", "w")  # [m/s, rad/s] of the chair, by the reference
_SMOOTH = 0.6  # [s] of poses that are fitted together
_LEAST = 1e-4  # [m] deviation of a reading
_MOVE = 1e-3  # [m, rad] of a pose, to see how readings depend on it


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

    @property
    def bearings(self) -> FloatArray:
        """Return the bearings (k, b) [rad] at which the beams leave the laser."""
        return np.array([each.bearings for each in self.beams])

    def ends(self, ranges: FloatArray) -> FloatArray:
        """Return where (k, b, 2) [m] beams of some ranges (k, b) [m] end in the map."""
        angles = self.origins[:, :, 2] + self.bearings
        way = ranges[:, :, np.newaxis] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        return np.asarray(self.origins[:, :, :2] + way)


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

    seed: of what is drawn; shift (3,) or (k, b, 3): added to all poses; like: has nearly the same incidence, which is
    taken over.
    """
    every = model_effects_with(shots, settings)
    chain = effects.build_laser(every, np.random.default_rng(seed))
    segments = shots.walls.segments
    for effect in effects.build_world(every, np.random.default_rng([seed, 1])):
        segments = effect.apply(segments)
    rays = Rays(replace(shots.walls, segments=segments))
    beams = [chain.aim(stated_beams(shots, scan)) for scan in range(len(shots.stamps))]
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


def stated_beams(shots: Shots, scan: int) -> Beams:
    """Return the beams of a scan as its message says."""
    place, stamp, bearings = shots.laser.mount, float(shots.stamps[scan]), shots.laser.bearings
    mount = np.array([place.x, place.y, place.yaw])
    start = float(shots.tracks[shots.run[scan]].times[0])
    return Beams(stamp, stamp + shots.said, mount, place.z, bearings, np.zeros(len(bearings)), start)


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
    return chain.read(Echoes(shots.stamps[:, np.newaxis], shots.laser.bearings, *parts, shots.laser.range_max))


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


def smoothed(track: Track) -> Track:
    """Return a track with parabolas fitted to its poses, for a time in which the acceleration hardly changes."""
    size = max(round(_SMOOTH / float(np.median(np.diff(track.times)))), 3) | 1
    poses = track.poses.copy()
    poses[:, 2] = np.unwrap(poses[:, 2])
    return replace(track, poses=savgol_filter(poses, size, polyorder=2, axis=0, mode="nearest"))


def acts_on_readings(name: str) -> bool:
    """Return whether an effect acts on the mean or the deviation of readings, or on where beams leave from."""
    effect = effects.by_id(name)
    return issubclass(effect, effects.LaserEffect) and effect.stage <= effects.LaserStage.SPREAD
