# SPDX-License-Identifier: BSD-3-Clause
"""Something that rides in a laser's way is neither tails nor another laser's light, and hides nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from laser_scene import recording

from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.critic.ranges.scans.map_changes import blocked_beams, described
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
BEAMS = slice(300, 340)


@pytest.mark.parametrize(
    ("reads", "walls", "expected"),
    [
        ("rides", "move", True),
        ("wall", "move", False),
        ("digit", "move", False),
        ("rides", "stay", False),
        ("few", "move", False),
    ],
)
def test_a_beam_is_blocked_if_it_reads_the_same_while_walls_come_and_go(reads, walls, expected):
    rng = np.random.default_rng(1)
    wall = {"move": rng.uniform(1.0, 3.0, (40, 1)), "stay": np.full((40, 1), 2.0)}[walls]
    noise = 0.003 * rng.standard_normal((40, 1))
    known = {"rides": 0.35 + noise, "wall": wall + noise, "digit": np.full((40, 1), 0.35)}.get(reads)
    measured = np.where(np.arange(40)[:, np.newaxis] < 5, 0.35 + noise, np.nan) if known is None else known
    assert blocked_beams(measured, wall).tolist() == [expected]


def test_readings_that_are_cut_off_are_nothing_that_rides_there():
    """Some walls are just before the end of what such a laser reads: not all of its readings are the same."""
    rng = np.random.default_rng(2)
    walls = rng.uniform(2.35, 3.5, (40, 200))
    walls[:, :100] = rng.uniform(1.0, 3.5, (40, 100))
    measured = np.round(np.minimum(walls + 0.002 * rng.standard_normal(walls.shape), 2.4), 3)
    assert np.mean(measured == 2.4) > 0.5
    assert not blocked_beams(measured, walls).any()


def test_where_beams_are_blocked_is_told_the_widest_first():
    beams = np.zeros(30, dtype=bool)
    beams[[2, 10, 11, 12]] = True
    (found,) = described(beams, np.full((3, 30), 0.4), np.linspace(-1.45, 1.45, 30))
    assert (found.channel, found.covariate) == ("laser.bias", "bearing")
    assert found.shape.startswith("beams from -0.45 to -0.25 rad read 0.4 m; beams from -1.25 to -1.25 rad")
    assert not list(described(np.zeros(30, dtype=bool), np.full((3, 30), 0.4), np.zeros(30)))


def test_what_rides_before_the_laser_is_unknown_and_hides_no_cause(tmp_path):
    data, rng = recording(tmp_path, "laser.dropout", 0.1, 11, scans=30), np.random.default_rng(3)
    run = data.runs[0]
    values = run.scan.values.copy()
    values[:, BEAMS] = np.round(0.35 + 0.003 * rng.standard_normal(values[:, BEAMS].shape), 3)
    data = replace(data, runs=(replace(run, scan=replace(run.scan, values=values)),))
    finding = criticise_scans(data, MODEL, lambda _: None)
    assert [unknown.covariate for unknown in finding.unknown] == ["bearing"]
    assert {cause.id for cause in finding.causes} == {"laser.dropout"}
