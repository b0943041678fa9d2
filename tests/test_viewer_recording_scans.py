# SPDX-License-Identifier: BSD-3-Clause
"""view RECORDING: the scans of long recordings are put aside, and any of them is there at once."""

import time
import tracemalloc

import numpy as np
import pytest
from recordings import Bag
from view_rig import Look

from kurumaisu.critic.view.tape import Spool, read_album


def bag_of_scans(path, scans=1200, beams=682, intensities=lambda i: ()):
    """Two minutes of scans at 10 Hz, and poses; intensities(i): of the i-th."""
    bag = Bag(path)
    rng = np.random.default_rng(1)
    fan = {"angle_min": -2.0862138, "angle_max": 2.0922, "angle_increment": 0.0061359, "scan_time": 0.1}
    for i in range(scans):
        t = 100.0 + 0.1 * i
        bag.write("/ground_truth", bag.pose_stamped(t, (0.01 * i, 0.0, 0.0)), t)
        message = bag.make(
            "sensor_msgs/msg/LaserScan",
            header=bag.header(t),
            **fan,
            time_increment=0.0,
            range_min=0.06,
            range_max=4.0,
            ranges=rng.uniform(0.5, 3.5, beams).astype(np.float32),
            intensities=np.asarray(intensities(i), dtype=np.float32),
        )
        bag.write("/scan", message, t)
    bag.writer.close()


def test_the_scans_of_a_long_bag_are_not_held_in_memory(tmp_path):
    bag_of_scans(tmp_path / "long.bag")
    tracemalloc.start()
    album = read_album(tmp_path / "long.bag", ())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    (run,) = album.recording.runs
    assert run.scan.columns == ("row",)
    assert len(run.scan.t) == 1200
    # read whole, as the critic must, they are 6.5 MB several times over
    assert peak < 4e6


def test_any_moment_is_there_at_once(two_runs):
    with Look(two_runs) as look:
        times = np.random.default_rng(2).uniform(10.0, 39.9, 200)
        spent = []
        for t in times:
            begin = time.perf_counter()
            look.source.command("seek", {"t": float(t)})
            spent.append(time.perf_counter() - begin)
        assert np.median(spent) < 0.02


def test_a_spool_gives_back_what_was_put_aside_in_any_order():
    rng = np.random.default_rng(3)
    rows = rng.uniform(0.0, 4.0, (50, 9))
    rows[7, 2:4] = np.nan, np.inf
    spool = Spool()
    assert [spool.put(row) for row in rows] == list(range(50))
    assert spool.put(np.zeros(8)) == -1
    for i in rng.permutation(50):
        ranges, intensities = spool.get(i)
        np.testing.assert_array_equal(ranges, rows[i].astype(np.float32))
        assert intensities is None


@pytest.mark.parametrize("missing", [3, 0])
def test_the_intensities_of_a_bag_are_shown_where_they_were_recorded(tmp_path, missing):
    """A scan without them among others has none; where the first has none, that is taken to be the laser's way."""
    rng = np.random.default_rng(4)
    sent = rng.uniform(0.0, 4000.0, (6, 682)).astype(np.float32)
    bag_of_scans(tmp_path / "drive.bag", 6, intensities=lambda i: () if i == missing else sent[i])
    with Look(tmp_path / "drive.bag") as look:
        for i in (5, 3, 4, 1):  # to and fro
            look.at(100.0 + 0.1 * i)
            shown = look.intensities()
            if missing == 0:
                assert shown is None
            elif i == missing:
                assert np.isnan(shown).all()
            else:
                np.testing.assert_array_equal(shown, sent[i])
            assert len(look.ranges()[0]) == 682
