# SPDX-License-Identifier: BSD-3-Clause
"""What the map does not have is neither another laser's light nor tails of the noise, and bends no other effect."""

from dataclasses import replace

import numpy as np
import pytest
from laser_scene import recording

from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.critic.ranges.scans.gathering import gather
from kurumaisu.critic.ranges.scans.map_changes import map_change
from kurumaisu.critic.ranges.scans.passing_objects import passing_objects
from kurumaisu.critic.ranges.search.normal_equations import Assembly
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
BEARINGS = np.linspace(-1.5, 1.5, 300)
STEP = BEARINGS[1] - BEARINGS[0]
OBLIQUE = 0.8 * np.abs(BEARINGS)  # [rad] as beams meet the wall


def wall(scans=40):
    """Return readings (k, b) of a long wall 2 m to the side, seen along 4 m of way, and where they are."""
    rng = np.random.default_rng(1)
    ranges = np.broadcast_to(2.0 / np.cos(0.8 * BEARINGS), (scans, 300))
    along = np.linspace(0.0, 4.0, scans)[:, np.newaxis] + 2.0 * np.tan(0.8 * BEARINGS)
    hits = np.stack([along, np.full_like(along, 2.0)], axis=-1)
    return ranges + 0.005 * rng.standard_normal(ranges.shape), ranges, hits


@pytest.mark.parametrize(("off", "share", "expected"), [(0.9, 1.0, True), (0.2, 1.0, False), (0.9, 0.6, False)])
def test_a_part_of_a_wall_is_displaced_if_nearly_all_its_readings_are_far_off(off, share, expected):
    measured, ranges, hits = wall()
    part = (hits[:, :, 0] > 1.0) & (hits[:, :, 0] < 2.0)
    measured[part & (np.random.default_rng(2).random(part.shape) < share)] += off
    found = map_change(measured, ranges, hits, OBLIQUE)
    assert found.readings.any() == expected
    if expected:
        assert found.readings[part].all()
        assert found.off == pytest.approx(off, abs=0.01)
        first, second = found.unknowns()
        assert (first.covariate, second.covariate) == ("hit y", "hit x")
        assert "x 1 to 2 m" in first.shape


def test_where_most_readings_are_off_no_part_of_the_map_is_to_blame():
    measured, ranges, hits = wall()
    measured[hits[:, :, 0] > 1.0] += 0.9
    assert not map_change(measured, ranges, hits, OBLIQUE).readings.any()
    assert not map_change(np.full_like(ranges, np.nan), ranges, hits, OBLIQUE).readings.any()


@pytest.mark.parametrize(("nearer", "expected"), [(0.2, False), (0.5, True)])
def test_a_beam_along_a_wall_that_is_a_little_nearer_meets_it_much_earlier(nearer, expected):
    _, ranges, hits = wall()
    part = hits[:, :, 0] > 6.0  # where 0.2 m nearer is 0.28 m earlier and more
    measured = ranges * np.where(part, (2.0 - nearer) / 2.0, 1.0)
    assert map_change(measured, ranges, hits, OBLIQUE).readings.any() == expected


def person(measured, ranges, scans, width=20, depth=1.0):
    """Put something before the wall, at another bearing in each scan."""
    for k in range(scans):
        beams = slice(100 + 2 * k, 100 + 2 * k + width)
        measured[k, beams] = ranges[k, beams] - depth
    return measured


@pytest.mark.parametrize(
    ("width", "depth", "told"), [(20, 1.0, True), (2, 1.0, False), (20, 0.1, False), (150, 1.0, False)]
)
def test_what_stands_before_a_wall_is_as_wide_as_a_thing(width, depth, told):
    measured, ranges, _ = wall()
    found = passing_objects(person(measured, ranges, 30, width, depth), ranges, BEARINGS)
    assert found.many == told
    assert bool(list(found.unknowns())) == told
    if told:
        assert found.scans == 30
        assert found.readings[0, 100 : 100 + width].all()
        assert found.readings.mean() < 0.1


def test_a_pole_of_the_map_seen_a_little_aside_is_no_stranger():
    """A heading or stamp that is off has beams meet the neighbour's wall, as often a farther one as a nearer."""
    ranges = np.full((40, 300), 3.0)
    ranges[:, 100:130] = 1.5
    for shift in (6, -6):
        assert not passing_objects(np.roll(ranges, shift, axis=1), ranges, BEARINGS).readings.any()


def test_light_of_others_agrees_on_no_place():
    measured, ranges, _ = wall()
    rng = np.random.default_rng(3)
    lit = rng.random(measured.shape) < 0.2
    measured[lit] = rng.uniform(0.1, 2.0, int(lit.sum()))
    assert not passing_objects(measured, ranges, BEARINGS).many


def _with(data, change):
    run = data.runs[0]
    values = change(run.scan.values.copy())
    return replace(data, runs=(replace(run, scan=replace(run.scan, values=values)),))


def test_somebody_who_walks_by_is_unknown_and_is_not_taken_for_light_of_others(tmp_path):
    data = recording(tmp_path, "laser.mount_x", 0.05, 11, scans=30)

    def walks(values):
        for k in range(5, 25):
            beams = slice(150 + 10 * k, 185 + 10 * k)
            values[k, beams] = np.nanmin(values[k, beams]) - 0.5
        return values

    finding = criticise_scans(_with(data, walks), MODEL, lambda _: None)
    assert sorted(unknown.covariate for unknown in finding.unknown) == ["hit x", "hit y", "time"]
    assert {cause.id for cause in finding.causes} == {"laser.mount_x"}


def test_a_wall_that_is_not_where_the_map_has_it_is_unknown(tmp_path):
    data = recording(tmp_path, "laser.mount_x", 0.05, 12, scans=30)
    assembly = Assembly(gather(data, MODEL))
    hits, base = assembly.hits(), assembly.marks.base
    part = np.isfinite(base) & (hits[:, :, 0] > np.nanquantile(hits[:, :, 0], 0.93))
    assert assembly.mapped.all()

    def moved(values):
        values[: len(part)][part] += 0.8
        return values

    finding = criticise_scans(_with(data, moved), MODEL, lambda _: None)
    assert {unknown.covariate for unknown in finding.unknown} == {"hit x", "hit y"}
    assert {cause.id for cause in finding.causes} == {"laser.mount_x"}
