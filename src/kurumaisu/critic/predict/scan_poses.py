# SPDX-License-Identifier: BSD-3-Clause
"""Where a chair was while it scanned: by the reference up to then and, where something drove it, by the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.base.covariates import with_covariates_but_place
from kurumaisu.critic.base.drive import Drive, driven, prepare_all
from kurumaisu.critic.noise.base_noise import Noise
from kurumaisu.critic.predict.motion import Forecast, Paths, motion_ahead
from kurumaisu.critic.ranges.scans.beams import Shots, Track, thin
from kurumaisu.critic.ranges.scans.gathering import columns_at, gather, past_at, rates_at, together
from kurumaisu.critic.values.recording import Recording, Run
from kurumaisu.params import Model
from kurumaisu.types import FloatArray

_AROUND = np.array([-0.5, -0.3, -0.2, -0.1, 0.0, 0.05, 0.1, 0.2, 0.3])  # [s] about a stamp: late clocks, slow sweeps
_AFTER = 1e-3  # [s] so much later a pose is asked for, where the last row is of the very stamp
_NEAR = 0.3  # [s] from a pose on either side within which a scan's place is known
_SAME = 1e-3  # [s]
_LEAST = 0.1  # of the reference's errors: no pose is known better
_RANDOM = 60  # scans that the scatter is estimated from


class ScanPoses:
    """Shots of a recording's laser, each scan on the track that is known for it."""

    def __init__(self, recording: Recording, model: Model, forecast: Forecast | None) -> None:
        """Take a recording whose laser can be criticised; forecast: None where nobody knows how the chair moves."""
        self._recording, self._forecast = recording, forecast
        self._base = gather(recording, model)

    def of(self, run: Run, stamps: FloatArray, measured: FloatArray | None = None) -> Shots:
        """Return shots of a run with poses at stamps (k,) [s]; measured (k, b) [m], if known."""
        tracks = self._tracks(run, stamps)
        shape = (len(stamps), self._base.laser.beams)
        owner = np.arange(len(stamps)) if len(tracks) > 1 else np.zeros(len(stamps), dtype=int)
        return replace(
            self._base,
            tracks=tuple(replace(track, times=track.times - self._base.zero) for track in tracks),
            stamps=stamps - self._base.zero,
            run=owner,
            measured=np.full(shape, np.nan) if measured is None else measured,
            shift=np.zeros((*shape, 3)),
            known={**columns_at(run, self._base.known, stamps), **rates_at(tracks, owner, stamps)},
            past=past_at(run, stamps),
        )

    def trained_runs(self) -> list[tuple[Run, Shots]]:
        """Return the runs to fit, each with few of its shots."""
        few, runs = thin(self._base, _RANDOM), {run.name: run for run in self._recording.runs}
        owned = [(runs[name], few.run == i) for i, name in enumerate(few.runs) if (few.run == i).any()]
        return [(run, self.of(run, few.stamps[rows] + few.zero, few.measured[rows])) for run, rows in owned]

    def _tracks(self, run: Run, stamps: FloatArray) -> list[Track]:
        assert run.pose is not None
        if self._forecast is None or not driven(run):
            return [Track(run.pose.t, run.pose.values[:, :3], self._recording.truth or Track.doubt)]
        forecast = self._forecast
        drive = with_covariates_but_place(prepare_all(run, forecast.model, float(stamps.max()) + _AROUND[-1]), run)
        paths = Paths(drive, forecast.model, forecast.settings, ())
        return [_around(drive, paths, forecast, stamp) for stamp in stamps.tolist()]


def _around(drive: Drive, paths: Paths, forecast: Forecast, stamp: float) -> Track:
    """Return where the chair was about a stamp, by the rows up to it: each errs, all together less."""
    row = int(np.searchsorted(drive.times, stamp + 1e-6)) - 1
    if row < 0:
        return Track(drive.times, drive.poses, (forecast.noise.position_sd, forecast.noise.heading_sd))
    last = float(drive.times[row])
    mean, covariance = motion_ahead(drive, paths.at, forecast.noise, last, max(stamp, last + _AFTER))
    there = geometry.compose(drive.poses[row], mean)
    times = stamp + _AROUND
    sim = paths.at(drive, times, [row])[0]
    middle = int(np.argmin(np.abs(_AROUND)))
    poses = geometry.compose(np.broadcast_to(there, sim.shape), geometry.between(sim[middle], sim))
    white = np.square([forecast.noise.position_sd, forecast.noise.position_sd, forecast.noise.heading_sd])
    return Track(times, poses, _doubt(covariance - np.diag(white), forecast.noise))


def _doubt(covariance: FloatArray, noise: Noise) -> tuple[float, float]:
    """Return what a pose may be off, place [m] and heading [rad]; covariance (3, 3): without the reference's errors."""
    least = max(noise.lasting, _LEAST) ** 2 * np.array([noise.position_sd**2, noise.heading_sd**2])
    place = np.array([0.5 * (covariance[0, 0] + covariance[1, 1]), covariance[2, 2]])
    both = np.sqrt(np.maximum(place, 0.0) + least)
    return float(both[0]), float(both[1])


def joined(parts: Sequence[Shots]) -> Shots:
    """Return shots of one laser together."""
    offsets = np.cumsum([0, *(len(part.tracks) for part in parts[:-1])])
    return replace(
        parts[0],
        tracks=tuple(track for part in parts for track in part.tracks),
        stamps=np.concatenate([part.stamps for part in parts]),
        run=np.concatenate([part.run + offset for part, offset in zip(parts, offsets, strict=True)]),
        measured=np.concatenate([part.measured for part in parts]),
        shift=np.concatenate([part.shift for part in parts]),
        known=together([part.known for part in parts]),
        past=together([part.past for part in parts]),
    )


def chosen(run: Run, most: int) -> tuple[FloatArray, FloatArray]:
    """Return stamps (k,) and readings (k, b) of at most so many scans of a run at which its poses are known."""
    if run.scan is None or run.pose is None:
        return np.empty(0), np.empty((0, 0))
    next_to = np.abs(run.pose.t[np.searchsorted(run.pose.t[:-1], run.scan.t)] - run.scan.t)
    before = np.abs(run.pose.t[np.maximum(np.searchsorted(run.pose.t, run.scan.t) - 1, 0)] - run.scan.t)
    known = (np.maximum(next_to, before) < _NEAR) | (np.minimum(next_to, before) < _SAME)
    rows = np.flatnonzero(known & np.isfinite(run.scan.values).any(axis=1))
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(int))] if len(rows) else rows
    return run.scan.t[rows], run.scan.values[rows]
