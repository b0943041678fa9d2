# SPDX-License-Identifier: BSD-3-Clause
"""Where the scans just before another one put the chair: they saw the same walls from nearly the same wrong pose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.critic.predict.scan import OUTLIER, ScanModel, doubts, expected, fit_scatter
from kurumaisu.critic.predict.scan_poses import ScanPoses, joined
from kurumaisu.critic.ranges.scans.beams import Shots, some_scans
from kurumaisu.critic.values.recording import Run
from kurumaisu.critic.values.settings import Settings
from kurumaisu.types import FloatArray, IntArray

_REACH = 0.45  # [s] for which an error of the pose lasts
_WITHIN = 0.5  # [m], [rad] that the chair may have moved meanwhile
_MOST = 3  # scans that are looked back on
_SHARES = (0.0, 0.5, 1.0)  # of the correction that are tried
_FEWEST = 10  # scans to try them on


@dataclass(frozen=True)
class ScanMatcher:
    """Models of scans: alone, and after others that correct the pose by a share of what they say; None: no use."""

    alone: ScanModel
    after: ScanModel | None
    share: float

    def predict(self, places: ScanPoses, run: Run, stamps: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return means and sds (k, b) [m] of the scans of a run at stamps (k,) [s], nan where nothing is expected."""
        shots = places.of(run, stamps)
        means, sds = self.alone.predict(shots)
        if self.after is None:
            return means, sds
        errors = pose_errors(shots, run, places.zero, self.alone)
        if errors:
            able = np.array(sorted(errors))
            means[able], sds[able] = self.after.predict(pose_corrected(shots, errors, self.share))
        return means, sds


def trained_matcher(places: ScanPoses, settings: Settings) -> ScanMatcher:
    """Return what predicts scans, as it proves on the scans of the runs to fit."""
    runs = places.trained_runs()
    whole = joined([shots for _, shots in runs])
    alone = fit_scatter(whole, settings)
    best, after, share = -np.inf, None, 0.0
    parts = [(shots, pose_errors(shots, run, places.zero, alone)) for run, shots in runs]
    parts = [(shots, errors) for shots, errors in parts if errors]
    for tried in _SHARES if sum(len(errors) for _, errors in parts) >= _FEWEST else ():
        some = joined([pose_corrected(shots, errors, tried) for shots, errors in parts])
        model = fit_scatter(some, settings)
        density = _density(model, some)
        if density > best:
            best, after, share = density, model, tried
    return ScanMatcher(alone, after if share > 0 else None, share)


def _density(model: ScanModel, shots: Shots) -> float:
    """Return the mean log density of readings, up to a constant; outliers count as 5 sds."""
    means, sds = model.of(expected(shots, model.settings))
    z = (shots.measured - means) / sds
    use = np.isfinite(z)
    return -float(np.mean(0.5 * np.minimum(z[use] ** 2, OUTLIER**2) + np.log(sds[use])))


def pose_errors(shots: Shots, run: Run, zero: float, model: ScanModel) -> dict[int, FloatArray]:
    """Return the errors (3,) of the poses of shots by the scans before them, by row, for those that have any."""
    if run.scan is None:
        return {}
    before = [_before(shots, k, run.scan.t - zero) for k in range(len(shots.stamps))]
    owner = np.repeat(np.arange(len(before)), [len(rows) for rows in before])
    if not len(owner):
        return {}
    rows = np.concatenate(before).astype(int)
    return _errors(_seen(shots, owner, run.scan.t[rows] - zero, run.scan.values[rows]), owner, model)


def pose_corrected(shots: Shots, errors: Mapping[int, FloatArray], share: float) -> Shots:
    """Return the shots that have errors, on tracks of their own from which a share of them is taken."""
    rows = sorted(errors)
    tracks = [(shots.tracks[shots.run[k]], errors[k]) for k in rows]
    return replace(
        some_scans(shots, np.array(rows)),
        tracks=tuple(replace(track, poses=track.poses + share * error) for track, error in tracks),
        run=np.arange(len(rows)),
    )


def _before(shots: Shots, k: int, stamps: FloatArray) -> IntArray:
    """Return the last scans before one, in whose time the chair has hardly moved."""
    stamp = float(shots.stamps[k])
    rows = np.flatnonzero((stamps < stamp - 1e-6) & (stamps > stamp - _REACH))[-_MOST:]
    track = shots.tracks[shots.run[k]]
    at = [np.array([np.interp(t, track.times, track.poses[:, i]) for i in range(3)]) for t in (stamp, *stamps[rows])]
    near = [bool(np.abs(pose - at[0]).max() < _WITHIN) for pose in at[1:]]
    return np.asarray(rows[np.array(near, dtype=bool)])


def _seen(shots: Shots, owner: IntArray, stamps: FloatArray, measured: FloatArray) -> Shots:
    shift = np.zeros((*measured.shape, 3))
    return replace(some_scans(shots, owner), stamps=stamps, measured=measured, shift=shift)


def _errors(shots: Shots, owner: IntArray, model: ScanModel) -> dict[int, FloatArray]:
    """Return for each owner the error (3,) of its pose that its scans agree upon, within what is plausible."""
    what = expected(shots, model.settings)
    left, sd = shots.measured - what.mean, model.of(what)[1]
    with np.errstate(invalid="ignore"):
        use = what.place & (np.abs(left / sd) < OUTLIER)
    plausible = np.maximum(model.factors[[1, 1, 2, 3]], 1e-6)
    out, doubt = {}, doubts(shots)
    for k in np.unique(owner).tolist():
        mine = owner == k
        columns, own = what.shared[mine][use[mine]], what.parts[0][mine][use[mine]] * model.factors[0] ** 2
        if len(columns) > len(plausible):
            weighed = columns / own[:, np.newaxis]
            inner = weighed.T @ columns + np.diag(plausible**-2)
            out[int(k)] = np.linalg.solve(inner, weighed.T @ left[mine][use[mine]])[:3] * doubt[mine][0]
    return out
