# SPDX-License-Identifier: BSD-3-Clause
"""What acts beside something loud, and what only seems to: rests of equations, ends of walls, the model's own."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from laser_scene import FIRST, INCREMENT, recording

from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.critic.ranges.scans.gathering import gather
from kurumaisu.critic.ranges.scans.valid_readings import edges
from kurumaisu.critic.ranges.search.normal_equations import Assembly
from kurumaisu.critic.ranges.signals.form_error import beam_family
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
SCANS = 60
MEAN = frozenset(f"laser.{name}" for name in ("latency", "sweep", "mount_x", "mount_y", "mount_yaw", "scale", "offset"))


def with_readings(data, of):
    """Return a recording with other readings (k, b) [m]."""
    run = data.runs[0]
    values = np.round(of(run.scan.values), 3)
    return replace(data, runs=(replace(run, scan=replace(run.scan, values=values)),))


def named(data, ids=MEAN):
    found = criticise_scans(data, MODEL, lambda _: None, ids)
    assert (found.confounded, found.unknown) == ((), ())
    return {cause.id: cause for cause in found.causes}


@pytest.mark.parametrize("late", [0.0, 0.04])
def test_a_loud_effect_hides_none_that_follows_something_else(tmp_path, late):
    """All ranges are longer by a fiftieth; late stamps do a hundredth of that, but nothing that follows the range."""
    data = recording(tmp_path, "laser.latency", late, 5, scans=SCANS)
    found = named(with_readings(data, lambda r: 0.058826 + 1.02 * (r - 0.058826)))
    assert set(found) == ({"laser.scale", "laser.latency"} if late else {"laser.scale"})
    if late:
        assert found["laser.latency"].parameters["delay"].estimate == pytest.approx(late, abs=0.002)


@pytest.mark.parametrize("power", [1.5, 2.5])
def test_another_power_of_the_range_is_one_cause(tmp_path, power):
    """An equation misses more of it than anybody said beforehand, and a scale draws that well."""
    data = recording(tmp_path, None, 0.0, 5, scans=SCANS)
    ids = MEAN | {"laser.quadratic", "laser.cyclic"}
    assert len(named(with_readings(data, lambda r: r + 0.02 * (r / 3) ** power), ids)) == 1


def test_a_loud_delay_is_no_mounting(tmp_path):
    """On a line, the laser seemed askew and aside, too; refitted, nothing of that was left."""
    assert set(named(recording(tmp_path, "laser.latency", 0.04, 5, scans=SCANS))) == {"laser.latency"}


def test_what_beams_keep_is_no_error_of_whole_scans(tmp_path):
    """Each scan has other beams that count: their mean wandered with what beams keep."""
    bearings = FIRST + INCREMENT * np.arange(682)
    data = recording(tmp_path, None, 0.0, 7, scans=SCANS)
    seen = Assembly(gather(with_readings(data, lambda r: r + 0.002 * np.cos(2 * bearings)), MODEL), frozenset())
    alone, beside = (
        one.settle((0.003, 0.003)).scan_noise for one in (seen, seen.with_families([beam_family(seen.shots)]))
    )
    assert alone.common_sd > 3e-4
    assert beside.common_sd < 2e-4  # what is usual beforehand


def test_where_corners_are_elsewhere_more_beams_beside_them_say_nothing():
    beams, increment = 401, 0.005
    angles = increment * (np.arange(beams) - beams // 2)
    wall = np.where(np.arange(beams) < beams // 2, 2.0, 1.0)[np.newaxis] / np.cos(angles)
    seen = SimpleNamespace(level=wall)
    beside = edges(seen, increment)[0, beams // 2 - 30 : beams // 2 + 30].sum()
    farther = edges(seen, increment, 0.02)[0, beams // 2 - 30 : beams // 2 + 30].sum()
    assert farther - beside == pytest.approx(2 * 0.02 / 1.0 / increment, abs=1)


def test_walls_whose_ends_a_laser_looks_past_were_not_moved(tmp_path):
    """Askew by three degrees, it meets what is behind the ends of walls, wherever it is sent."""
    found = named(recording(tmp_path, "laser.mount_yaw", 0.06, 4, scans=SCANS))
    assert set(found) == {"laser.mount_yaw"}
