# SPDX-License-Identifier: BSD-3-Clause
"""prediction.csv: what was asked for of test runs, each with its standard deviation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.base.covariates import with_covariates_but_place
from kurumaisu.critic.base.drive import driven, prepare_all
from kurumaisu.critic.data.csv_reader import csv_text
from kurumaisu.critic.predict.motion import Forecast, Paths, motion_ahead
from kurumaisu.critic.predict.scan import OUTLIER, ScanModel, doubts, expected, fit_scatter
from kurumaisu.critic.predict.scan_poses import ScanPoses, joined
from kurumaisu.critic.ranges.scans.beams import Shots, some_scans
from kurumaisu.critic.ranges.scans.gathering import why_not_usable
from kurumaisu.critic.values.criticism import Prediction, Settings
from kurumaisu.critic.values.recording import Recording, Run
from kurumaisu.params import Model
from kurumaisu.types import FloatArray, IntArray

COLUMNS = ("run", "channel", "t0", "t1", "beam", "mean", "sd")
MOTION_CHANNELS = ("dx", "dy", "dtheta")
RANGE = "range"
FILE = "prediction.csv"
_REACH = 0.45  # [s] for which an error of the pose lasts
_WITHIN = 0.5  # [m], [rad] that the chair may have moved meanwhile
_MOST = 3  # scans that are looked back on
_SHARES = (0.0, 0.5, 1.0)  # of the correction that are tried
_FEWEST = 10  # scans to try them on


def asked(recording: Recording) -> tuple[Run, ...]:
    """Return the runs of which something is to be predicted."""
    return tuple(run for run in recording.runs if run.queries is not None and len(run.queries))


def predictions(recording: Recording, forecast: Forecast | None, scans: Sequence[Prediction]) -> Iterator[Prediction]:
    """Yield all that was asked for, runs in their order; forecast: None where nobody drove; scans: as of ranges."""
    for run in asked(recording):
        assert run.queries is not None
        moves = run.queries[run.queries[:, 1] > run.queries[:, 0]]
        made = motions_of(run, forecast, moves) + [one for one in scans if one.run == run.name]
        known = {(one.t0, one.t1): one for one in made}
        yield from (known[t0, t1] for t0, t1 in run.queries.tolist())


def motions_of(run: Run, forecast: Forecast | None, queries: FloatArray) -> list[Prediction]:
    """Return the motions of a run for queries (q, 2) of t0 < t1 [s]; nan where it was not driven."""
    if forecast is None or not driven(run):
        nothing = np.full(3, np.nan)
        return [Prediction(run.name, t0, t1, nothing, nothing) for t0, t1 in queries.tolist()]
    if not len(queries):
        return []
    drive = with_covariates_but_place(prepare_all(run, forecast.model, float(queries.max())), run)
    paths = Paths(drive, forecast.model, forecast.settings, forecast.others)
    made = []
    for t0, t1 in queries.tolist():
        mean, covariance = motion_ahead(drive, paths.at, forecast.noise, t0, t1)
        made.append(Prediction(run.name, t0, t1, mean, np.sqrt(np.diag(covariance))))
    return made


def ranges(recording: Recording, model: Model, forecast: Forecast | None, settings: Settings) -> Iterator[Prediction]:
    """Yield the scans asked for; nan throughout where there is no map, no pose, or no scan to learn from.

    recording: its reference stamped by the scans' clock, as forecast is; settings: all that extends the model.
    """
    queries = {run.name: run.queries for run in asked(recording) if run.queries is not None}
    stamps = {name: some[some[:, 1] == some[:, 0], 0] for name, some in queries.items()}
    wanted = [run for run in asked(recording) if len(stamps[run.name])]
    if not wanted:
        return
    able = why_not_usable(recording) is None
    places = ScanPoses(recording, model, forecast) if able else None
    refiner = trained_matcher(places, settings) if places else None
    for run in wanted:
        if places is None or refiner is None or run.pose is None:
            beams = _beams(recording, model)
            means = sds = np.full((len(stamps[run.name]), beams), np.nan)
        else:
            means, sds = refiner.predict(places, run, stamps[run.name])
        for t, mean, sd in zip(stamps[run.name].tolist(), means, sds, strict=True):
            yield Prediction(run.name, t, t, mean, sd)


def _beams(recording: Recording, model: Model) -> int:
    """Return how many ranges a scan has."""
    seen = [run.scan.values.shape[1] for run in recording.runs if run.scan is not None]
    return seen[0] if seen else recording.laser.beams if recording.laser is not None else model.laser.beams


def prediction_table(predictions: Sequence[Prediction]) -> str:
    """Return the text of prediction.csv, in the order of runs and queries."""
    return csv_text(COLUMNS, (row for one in predictions for row in _rows(one)))


def _rows(one: Prediction) -> Iterator[tuple[str | float | int, ...]]:
    for i, (mean, sd) in enumerate(zip(one.means.tolist(), one.sds.tolist(), strict=True)):
        channel, beam = (RANGE, i) if one.is_scan else (MOTION_CHANNELS[i], "")
        yield one.run, channel, repr(one.t0), repr(one.t1), beam, f"{mean:.9g}", f"{sd:.6g}"


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
        errors = pose_errors(shots, run, self.alone)
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
    parts = [(shots, pose_errors(shots, run, alone)) for run, shots in runs]
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


def pose_errors(shots: Shots, run: Run, model: ScanModel) -> dict[int, FloatArray]:
    """Return the errors (3,) of the poses of shots by the scans before them, by row, for those that have any."""
    if run.scan is None:
        return {}
    before = [_before(shots, k, run.scan.t - shots.zero) for k in range(len(shots.stamps))]
    owner = np.repeat(np.arange(len(before)), [len(rows) for rows in before])
    if not len(owner):
        return {}
    rows = np.concatenate(before).astype(int)
    measured = run.scan.values[rows]
    shift = np.zeros((*measured.shape, 3))
    seen = replace(some_scans(shots, owner), stamps=run.scan.t[rows] - shots.zero, measured=measured, shift=shift)
    return _errors(seen, owner, model)


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
    here, *before = geometry.interpolate(track.times, track.poses, np.array([stamp, *stamps[rows]]))
    return np.asarray(rows[[bool(np.abs(pose - here).max() < _WITHIN) for pose in before]], dtype=int)


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
