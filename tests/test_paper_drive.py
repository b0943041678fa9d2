# SPDX-License-Identifier: BSD-3-Clause
"""Equations (1), (2) from drives: lines against SciPy's ODR, intervals, what is refused, the file that is written."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from scipy import odr, stats

from kurumaisu.bench.paper import drive as bench
from kurumaisu.critic.data.csv_reader import read_csv_run
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.errors import Error
from kurumaisu.experiments import load_script, nominal_path
from kurumaisu.paper.chair import drive, identify, law, law_file, lines
from kurumaisu.paper.chair.samples import samples_of
from kurumaisu.paper.options import load_options
from kurumaisu.params import load_model, shipped
from kurumaisu.ros.paper.command import main

OPTIONS = load_options()
MODEL = shipped("launch/md100.yaml")


def silent(_):
    pass


def recording(run, truth=(0.005, 0.005)):
    return Recording("drive", (run,), train=(run.name,), truth=truth)


def cloud(seed, n=60, sd_x=0.03, sd_y=0.02):
    rng = np.random.default_rng(seed)
    true = rng.uniform(0.1, 0.8, n)
    return true + sd_x * rng.standard_normal(n), 1.3 * true + 0.13 + sd_y * rng.standard_normal(n)


# Lines


@pytest.mark.parametrize(("sd_x", "sd_y"), [(0.03, 0.02), (0.05, 0.001), (0.001, 0.05)])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_errors_in_both_are_those_of_odrpack(sd_x, sd_y, way):
    x, y = cloud(1, sd_x=sd_x, sd_y=sd_y)
    ours = lines.deming(x, way * y, np.ones(len(x)), (sd_y / sd_x) ** 2)
    fit = odr.ODR(odr.RealData(x, way * y, sx=sd_x, sy=sd_y), odr.unilinear, beta0=[way, 0.0], maxit=500).run()
    assert float(ours.slope) == pytest.approx(fit.beta[0], rel=1e-5)
    assert float(ours.intercept) == pytest.approx(fit.beta[1], abs=1e-5)


def test_the_ends_of_deming_are_the_two_regressions():
    x, y = cloud(2)
    ones = np.ones(len(x))
    on_y = stats.linregress(y, x)
    assert float(lines.deming(x, y, ones, 0.0).slope) == pytest.approx(1 / on_y.slope)
    assert float(lines.deming(x, y, ones, 1e12).slope) == pytest.approx(stats.linregress(x, y).slope, rel=1e-6)
    assert float(lines.least_squares(x, y, ones).intercept) == pytest.approx(stats.linregress(x, y).intercept)


def test_many_weights_at_once_are_each_by_itself():
    x, y = cloud(3)
    counts = lines.block_counts(np.arange(60) // 5, 7, np.random.default_rng(4))
    together = lines.robust(x, y, counts, 0.005)
    for k, row in enumerate(counts):
        # a point that was drawn twice is two points
        again = np.repeat(np.arange(60), row.astype(int))
        alone = lines.robust(x[again], y[again], np.ones(len(again)), 0.005)
        assert together.slope[k] == pytest.approx(float(alone.slope), rel=0.01)  # their medians may be a rank apart


def test_least_squares_is_drawn_to_noise_in_the_rate_and_errors_in_both_are_not():
    """The bias of the paper's way: with noise in x, a line through it is too flat by var / (var + noise)."""
    slopes = []
    for seed in range(200):
        x, y = cloud(seed, n=200, sd_x=0.1, sd_y=0.002)
        ones = np.ones(len(x))
        slopes.append(
            [float(line.slope) for line in (lines.least_squares(x, y, ones), lines.robust(x, y, ones, 0.002))]
        )
    plain, both = np.mean(slopes, axis=0)
    spread = (0.7**2) / 12
    assert plain == pytest.approx(1.3 * spread / (spread + 0.01), rel=0.01)
    assert both == pytest.approx(1.3, rel=0.01)


def test_a_far_point_moves_a_robust_line_little():
    x, y = cloud(5, sd_x=0.01, sd_y=0.002)
    ones = np.ones(len(x))
    before = lines.robust(x, y, ones, 0.002)
    worst = x.copy()
    worst[np.argmax(y)] -= 0.6
    assert abs(float(lines.robust(worst, y, ones, 0.002).slope - before.slope)) < 0.02
    assert abs(float(lines.deming(worst, y, ones, 0.0).slope - before.slope)) > 0.1


# Samples


def test_samples_of_an_arc_are_exact():
    t = np.arange(0, 10.01, 0.1)
    v, w = 0.6, -0.5
    heading = 0.3 + w * t
    x, y = v / w * (np.sin(heading) - np.sin(0.3)), -v / w * (np.cos(heading) - np.cos(0.3))
    volts = Series(np.array([0.0, 10.0]), np.array([[0.9, 0.4], [0.9, 0.4]]), ("v_f", "v_s"))
    run = Run("arc", voltage=volts, pose=Series(t, np.column_stack([x, y, heading]), ("x", "y", "theta")))
    found = samples_of([run], (0.005, 0.005), OPTIONS.drive)
    assert len(found) == 10
    np.testing.assert_allclose(found.v, v, rtol=1e-9)
    np.testing.assert_allclose(found.w, w, rtol=1e-9)
    np.testing.assert_allclose(found.v_f, 0.9, rtol=1e-12)
    assert found.steady.all()
    # sd of the slope of 11 points 0.1 s apart
    np.testing.assert_allclose(found.sd_w, 0.005 / np.sqrt(0.01 * 110), rtol=1e-6)


def test_a_voltage_that_grows_is_averaged_as_the_rate_is():
    """w follows V exactly, w = V, while V ramps: the sample must lie on that line to rounding."""
    t = np.arange(0, 4.001, 0.05)
    held = 0.03 * t
    heading = np.concatenate([[0.0], np.cumsum(held[:-1] * 0.05)])
    zeros = np.zeros(len(t))
    run = Run(
        "ramp",
        voltage=Series(t, np.column_stack([zeros, held]), ("v_f", "v_s")),
        pose=Series(t, np.column_stack([zeros, zeros, heading]), ("x", "y", "theta")),
    )
    found = samples_of([run], (0.005, 0.005), OPTIONS.drive)
    np.testing.assert_allclose(found.w, found.v_s, atol=1e-12)
    assert np.ptp(found.w) > 0.05


def test_the_references_error_is_found_where_nobody_tells_it():
    run = bench.make(replace(bench.CASES[0], pose_sd=0.02), np.random.default_rng(1))
    told = samples_of([run], (0.02, 0.02), OPTIONS.drive)
    guessed = samples_of([run], None, OPTIONS.drive)
    np.testing.assert_allclose(guessed.sd_w, told.sd_w, rtol=0.15)


def test_what_is_missing_is_named():
    run = bench.make(bench.CASES[0], np.random.default_rng(1))
    with pytest.raises(Error, match="usual: needs voltages and reference poses; it has no pose"):
        samples_of([replace(run, pose=None)], None, OPTIONS.drive)
    late = Series(run.pose.t + 1000.0, run.pose.values, run.pose.columns)
    with pytest.raises(Error, match="no 1 s of voltages and poses together"):
        samples_of([replace(run, pose=late)], None, OPTIONS.drive)


# Identification: data by code that shares nothing with the simulator


@pytest.mark.parametrize("case", bench.CASES, ids=lambda case: case.name)
def test_a_drive_gives_the_published_law_back(case):
    judged = bench.judge(case, 7, OPTIONS)
    assert judged.refused == 0
    assert len(judged.held) == 8
    assert max(np.abs(judged.error)) < 3  # half widths: five standard errors


def test_intervals_hold_the_truth_as_often_as_they_say():
    """320 coefficients, not independent: 40 drives of four. Binomial 99.9 % bounds for 160 draws of 0.90."""
    few = replace(OPTIONS, bootstrap=replace(OPTIONS.bootstrap, resamples=199))
    held = np.concatenate([bench.judge(bench.CASES[0], 100 + n, few).held for n in range(40)])
    low, high = stats.binom.ppf([0.0005, 0.9995], 160, 0.90) / 160
    assert low <= held.mean() <= high


def test_least_squares_of_the_paper_is_beside_it():
    run = bench.make(bench.CASES[0], np.random.default_rng(3))
    found = identify.identify(recording(run), OPTIONS, silent)
    for fit in found.fits:
        for branch in (fit.positive, fit.negative):
            assert branch.paper.slope == pytest.approx(branch.slope.value, rel=0.03)


def driven(v, w):
    """Return a drive of rates (n,) held for 4 s each."""
    case = bench.CASES[0]
    rng = np.random.default_rng(9)
    rows = np.repeat(np.column_stack([v, w]), 200, axis=0)
    volts = np.column_stack([bench._volts(rows[:, 0], bench.TRANSLATION), bench._volts(rows[:, 1], case.steering)])
    rates = [
        np.repeat(rows[:, i], 20) + bench._wander(20 * len(rows), sd, 0.3, rng) for i, sd in ((0, 0.01), (1, 0.02))
    ]
    poses = bench._path(*rates)[::100]
    t = 0.1 * np.arange(len(poses))
    values = np.column_stack([volts, rows])
    return Run(
        "driven",
        voltage=Series(0.02 * np.arange(len(rows)), values, ("v_f", "v_s", "v", "w")),
        pose=Series(t, poses + 0.005 * rng.standard_normal(poses.shape), ("x", "y", "theta")),
    )


def test_what_a_drive_cannot_determine_is_refused_with_a_reason():
    ahead = driven(np.tile([0.2, 0.4, 0.6], 8), np.tile([0.5, -0.5, 0.5, -0.5], 6))
    found = identify.identify(recording(ahead), OPTIONS, silent)
    told = dict(why.split(": ", 1) for why in found.refused)
    assert set(told) == {"translation.negative", "steering.positive", "steering.negative"}
    assert told["translation.negative"] == "0 stretches of steady motion to this side, 8 are needed"
    # one yaw rate: a slope through a heap of points
    assert "are from -0.145 to -0.145 V: slope and intercept cannot be told apart" in told["steering.positive"]


def test_a_slope_that_is_poorly_known_is_refused():
    near = driven(np.tile([0.4, -0.4], 20), np.tile([0.4, -0.4, 0.45, -0.45, 0.68, -0.68], 7)[:40])
    noisy = replace(
        near.pose, values=near.pose.values + 0.1 * np.random.default_rng(1).standard_normal((len(near.pose.t), 3))
    )
    found = identify.identify(recording(replace(near, pose=noisy), None), OPTIONS, silent)
    told = dict(why.split(": ", 1) for why in found.refused)
    assert "% only: rates from 0." in told["steering.positive"]


def test_no_law_is_written_of_what_is_refused_unless_it_is_kept():
    ahead = driven(np.tile([0.2, 0.4, 0.6], 8), np.tile([0.2, -0.3, 0.5, -0.6, 0.8, -0.9], 4))
    found = identify.identify(recording(ahead), OPTIONS, silent)
    with pytest.raises(Error, match=r"translation\.negative: 0 stretches .* --keep translation\.negative"):
        law_file.settled(MODEL, found.fits, [])
    laws = law_file.settled(MODEL, found.fits, ["translation.negative"])
    assert laws["translation"].negative.slope == 2.07369
    assert laws["translation"].positive.slope != 1.32402
    with pytest.raises(Error, match=r"--keep sideways: there are: translation\.positive"):
        law_file.settled(MODEL, found.fits, ["sideways"])


def test_wrong_data_are_refused_unless_they_are_of_what_is_not_looked_at():
    run = bench.make(bench.CASES[0], np.random.default_rng(1))
    whole = recording(run)
    for words in ("a.bag experiment_vel: repeats its rows: drop the copies", "drive/command.csv: goes back in time"):
        assert identify.identify(replace(whole, invalid=(words,)), OPTIONS, silent).refused == []
    with pytest.raises(Error, match=r"drive: a\.bag voltages: repeats its rows"):
        identify.identify(replace(whole, invalid=("a.bag voltages: repeats its rows",)), OPTIONS, silent)


def test_a_drive_of_bends_to_one_side_only_is_told_to_mix():
    v = np.tile([0.2, -0.2, 0.4, -0.4, 0.6, -0.6], 6)
    found = identify.identify(recording(driven(v, v)), OPTIONS, silent)
    assert any("are correlated" in words for words in found.warnings)


def test_a_straight_law_without_any_noise_is_straight():
    """Only rounding is left, which is far more than nothing."""
    rng = np.random.default_rng(1)
    run = bench.make(replace(bench.CASES[0], sd_v=1e-12, sd_w=1e-12, pose_sd=0.0), rng)
    found = identify.identify(recording(run), OPTIONS, silent)
    assert not found.refused
    assert not any("is not straight" in words for words in found.warnings)


def test_a_bent_law_is_told():
    run = driven(np.tile([0.1, -0.1, 0.4, -0.4, 0.7, -0.7], 6), np.tile([0.3, -0.6, 0.9, -0.3, 0.6, -0.9, 0.0], 6)[:36])
    bent = run.voltage.values.copy()
    bent[:, 0] += 0.8 * np.sign(bent[:, 0]) * (np.abs(run.voltage.values[:, 2]) - 0.4) ** 2
    found = identify.identify(recording(replace(run, voltage=replace(run.voltage, values=bent))), OPTIONS, silent)
    assert any("translation.positive is not straight" in words for words in found.warnings)
    straight = identify.identify(recording(run), OPTIONS, silent)
    assert not any("straight" in words for words in straight.warnings)


# Files


def test_the_written_model_is_the_one_that_was_found(tmp_path):
    run = bench.make(bench.CASES[1], np.random.default_rng(5))
    found = identify.identify(recording(run), OPTIONS, silent)
    laws = law_file.settled(MODEL, found.fits, [])
    law_file.write_law(MODEL, found.fits, laws, ["where it comes from"], tmp_path / "chair.yaml")
    model = load_model(tmp_path / "chair.yaml")
    assert model.law_name == "custom"
    assert model.steering.negative.slope == pytest.approx(found.fits[1].negative.slope.value, abs=1e-6)
    new, old = (yaml.safe_load(path.read_text()) for path in (tmp_path / "chair.yaml", MODEL))
    assert new["voltage_laws"].pop("custom") != old["voltage_laws"].pop("custom")
    new["voltage_law"] = old["voltage_law"]
    assert new == old
    text = (tmp_path / "chair.yaml").read_text()
    assert text.startswith("# where it comes from\n")
    assert "interval" not in text.split("\n")[0]
    assert text.count("# slope ") == 4
    assert not law.overlaps(model.steering)
    # once more, over what was written
    law_file.write_law(tmp_path / "chair.yaml", found.fits, laws, ["again"], tmp_path / "twice.yaml")
    assert yaml.safe_load((tmp_path / "twice.yaml").read_text()) == yaml.safe_load(
        (tmp_path / "chair.yaml").read_text()
    )


@pytest.mark.parametrize("name", [drive.IDENTIFICATION, drive.HELD_OUT])
def test_drives_excite_both_rates_and_not_together(name):
    rows = np.array([phase.target for phase in load_script(shipped(name)).phases])
    assert abs(np.corrcoef(rows.T)[0, 1]) < 0.1
    for column in rows.T:
        for side in (1, -1):
            assert len(np.unique(column[side * column > 0])) >= 4
    script = load_script(shipped(name))
    assert script.box.excess(nominal_path(script.phases)).max() < -0.5  # room for a chair that is not yet known


def test_paper_drive_writes_figures_data_and_a_law_twice_the_same(tmp_path, capsys):
    """On the package's own simulator; the second time from the recording's own files."""
    from kurumaisu.critic.experiment.rehearse import write

    first = drive.recorded(drive.uneven(load_model(MODEL)), drive.HELD_OUT, 1)
    write(tmp_path / "drive", first)
    assert read_csv_run(tmp_path / "drive" / "held_out", "held_out", []).pose is not None
    for out in ("a", "b"):
        assert main(["drive", str(tmp_path / "drive"), "--out", str(tmp_path / out)]) == 0
    assert "reference pose: measured" in capsys.readouterr().out
    names = sorted(path.name for path in (tmp_path / "a").iterdir())
    assert names == ["chair.yaml", "equations_1_2.csv", "equations_1_2.txt", "figures_3_to_6.csv", "figures_3_to_6.svg"]
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_a_recording_that_is_not_there_is_named(tmp_path, capsys):
    assert main(["drive", str(tmp_path / "none.bag"), "--out", str(tmp_path / "out")]) == 1
    assert "none.bag: there is no such file" in capsys.readouterr().err
