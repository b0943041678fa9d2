# SPDX-License-Identifier: BSD-3-Clause
"""Odometry again, without ROS: against an arc by hand; what is lost, late or turned is told. Figure 10 from its log."""

import math

import numpy as np
import pytest

from kurumaisu._core import AxisLaw, Branch
from kurumaisu.critic.values.recording import Series
from kurumaisu.errors import Error
from kurumaisu.paper.chair import dac_line
from kurumaisu.paper.chair.dead_reckoning import Reckoner, compare, heading, seconds

TICK = 20_000_000  # [ns]
BEGIN = 1_700_000_000_123_456_789  # as of a clock on the wall


def drive(n=2000, w=0.7):
    """Return what was put out, and the odometry of a circle, by hand."""
    put = [(BEGIN + k * TICK, 0.5, w) for k in range(n)]
    odom = []
    for k in range(n):
        angle = w * 0.02 * k
        x, y = 0.5 / w * math.sin(angle), 0.5 / w * (1 - math.cos(angle))
        odom.append((BEGIN + k * TICK, x, y, math.sin(angle / 2), math.cos(angle / 2)))
    return put, odom


def test_a_circle_is_a_circle():
    found = compare(*drive())
    assert found.stamps == 2000
    assert found.worst < 1e-6  # stamps of a wall's clock have 2e-7 s as doubles
    assert found.worst_turn < 1e-6
    assert found.gaps == 0


def test_what_the_same_arithmetic_made_is_the_same_to_the_last_bit():
    put, _ = drive()
    reckoner = Reckoner(BEGIN, np.zeros(3))
    poses = [(stamp, *reckoner.go(stamp, v, w)) for stamp, v, w in put]
    odom = [(stamp, x, y, math.sin(0.5 * theta), math.cos(0.5 * theta)) for stamp, x, y, theta in poses]
    found = compare(put, odom)
    assert found.equal == found.stamps == 2000
    odom[700] = (odom[700][0], np.nextafter(odom[700][1], 9.0), *odom[700][2:])  # one bit
    assert compare(put, odom).equal == 1999


def test_a_lost_message_is_a_gap_and_shows():
    put, odom = drive()
    put = [(stamp, 0.5 if k < 1000 else 0.0, w) for k, (stamp, _, w) in enumerate(put)]
    lost = compare([row for k, row in enumerate(put) if not 1000 <= k < 1010], odom[:1011])
    assert lost.gaps == 1
    assert lost.worst == pytest.approx(0.0, abs=1e-6)  # nine ticks as before: what would have been, had it not stopped
    assert lost.equal < lost.stamps


def test_the_last_of_two_with_one_stamp_holds_and_an_earlier_one_nothing():
    reckoner = Reckoner(0, np.zeros(3))
    reckoner.go(TICK, 9.0, 0.0)
    reckoner.go(TICK, 1.0, 0.0)
    reckoner.go(0, 5.0, 0.0)
    assert reckoner.go(3 * TICK, 0.0, 0.0)[0] == pytest.approx(0.04)


def test_a_recording_may_begin_on_the_way_and_wind():
    put, odom = drive(w=1.5)
    found = compare(put[1500:], odom[1500:])
    assert found.worst < 1e-5
    assert found.worst_turn < 1e-5  # beyond half a turn the quaternion may have the other sign
    assert compare(put[:5], odom[100:]) is None


def test_stamps_and_headings_are_as_ros_has_them():
    assert seconds(1_500_000_001) == 1.0 + 1e-9 * 500_000_001
    for angle in (-3.0, 0.0, 2.5):
        assert heading(math.sin(angle / 2), math.cos(angle / 2)) == pytest.approx(angle)


# Figure 10


def log_of(tmp_path, rows):
    path = tmp_path / "dac.log"
    path.write_text("".join(f"{int(t * 1e9)} {text}\n" for t, text in rows))
    return path


def test_points_are_the_ends_of_what_was_held(tmp_path):
    rows = [
        (0.0, "volts 0 0 2.5"),
        (1.02, "volts 0.3 0 2.5"),
        (1.1, "volts 0.53 0 2.5"),
        (2.6, "volts 0 0 2.5"),
        (1.5, "fault silent"),
    ]
    log = dac_line.read_log(log_of(tmp_path, rows), 100.0)
    t = 100 + np.arange(0, 4.001, 0.02)
    v = np.where((t >= 101) & (t < 102.5), 0.3, 0.0)
    found = dac_line.points(Series(t, np.column_stack([v, 0 * v]), ("v", "w")), log)
    assert [(p.v, p.volts) for p in found] == [(0.0, 0.0), (0.3, 0.53), (0.0, 0.0)]
    law = AxisLaw(Branch(1.3, 0.13), Branch(2.0, -0.1))
    np.testing.assert_allclose(dac_line.off(found, law), [0.0, 0.53 - 0.52, 0.0], atol=1e-12)


def test_a_log_that_is_none_is_refused(tmp_path):
    with pytest.raises(Error, match=r"dac\.log:1: is not a line of virtual_dac's log"):
        dac_line.read_log(log_of(tmp_path, [(1.0, "volts 0.3 x 2.5")]), 0.0)
    with pytest.raises(Error, match="got no voltages"):
        dac_line.read_log(log_of(tmp_path, []), 0.0)
    short = Series(np.array([0.0, 0.1]), np.zeros((2, 2)), ("v", "w"))
    with pytest.raises(Error, match="no speed was held"):
        dac_line.points(short, np.zeros((1, 4)))
