# SPDX-License-Identifier: BSD-3-Clause
"""Parameters with many likely values, and inputs that change between two points of the replay's grid."""

from dataclasses import replace

import numpy as np
import pytest

from kurumaisu.bench.hidden import Ask, make
from kurumaisu.bench.hidden.base import rates, recordings
from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.generator import motion
from kurumaisu.bench.hidden.generator.noise import USUAL
from kurumaisu.bench.hidden.oracle import noise_of
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.noise.base_noise import Noise
from kurumaisu.critic.search import search
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.effects import LATE
from kurumaisu.params import EffectSetting, load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
NOISE = Noise(position_sd=0.005, heading_sd=0.005, sd_v=0.01, sd_lateral=0.003, sd_w=0.02, tau=0.3)
STEP = "base.dac_quantisation"


def problem_of(seed, faults, ids, design="rich"):
    drives = recordings.draw_drives(design, USUAL, np.random.default_rng(seed), seconds=40.0, rate=10.0)
    data = recordings.recording("hidden", drives, faults)
    return Problem([prepare(run, MODEL) for run in data.runs], MODEL, NOISE, ids=frozenset(ids))


def problem_with(form, step, seed, cut=0.0, design="rich"):
    faults = [BASE[STEP].fault({"size": step, "cut": cut}, form)] if step else []
    return problem_of(seed, faults, {STEP}, design)


@pytest.mark.parametrize(("form", "phase"), [("plain", 0.0), ("other", 0.5)])
def test_a_converters_step_is_found_among_all_its_peaks(form, phase):
    problem = problem_with(form, 0.0367, 1)
    best = max((problem.fit_candidates([c], {}) for c in problem.candidates), key=lambda fit: fit.score)
    assert best.start[STEP, "step"] == pytest.approx(0.0367, rel=3e-3)
    assert best.start[STEP, "phase"] == phase
    assert best.start[STEP, "cut"] == 0.0
    assert best.score > problem.fit_candidates((), {}).score + 10


@pytest.mark.parametrize("step", [0.0156, 0.0391])
def test_what_a_converter_cuts_off_is_found_in_drives_by_a_stick(step):
    """A stick has hundreds of voltages: peaks are narrow, and hidden by the mean that is lost at any size."""
    problem = problem_with("other", step, 3, cut=1.0, design="stick")
    best = max((problem.fit_candidates([c], {}) for c in problem.candidates), key=lambda fit: fit.score)
    assert best.start[STEP, "step"] == pytest.approx(step, rel=5e-3)
    assert (best.start[STEP, "phase"], best.start[STEP, "cut"]) == (0.5, 1.0)


def test_without_steps_no_peak_is_worth_its_cost():
    problem = problem_with("plain", 0.0, 2)
    nothing = problem.fit_candidates((), {}).score
    fits = [problem.fit_candidates([candidate], {}) for candidate in problem.candidates]
    assert len(fits) == 5  # rounded, without a 0, cut, resting at 0 V, resting beyond a branch
    assert all(fit.score < nothing for fit in fits)


def test_steps_are_found_although_smooth_effects_together_draw_their_mean():
    """Beside all of them no peak stands out; beside the lag alone, one does."""
    case = make(Ask("pair"), 17110)
    smooth = ("lag_w", "curvature_w", "dac_zero_s")
    ids = frozenset((STEP, *(f"base.{name}" for name in smooth)))
    drives = [prepare(run, MODEL) for run in case.recording.runs]
    found = search.search(Problem(drives, MODEL, noise_of(case.known.regime), ids=ids), lambda _: None)
    assert found.best.ids == {STEP, "base.lag_w"} == set(case.truth.ids)
    assert found.best.start[STEP, "step"] == pytest.approx(case.truth.parameters[STEP]["step"], rel=3e-3)


def replayed(start, settings):
    """The way driven after a command of 0.6 m/s at a time within a step of the grid, of a chair without noise."""
    command = Series(np.array([0.0, start]), np.array([[0.0, 0.0], [0.6, 0.0]]), ("v", "w"))
    pose = Series(np.array([0.0, 1.0, 2.0, 3.0]), np.zeros((4, 3)), ("x", "y", "theta"))
    drive = prepare(Run("run", command=command, pose=pose), MODEL)
    return replay.path(drive, MODEL, settings)[-1, 0]


@pytest.mark.parametrize("start", [0.5, 0.5031, 0.5062, 0.5095])
@pytest.mark.parametrize("slowness", [1.0, 0.1, 0.015, 0.005])
def test_a_ramp_begins_when_its_command_does(start, slowness):
    """0.6 m/s at 1 m/s^2 is reached 0.6 s late, on a parabola: 0.18 m less; nothing of it hangs on the grid.

    A ramp that ends within a step, or in the next one, is no earlier either: else a delay seems to act.
    """
    ramp = (EffectSetting("base.accel_limit", {"slowness_v": slowness, "slowness_w": 0.0, "round": 0.0}),)
    assert replayed(start, ()) == pytest.approx(0.6 * (3.0 - start), abs=1e-9)
    assert replayed(start, ramp) == pytest.approx(0.6 * (3.0 - start) - 0.18 * slowness, abs=1e-6)


@pytest.mark.parametrize("start", [0.5, 0.5031, 0.5062, 0.5089])
def test_a_ramp_shorter_than_a_step_begins_when_its_command_does(start):
    """0.6 m/s at 200 m/s^2 is reached 3 ms late: 0.9 mm less."""
    ramp = (EffectSetting("base.accel_limit", {"slowness_v": 0.005, "slowness_w": 0.0, "round": 0.0}),)
    assert replayed(start, ramp) == pytest.approx(0.6 * (3.0 - start) - 0.0009, abs=1e-5)


def test_a_top_speed_that_only_the_fastest_drives_meet_is_found():
    """Half of the sizes of a grid with even steps would have no such drive, the others half of all drives."""
    drives = recordings.draw_drives("rich", USUAL, np.random.default_rng(4), seconds=40.0, rate=10.0)
    top = 0.97 * max(float(np.abs(setting.command[:, 1]).max()) for setting in drives.settings)
    fault = BASE["base.saturation"].fault({"size": 1 - top, "axis": 0.0, "top_v": 1.0, "top_w": 1.0}, "plain")
    data = recordings.recording("top", drives, [fault])
    problem = Problem([prepare(run, MODEL) for run in data.runs], MODEL, NOISE, ids=frozenset({"base.saturation"}))
    ahead = next(c for c in problem.candidates if [term.key[1] for term in c.terms] == ["inverse_v", "knee"])
    fit = problem.fit_candidates([ahead], {})
    assert fit.values[0] == pytest.approx(1 / top, rel=0.02)
    assert fit.score > problem.fit_candidates((), {}).score


@pytest.mark.parametrize(("form", "knee"), [("plain", 0.0), ("other", 0.1)])
def test_a_limit_with_a_round_corner_is_told_from_one_with_a_sharp_one(form, knee):
    """A parabola hides it, a power is fitted; else a curvature of the law stands beside the limit."""
    fault = BASE["base.saturation"].fault({"size": 0.3, "axis": 0.0, "top_v": 0.9, "top_w": 1.0}, form)
    found = search.search(problem_of(5, [fault], {"base.saturation", "base.curvature_v"}), lambda _: None)
    assert found.best.ids == {"base.saturation"}
    assert found.best.start["base.saturation", "knee"] == knee
    assert found.best.start["base.saturation", "inverse_v"] == pytest.approx(1 / 0.63, rel=0.05)
    assert found.p["base.curvature_v"] < 0.2


def jerk_limited(r, s):
    """Ramps whose slope itself comes and goes over `jerk` [s]: means over so long."""
    ramped = rates.accel_limit(r, s)
    count = round(s["jerk"] / motion.STEP)
    v, w = (
        np.convolve(np.pad(rate, (count - 1, 0)), np.full(count, 1 / count), "valid") for rate in (ramped.v, ramped.w)
    )
    return replace(ramped, v=v, w=w)


@pytest.mark.parametrize("seed", [6, 7])
@pytest.mark.parametrize("act", [rates.accel_limit, jerk_limited])
def test_a_ramp_with_round_corners_is_a_ramp_without_a_delay(act, seed):
    fault = motion.Fault(motion.Form("rates", act), {"size": 0.4, "ratio": 0.8, "jerk": 0.03})
    found = search.search(problem_of(seed, [fault], {"base.accel_limit", "base.delay"}), lambda _: None)
    assert found.named == ("base.accel_limit",)


def test_what_changes_within_a_step_is_known_and_rests_are_rests():
    t = np.round(np.arange(200) * 0.0333, 6)
    rates = np.column_stack([0.3 * (np.arange(200) % 3 == 0), 0.2 * (np.arange(200) % 4 == 0)])
    command = Series(t, rates, ("v", "w"))
    pose = Series(np.arange(0.0, 6.0, 0.1), np.zeros((60, 3)), ("x", "y", "theta"))
    drive = prepare(Run("run", command=command, pose=pose), MODEL)
    edges = drive.start + 0.01 * np.arange(len(drive.v) + 1)
    for low, high, share, v, w in zip(edges[:-1], edges[1:], drive.known[LATE], drive.v, drive.w, strict=True):
        before = np.searchsorted(t, low + 1e-9, side="right") - 1
        inside = (t > low + 1e-9) & (t < high - 1e-9)
        if not inside.any():
            assert share == pytest.approx(0.0, abs=1e-6)
            assert (v, w) == tuple(pytest.approx(rate, abs=1e-12) for rate in rates[before])
            assert (v == 0) == (rates[before, 0] == 0)
            assert (w == 0) == (rates[before, 1] == 0)
        elif (rates[np.flatnonzero(inside)[0]] != rates[before]).any():
            assert share == pytest.approx((t[inside][0] - low) / 0.01, abs=1e-6)


def steps_beside(step, cut, **others):
    """Return a problem of a converter's steps beside smooth effects, and the candidates that hide in it."""
    sizes = {STEP: {"size": step, "cut": cut}, **{f"base.{name}": {"size": size} for name, size in others.items()}}
    problem = problem_of(5, [BASE[name].fault(of, "other") for name, of in sizes.items()], sizes)
    form = {"phase": 0.5, "cut": cut, "rests": 0.0}
    rough = [
        one
        for one in problem.candidates
        if one.id == STEP and {term.key[1]: term.parameter.lower for term in one.terms if term.fixed} == form
    ]
    return problem, rough + [one for one in problem.candidates if one.id != STEP and one.usual]


def test_a_fit_goes_on_to_the_likeliest_peak_close_by():
    problem, chosen = steps_beside(0.02726, 1.0, gain_v=0.05, cross_w_to_v=-0.1)
    fits = [problem.fit_candidates(chosen, {(STEP, "step"): 0.02726 * off}) for off in (0.998, 1.0)]
    near, true = (fit.log_likelihood - fit.beside.nats for fit in fits)  # by the equations alone
    assert near > true - 0.5


def test_a_peak_is_sought_anew_beside_what_was_found_since():
    problem, chosen = steps_beside(0.0523, 1.0, cross_v_to_w=0.03, cross_w_to_v=-0.06)
    stuck = problem.fit_candidates(chosen, {(STEP, "step"): 0.06})
    assert stuck.start[STEP, "step"] != pytest.approx(0.0523, rel=5e-3)
    assert search.search(problem, lambda _: None).best.start[STEP, "step"] == pytest.approx(0.0523, rel=2e-3)


@pytest.mark.parametrize(("step", "cut"), [(0.0523, 0.0), (0.0523, 1.0), (0.007, 1.0)])
def test_edges_that_held_voltages_cross_do_not_use_up_the_sizes(step, cut):
    """However close two sizes are, a voltage that is held for long may be rounded to one side, then to the other.

    And what cuts off shows at smaller sizes than what rounds, by which the smallest were chosen.
    """
    problem, chosen = steps_beside(step, cut)
    rough = next(candidate for candidate in chosen if candidate.id == STEP)
    begin = problem.start_values.first(rough.terms, {})
    assert begin[[term.key for term in rough.terms].index((STEP, "step"))] == pytest.approx(step, rel=5e-3)
