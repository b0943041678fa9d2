# SPDX-License-Identifier: BSD-3-Clause
"""What changes from run to run follows the time since the first one began, whatever the clocks of the runs."""

import re
from dataclasses import replace

import numpy as np
import pytest

from kurumaisu.bench.hidden.base import recordings
from kurumaisu.bench.hidden.generator.motion import Fault, Form
from kurumaisu.bench.hidden.generator.noise import USUAL
from kurumaisu.critic import pipeline
from kurumaisu.critic.data.excerpt import with_elapsed_time
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.params import shipped

MODEL = shipped("launch/md100.yaml")
SPAN = 40.0  # [s] of a run
LOSS = 0.001  # [1/s]


def run_at(name, start, end, **columns):
    times = np.array([start, end])
    extra = {key: Series(times, np.array([[value], [value]]), (key,)) for key, value in columns.items()}
    return Run(name, command=Series(times, np.zeros((2, 2)), ("v", "w")), covariates=extra)


def times_of(*runs, train=("a", "b")):
    """Return the recording time at the start and end of each run."""
    told = with_elapsed_time(Recording("r", runs, train=train))
    return [run.covariates["recording_time"].values[:, 0].tolist() for run in told.runs]


def test_runs_whose_clocks_begin_anew_follow_each_other_without_a_break():
    assert times_of(run_at("a", 0.0, 10.0), run_at("b", 1.0, 5.0), run_at("c", 0.0, 2.0)) == [
        [0, 10],
        [10, 14],
        [14, 16],
    ]


def test_stamps_that_go_on_tell_the_breaks():
    day = 1.7e9
    runs = run_at("a", day, day + 10.0), run_at("b", day + 60.0, day + 65.0)
    assert times_of(*runs) == [[0, 10], [60, 65]]


def test_one_run_and_what_was_measured_and_runs_without_times_are_left_alone():
    one = Recording("r", (run_at("a", 0.0, 10.0), run_at("t", 0.0, 3.0)), train=("a",), test=("t",))
    assert with_elapsed_time(one) is one
    own = Recording("r", (run_at("a", 0.0, 1.0, recording_time=7.0), run_at("b", 0.0, 1.0)), train=("a", "b"))
    assert with_elapsed_time(own) is own
    empty = Recording("r", (run_at("a", 0.0, 1.0), Run("b")), train=("a", "b"))
    assert with_elapsed_time(empty) is empty


def criticised(change):
    """Return the verdict about runs with restarting clocks, rates changed by the time since the first one began."""
    rng = np.random.default_rng(3)
    drives = recordings.draw_drives("rich", USUAL, rng, seconds=SPAN, rate=10.0)
    runs = []
    for i, (setting, error) in enumerate(zip(drives.settings, drives.errors, strict=True)):
        fault = Fault(Form("floor", lambda r, _, begun=i * SPAN: change(r, r.t + begun)), {})
        only = replace(drives, settings=(setting,), errors=(error,))
        runs.append(replace(recordings.recording("one", only, [fault]).runs[0], name=f"run_{i + 1}"))
    names = tuple(run.name for run in runs)
    return pipeline.criticise(Recording("through", tuple(runs), train=names), MODEL, lambda _: None).verdict


def test_a_battery_that_serves_all_runs_is_named():
    verdict = criticised(lambda r, t: replace(r, v=r.v * (1 - LOSS * t), w=r.w * (1 - LOSS * t)))
    assert [cause.id for cause in verdict.causes] == ["base.battery_sag"]
    told = verdict.causes[0].parameters
    assert told["through"].estimate == 1.0
    assert told["sag"].lo90 < LOSS < told["sag"].hi90


def test_what_is_otherwise_from_a_moment_on_is_no_matter_of_place():
    verdict = criticised(lambda r, t: replace(r, v=np.where(t > 1.5 * SPAN, 0.88, 1.0) * r.v))
    assert [(one.channel, one.covariate) for one in verdict.unknown] == [("base.v", "recording_time")]
    assert not verdict.causes


def test_a_clock_that_runs_on_from_run_to_run_is_named():
    """By the last run the reference is a tenth of a second early: before what was asked of the chair."""
    rng = np.random.default_rng(4)
    recording = recordings.recording("clocks", recordings.draw_drives("rich", USUAL, rng, seconds=SPAN, rate=10.0), [])
    scale, runs = -4e-4, []
    for i, run in enumerate(recording.runs):
        begun = 100.0 * i
        moved = {
            part: replace(series, t=(series.t + begun) * (1 + scale * (part == "pose")))
            for part in ("command", "voltage", "pose")
            if (series := getattr(run, part)) is not None
        }
        runs.append(replace(run, **moved))
    verdict = pipeline.criticise(replace(recording, runs=tuple(runs)), MODEL, lambda _: None).verdict
    assert [cause.id for cause in verdict.causes] == ["base.clock_scale"]
    told = verdict.causes[0].parameters
    assert told["through"].estimate == 1.0
    assert told["scale"].estimate == pytest.approx(scale, rel=0.15)


def test_a_caster_that_wobbles_with_the_way_is_told_by_its_girth():
    def wobble(r, _):
        way = np.cumsum(np.abs(r.v)) * float(np.median(np.diff(r.t)))
        return replace(r, w=r.w + np.where(r.v != 0, 0.03 * np.sin(2 * np.pi * way / 1.1), 0.0))

    verdict = criticised(wobble)
    assert [(one.channel, one.covariate) for one in verdict.unknown] == [("base.w", "distance")]
    told = re.match(r"periodic, period (\S+) m", verdict.unknown[0].shape)
    assert told is not None
    assert float(told[1]) == pytest.approx(1.1, rel=0.05)
    assert not verdict.causes
