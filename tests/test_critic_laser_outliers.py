# SPDX-License-Identifier: BSD-3-Clause
"""Readings that are something else: anywhere and at any time they are tails, in bursts another laser's light."""

from dataclasses import replace

import numpy as np
import pytest
from laser_scene import recording

from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.critic.ranges.noise.reading_noise import expected_readings
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
IDS = frozenset({"laser.heavy_tails", "laser.crosstalk", "laser.mixed_pixels", "laser.range_noise"})


def anywhere(rng, scan):
    """One reading of fifty is off by up to a metre, whatever the beam and the scan."""
    wild = rng.random(scan.values.shape) < 0.02
    return scan.values + np.where(wild, rng.uniform(-1, 1, scan.values.shape), 0.0)


def rare(rng, scan):
    """One reading of two hundred is anything from 0.06 to 4 m, whatever the beam and the scan."""
    wild = rng.random(scan.values.shape) < 0.005
    return np.where(wild, rng.uniform(0.06, 4, scan.values.shape), scan.values)


def in_bursts(rng, scan):
    """A fifth of the readings of some hundred neighbours, others from scan to scan, are anything from 0.1 to 4 m."""
    beams = np.arange(scan.values.shape[1])
    start = rng.integers(0, len(beams), len(scan.t))[:, np.newaxis]
    hit = (np.abs(beams - start) < 50) & (rng.random(scan.values.shape) < 0.2)
    return np.where(hit, rng.uniform(0.1, 4, scan.values.shape), scan.values)


@pytest.mark.parametrize(
    ("spoil", "name"),
    [(anywhere, "laser.heavy_tails"), (rare, "laser.heavy_tails"), (in_bursts, "laser.crosstalk")],
)
def test_outliers_anywhere_are_tails_and_bursts_are_crosstalk(tmp_path, spoil, name):
    told, rng = recording(tmp_path, None, 0.0, 6, scans=30), np.random.default_rng(12)
    runs = tuple(replace(run, scan=replace(run.scan, values=np.round(spoil(rng, run.scan), 3))) for run in told.runs)
    finding = criticise_scans(replace(told, runs=runs), MODEL, lambda _: None, IDS)
    assert [cause.id for cause in finding.causes] == [name]
    assert not finding.confounded


def test_a_burst_is_not_bent_to_do_what_beams_lose(tmp_path):
    """Alone, bursts that reach next to nothing do for both; they must be begun anew where losses are known."""
    told, rng = recording(tmp_path, "laser.dropout", 0.04, 6, scans=30), np.random.default_rng(11)
    runs = tuple(
        replace(
            run,
            scan=replace(
                run.scan,
                values=np.where(np.isnan(run.scan.values), np.nan, np.round(in_bursts(rng, run.scan), 3)),
            ),
        )
        for run in told.runs
    )
    finding = criticise_scans(replace(told, runs=runs), MODEL, lambda _: None, IDS | {"laser.dropout"})
    causes = {cause.id: cause.parameters for cause in finding.causes}
    assert set(causes) == {"laser.crosstalk", "laser.dropout"}
    assert causes["laser.dropout"]["probability"].estimate == pytest.approx(0.04, rel=0.3)


def test_a_cut_off_just_inside_the_range_is_saturation(tmp_path):
    """No reading that is trusted comes within 0.1 m of the laser's 4 m, and no usual size is near."""
    told = recording(tmp_path, None, 0.0, 6, scans=30)
    runs = tuple(
        replace(
            run,
            scan=replace(run.scan, values=np.where(run.scan.values < 4.0, np.minimum(run.scan.values, 3.96), np.inf)),
        )
        for run in told.runs
    )
    finding = criticise_scans(replace(told, runs=runs), MODEL, lambda _: None, IDS | {"laser.saturation"})
    assert [cause.id for cause in finding.causes] == ["laser.saturation"]
    assert finding.causes[0].parameters["inverse_far"].estimate == pytest.approx(1 / 3.96, rel=0.002)


@pytest.mark.parametrize(("end", "lost"), [(3.2, False), (3.2, True), (3.95, True)])
def test_a_laser_that_sees_less_far_is_saturation(tmp_path, end, lost):
    """Walls beyond have no reading, or are read where it ends, as far off as any reading."""
    data = recording(tmp_path, None, 0.0, 7, scans=30)
    (run,) = data.runs
    noise = 0.003 * np.random.default_rng(7).standard_normal(run.scan.values.shape)
    beyond = np.isfinite(run.scan.values) & (run.scan.values > end)
    there = np.where(beyond, np.inf if lost else np.round(end + noise, 3), run.scan.values)
    seen = replace(data, runs=(replace(run, scan=replace(run.scan, values=there)),))
    finding = criticise_scans(seen, MODEL, lambda _: None, IDS | {"laser.saturation"})
    assert [cause.id for cause in finding.causes] == ["laser.saturation"]
    assert finding.causes[0].parameters["inverse_far"].estimate == pytest.approx(1 / end, rel=0.005)
    (setting,) = [one for one in finding.settings if one.id == "laser.saturation"]
    assert setting.parameters["lost"] == float(lost)


def test_readings_are_expected_from_where_a_scan_puts_its_reference():
    """The second scan's reference is so far off that most readings are, by the first guess; one meets something."""
    rng, beams = np.random.default_rng(3), np.linspace(-1, 1, 100)
    z = rng.standard_normal((2, 100))
    moved = np.stack([0.1 * beams, 80.0 * beams])
    z[1] += moved[1]
    z[:, 7] = 1000.0
    known = np.ones(z.shape, dtype=bool)
    known[:, 0] = False
    start, inside = expected_readings(z, known, 2.0 + 0 * z, moved)
    np.testing.assert_array_equal(start, [0 * beams, moved[1]])
    expected = known.copy()
    expected[:, 7] = False
    np.testing.assert_array_equal(inside, expected)
