# SPDX-License-Identifier: BSD-3-Clause
"""A reference that errs with the place is told of without any scans, and its noise is not taken for that."""

from dataclasses import replace

import numpy as np
import pytest
import unknown_effects as hidden

from kurumaisu.critic.base.covariates import with_covariates
from kurumaisu.critic.base.drive import GRID, prepare
from kurumaisu.critic.judge.drive_verdict import criticise_drives
from kurumaisu.critic.values.recording import Run, Series

EFFECTS = frozenset({"base.gain_v", "base.gain_w", "base.marker_yaw", "smooth"})


def bent(axis, by):
    """Return a recording whose reference errs in x, y or heading by what a function of its poses says."""
    recording = hidden.make(hidden.KINDS["gully"], 20.0, 5, seconds=60.0).null
    runs = []
    for run in recording.runs:
        poses = run.pose.values.copy()
        poses[:, axis] += by(poses)
        runs.append(replace(run, pose=replace(run.pose, values=poses)))
    *train, test = (run.name for run in runs)
    return replace(recording, runs=tuple(runs), train=tuple(train), test=(test,))


@pytest.mark.parametrize(
    ("axis", "by", "told"),
    [
        (0, lambda p: 0.04 * np.tanh(2 * p[:, 1]), ("reference.x", "y")),
        (2, lambda p: 0.04 * np.sin(2 * p[:, 0]), ("reference.heading", "x")),
    ],
)
def test_an_error_of_the_reference_is_told_over_the_place(axis, by, told):
    found, extension = criticise_drives(bent(axis, by), hidden.MODEL, lambda _: None, EFFECTS)
    first = found.verdict.unknown[0]
    assert (first.channel, first.covariate) == told
    assert first.p > 0.9
    assert found.verdict.causes == () or {cause.id for cause in found.verdict.causes} == {"base.process_noise"}
    assert found.story.headline.startswith("No effect in the catalogue explains the error of the reference's")
    assert extension.forecast is not None
    assert any(one.id.startswith("smooth.reference") for one in extension.forecast.settings)
    drawn = found.story.misfits[0]
    middle = np.interp(drawn.covariate, *drawn.curve.T)
    assert np.corrcoef(drawn.residual, middle)[0, 1] > 0.7


def test_where_a_chair_is_does_not_follow_the_errors_of_its_reference():
    """At rest above all: else a row that errs to the right would be found where rows err to the right."""
    rng = np.random.default_rng(2)
    t = 0.1 * np.arange(400)
    stamps = np.arange(0.0, 40.0, 0.1)
    v = np.where((stamps > 10) & (stamps < 20), 0.3, 0.0)
    x = np.clip(t - 10.0, 0.0, 10.0) * 0.3
    noise = 0.01 * rng.standard_normal((400, 3))
    command = Series(stamps, np.column_stack([v, 0 * v]), ("v", "w"))
    run = Run("run_1", command, pose=Series(t, np.column_stack([x, 0 * x, 0 * x]) + noise, ("x", "y", "theta")))
    drive = with_covariates(prepare(run, hidden.MODEL), run)
    known = np.interp(t, drive.start + GRID * (np.arange(len(drive.v)) + 0.5), drive.known["x"])
    rests = known[20:90]
    assert rests.std() < 0.004
    assert abs(np.corrcoef(rests, noise[20:90, 0])[0, 1]) < 0.5
    assert np.abs(known - x).max() < 0.03
