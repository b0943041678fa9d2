# SPDX-License-Identifier: BSD-3-Clause
"""prediction.csv: what was asked for of test runs, each with its standard deviation."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence

import numpy as np

from kurumaisu.critic.base.covariates import with_covariates_but_place
from kurumaisu.critic.base.drive import driven, prepare_all
from kurumaisu.critic.predict.motion import Forecast, motion_ahead
from kurumaisu.critic.predict.reference_path import Paths
from kurumaisu.critic.predict.scan_matching import trained_matcher
from kurumaisu.critic.predict.scan_poses import ScanPoses
from kurumaisu.critic.ranges.scans.gathering import why_not_usable
from kurumaisu.critic.values.prediction import Prediction
from kurumaisu.critic.values.recording import Recording, Run
from kurumaisu.critic.values.settings import Settings
from kurumaisu.params import Model
from kurumaisu.types import FloatArray

COLUMNS = ("run", "channel", "t0", "t1", "beam", "mean", "sd")
MOTION_CHANNELS = ("dx", "dy", "dtheta")
RANGE = "range"
FILE = "prediction.csv"


def asked(recording: Recording) -> tuple[Run, ...]:
    """Return the runs of which something is to be predicted."""
    return tuple(run for run in recording.runs if run.queries is not None and len(run.queries))


def predictions(recording: Recording, forecast: Forecast | None, scans: Sequence[Prediction]) -> Iterator[Prediction]:
    """Yield all that was asked for, runs in their order; forecast: None where nobody drove; scans: as of ranges."""
    for run in asked(recording):
        assert run.queries is not None
        made = _motions(run, forecast) + [one for one in scans if one.run == run.name]
        known = {(one.t0, one.t1): one for one in made}
        yield from (known[t0, t1] for t0, t1 in run.queries.tolist())


def _motions(run: Run, forecast: Forecast | None) -> list[Prediction]:
    assert run.queries is not None
    queries = run.queries[run.queries[:, 1] > run.queries[:, 0]]
    if forecast is not None and driven(run):
        return motions_of(run, forecast, queries)
    nothing = np.full(3, np.nan)
    return [Prediction(run.name, t0, t1, nothing, nothing) for t0, t1 in queries.tolist()]


def ranges(recording: Recording, model: Model, forecast: Forecast | None, settings: Settings) -> Iterator[Prediction]:
    """Yield the scans asked for; nan throughout where there is no map, no pose, or no scan to learn from.

    recording: its reference stamped by the scans' clock, as forecast is; settings: all that extends the model.
    """
    stamps = {run.name: _stamps(run) for run in asked(recording)}
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


def _stamps(run: Run) -> FloatArray:
    assert run.queries is not None
    return np.asarray(run.queries[run.queries[:, 1] == run.queries[:, 0], 0])


def _beams(recording: Recording, model: Model) -> int:
    """Return how many ranges a scan has."""
    seen = [run.scan.values.shape[1] for run in recording.runs if run.scan is not None]
    return seen[0] if seen else recording.laser.beams if recording.laser is not None else model.laser.beams


def motions_of(run: Run, forecast: Forecast, queries: FloatArray) -> list[Prediction]:
    """Return the motions of a driven run for queries (q, 2) of t0 < t1 [s]."""
    if not len(queries):
        return []
    drive = with_covariates_but_place(prepare_all(run, forecast.model, float(queries.max())), run)
    paths = Paths(drive, forecast.model, forecast.settings, forecast.others)
    out = []
    for t0, t1 in queries.tolist():
        ahead = motion_ahead(drive, paths, forecast.noise, t0, t1)
        out.append(Prediction(run.name, t0, t1, ahead.mean, ahead.sds))
    return out


def prediction_table(predictions: Sequence[Prediction]) -> str:
    """Return the text of prediction.csv, in the order of runs and queries."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for one in predictions:
        writer.writerows(_rows(one))
    return text.getvalue()


def _rows(one: Prediction) -> Iterator[tuple[str | float | int, ...]]:
    for i, (mean, sd) in enumerate(zip(one.means.tolist(), one.sds.tolist(), strict=True)):
        channel, beam = (RANGE, i) if one.is_scan else (MOTION_CHANNELS[i], "")
        yield one.run, channel, repr(one.t0), repr(one.t1), beam, f"{mean:.9g}", f"{sd:.6g}"
