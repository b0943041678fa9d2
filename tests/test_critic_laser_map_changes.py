# SPDX-License-Identifier: BSD-3-Clause
"""What the map does not have is neither another laser's light nor tails of the noise, and bends no other effect."""

from dataclasses import replace

import numpy as np
import pytest
from laser_scene import recording, sparse

from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.critic.ranges.scans.gathering import gather
from kurumaisu.critic.ranges.scans.map_changes import Sights, map_change, passing_objects
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


def sights(measured, ranges):
    """Return what is seen from the way along wall(), looking at it."""
    scans = len(ranges)
    poses = np.column_stack([np.linspace(4.0, 0.0, scans), np.zeros(scans), np.full(scans, np.pi / 2)])
    return Sights(measured, ranges, 0.8 * BEARINGS, poses)


@pytest.mark.parametrize(
    ("width", "depth", "told"), [(20, 1.0, True), (2, 1.0, False), (20, 0.1, False), (150, 1.0, False)]
)
def test_what_stands_before_a_wall_is_as_wide_as_a_thing(width, depth, told):
    measured, ranges, _ = wall()
    found = passing_objects(sights(person(measured, ranges, 30, width, depth), ranges))
    assert found.many == told
    if told:
        assert len(found.scans) == 30
        assert found.readings[0, 100 : 100 + width].all()
        assert found.readings.mean() < 0.1
        assert "in 30 of 40 scans" in found.words


def test_where_the_map_has_nothing_of_what_is_seen_it_is_unknown():
    measured, ranges, _ = wall()
    few = passing_objects(sights(person(measured.copy(), ranges, 30), ranges))
    assert few.many
    assert not list(few.unknowns())
    for first in (0, 60, 120, 180, 240):
        measured[:, first : first + 20] = ranges[:, first : first + 20] - 1.0
    most = passing_objects(sights(measured, ranges))
    assert [each.covariate for each in most.unknowns()] == ["time", "hit x", "hit y"]


def pole(at, width):
    """Return readings of a room's far wall with a pole before it, and what the map says without it."""
    rng, scans = np.random.default_rng(4), 40
    ranges = np.full((scans, 300), 5.0)
    measured = ranges + 0.003 * rng.standard_normal(ranges.shape)
    view = sights(measured, ranges)
    offset = at - view.poses[:, :2]
    bearing = np.arctan2(offset[:, 1], offset[:, 0]) - view.poses[:, 2]
    distance = np.hypot(*offset.T)
    met = np.abs(view.bearings - bearing[:, np.newaxis]) < width / 2 / distance[:, np.newaxis]
    measured[met] = (np.broadcast_to(distance[:, np.newaxis], met.shape) + 0.003 * rng.standard_normal(met.shape))[met]
    return view, met


@pytest.mark.parametrize("width", [0.05, 0.3])
def test_what_stands_at_a_place_is_set_aside_however_few_beams_meet_it(width):
    """A pole of 5 cm is met by two or three beams of a scan, fewer than agree on a person."""
    view, met = pole(np.array([2.0, 2.5]), width)
    found = passing_objects(view)
    assert found.readings[met].mean() > 0.95
    assert found.readings.mean() < met.mean() + 0.03
    assert found.place == pytest.approx([2.0, 2.5], abs=0.1)


def test_a_pole_of_the_map_seen_a_little_aside_is_no_stranger():
    """A heading or stamp that is off has beams meet the neighbour's wall, as often a farther one as a nearer."""
    ranges = np.full((40, 300), 3.0)
    ranges[:, 100:130] = 1.5
    for shift in (6, -6):
        assert not passing_objects(sights(np.roll(ranges, shift, axis=1), ranges)).readings.any()


def test_light_of_others_agrees_on_no_place():
    measured, ranges, _ = wall()
    rng = np.random.default_rng(3)
    lit = rng.random(measured.shape) < 0.2
    measured[lit] = rng.uniform(0.1, 2.0, int(lit.sum()))
    assert not passing_objects(sights(measured, ranges)).many


def _with(data, change):
    run = data.runs[0]
    values = change(run.scan.values.copy())
    return replace(data, runs=(replace(run, scan=replace(run.scan, values=values)),))


def walker(beams, nearer):
    """Return what puts somebody before the walls in some scans, so many beams wide and so much [m] nearer."""

    def change(values):
        for k in range(5, 25):
            met = slice(150 + 10 * k, 150 + beams + 10 * k)
            values[k, met] = np.nanmin(values[k, met]) - nearer
        return values

    return change


def test_somebody_who_walks_by_is_set_aside_and_is_not_taken_for_light_of_others(tmp_path):
    data = recording(tmp_path, "laser.mount_x", 0.05, 11, scans=30)

    finding = criticise_scans(_with(data, walker(35, 0.5)), MODEL, lambda _: None)
    assert not finding.unknown
    assert {cause.id for cause in finding.causes} == {"laser.mount_x"}
    assert any("not in the map stands before its walls" in line for line in finding.details)


@pytest.mark.parametrize("nearer", [0.13, 0.07])
def test_somebody_close_to_the_walls_is_set_aside_too(tmp_path, nearer):
    """Nearer to them than errors of the poses may move them, before scans have put these right."""
    data = recording(tmp_path, None, 0.0, 11, scans=30)

    finding = criticise_scans(_with(data, walker(20, nearer)), MODEL, lambda _: None)
    assert not finding.causes
    assert not finding.unknown
    assert any("not in the map stands before its walls" in line for line in finding.details)


def test_a_wall_or_a_beam_that_is_always_off_is_no_thing_before_a_wall():
    """What stands there is now and then before it: the map may have the wall wrong, or the laser the beam."""
    measured, ranges, hits = wall()
    view = sights(measured, ranges)
    none = passing_objects(view)
    walked = none.with_close(sights(person(measured.copy(), ranges, 30, 20, 0.15), ranges))
    assert len(walked.scans) == 30
    assert walked.readings[0, 100:120].all()
    assert walked.readings.mean() < 0.1
    displaced = np.where((hits[:, :, 0] > 3.0) & (hits[:, :, 0] < 4.0), measured - 0.15, measured)
    assert not none.with_close(sights(displaced, ranges)).readings.any()
    measured[:, 100:120] -= 0.15
    assert not none.with_close(sights(measured, ranges)).readings.any()
    assert not none.with_close(sights(np.full_like(ranges, np.nan), ranges)).readings.any()


def test_where_far_walls_are_cut_off_what_stands_before_them_is_no_other_map(tmp_path):
    """Of a wall beyond the longest reading nothing is left but what now and then stands before it."""
    data = sparse(recording(tmp_path, None, 0.0, 5, scans=100))
    (run,) = data.runs
    ranges = run.scan.values.copy()
    near = np.random.default_rng(1).random(ranges.shape) < 0.01
    ranges = np.where(ranges > 2.5, np.where(near, 0.6 * ranges, 2.5), ranges)
    cut = replace(data, runs=(replace(run, scan=replace(run.scan, values=ranges)),))
    assert not Assembly(gather(cut, MODEL)).map_change.readings.any()


def test_a_wall_that_is_not_where_the_map_has_it_is_unknown(tmp_path):
    data = recording(tmp_path, "laser.mount_x", 0.05, 12, scans=30)
    assembly = Assembly(gather(data, MODEL))
    hits, base = assembly.marks.seen.ends(assembly.marks.base), assembly.marks.base
    part = np.isfinite(base) & (hits[:, :, 0] > np.nanquantile(hits[:, :, 0], 0.93))
    assert assembly.mapped.all()

    def moved(values):
        values[: len(part)][part] += 0.8
        return values

    finding = criticise_scans(_with(data, moved), MODEL, lambda _: None)
    assert {unknown.covariate for unknown in finding.unknown} == {"hit x", "hit y"}
    assert {cause.id for cause in finding.causes} == {"laser.mount_x"}
