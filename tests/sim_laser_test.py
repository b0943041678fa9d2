#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The scan that laser_node makes of the virtual URG against the one that the simulator fed it with, beam by beam."""

import sys
import time
import unittest
import uuid
from pathlib import Path

import numpy as np
import rospy
from kurumaisu.msg import Voltages
from kurumaisu.srv import Speed, StateFile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from std_srvs.srv import Empty, SetBool, Trigger

from kurumaisu.params import load_model
from kurumaisu.ros.testing.nodes import PATIENCE, Topic, wait_for

SERVICES = {
    "reset": Empty,
    "pause": SetBool,
    "step": Trigger,
    "speed": Speed,
    "save": StateFile,
    "load": StateFile,
}
DAMAGED = 4.0  # [s] the damaged scan comes later
STALE = 0.5  # [s] after which the driver takes a silent sensor for gone


class SimLaserTest(unittest.TestCase):
    """One run with a drive, a pause, a reset, a load and a damaged scan; the tests look at what was heard of it."""

    @classmethod
    def setUpClass(cls):
        cls.model = load_model(Path(rospy.get_param("~model")))
        cls.clock, cls.fed, cls.scan = (
            Topic("/clock", Clock),
            Topic("sim_node/scan", LaserScan),
            Topic("scan", LaserScan),
        )
        cls.voltages = rospy.Publisher("voltages", Voltages, queue_size=10)
        for name in SERVICES:
            rospy.wait_for_service(name, PATIENCE)
        cls.call = {name: rospy.ServiceProxy(name, kind) for name, kind in SERVICES.items()}
        wait_for(cls.voltages.get_num_connections, "sim_node listens to voltages")
        wait_for(lambda: cls.fed.last and cls.scan.last, "scans from both")
        # From here on: what was sent before may have been heard by one ear only.
        cls.first = cls.scan.last.header.stamp
        assert cls.first.to_sec() < DAMAGED, "the test began too late"
        assert cls.call["speed"](rospy.get_param("~speed")).success
        cls.drive()
        cls.pause()
        cls.call["reset"]()
        cls.go_on(2.0)
        cls.save_and_load()
        cls.go_on(2.0)
        cls.end = cls.fed.last.header.stamp
        cls.scan.wait(lambda m: m.header.stamp >= cls.end, "the driver's last scan")

    @classmethod
    def go_on(cls, seconds):
        until = cls.clock.last.clock + rospy.Duration(seconds)
        cls.clock.wait(lambda m: m.clock >= until, f"{seconds} s later")

    @classmethod
    def drive(cls):
        message = Voltages(
            translation=float(cls.model.translation.volts(0.3)),
            steering=float(cls.model.steering.volts(0.6)),
            reference=cls.model.reference_voltage,
            v=0.3,
            w=0.6,
        )
        message.header.stamp = cls.clock.last.clock
        cls.voltages.publish(message)
        cls.go_on(2.0)

    @classmethod
    def pause(cls):
        """Stand still for longer than a driver by the wall's clock would bear, then step through three scans."""
        cls.call["pause"](True)
        begin = time.monotonic()
        wait_for(lambda: time.monotonic() > begin + 1.5 * STALE, "the pause")
        for _ in range(30):
            assert cls.call["step"]().success
        cls.call["pause"](False)

    @classmethod
    def save_and_load(cls):
        name = f"test-{uuid.uuid4().hex}"
        saved = cls.call["save"](name)
        assert saved.success, saved.message
        cls.go_on(0.53)  # amid a scan
        assert cls.call["load"](name).success
        Path(saved.message.split(": ", 1)[1]).unlink()

    def setUp(self):
        """Pair both by stamp; the driver's is worked out of a clock of milliseconds and a constant."""
        fed = [m for m in self.fed.messages if self.first <= m.header.stamp <= self.end]
        made = {round(m.header.stamp.to_nsec(), -3): m for m in self.scan.messages}
        self.pairs = [(m, made.get(round(m.header.stamp.to_nsec(), -3))) for m in fed]
        self.both = [(ours, theirs) for ours, theirs in self.pairs if theirs is not None]
        assert len(self.both) >= 50

    def test_one_damaged_scan_is_lost_and_no_other(self):
        lost = [m.header.stamp.to_sec() for m, driver in self.pairs if driver is None]
        assert len(lost) == rospy.get_param("~lost"), lost

    def test_every_scan_of_the_driver_was_fed(self):
        known = np.array([m.header.stamp.to_nsec() for m in self.fed.messages])
        for m in self.scan.messages:
            if self.first <= m.header.stamp <= self.end:
                off = np.abs(known - m.header.stamp.to_nsec()).min()
                assert off <= 1000, f"{m.header.stamp.to_sec():.9f}: {off} ns from any that was fed"

    def test_stamps_increase(self):
        stamps = [m.header.stamp.to_nsec() for m in self.scan.messages]
        np.testing.assert_array_less(0, np.diff(stamps))

    def test_every_beam_agrees(self):
        for ours, theirs in self.both:
            # Readings are whole millimetres, so that both are the same number; nothing else may be, either.
            np.testing.assert_allclose(theirs.ranges, ours.ranges, rtol=0, atol=1e-6)

    def test_the_run_had_every_kind_of_beam(self):
        ranges = np.array([m.ranges for m, _ in self.both])
        assert np.isinf(ranges).any()
        assert np.isfinite(ranges).any()
        assert len(np.unique(ranges[np.isfinite(ranges)])) > 1000

    def test_fans_agree(self):
        for ours, theirs in self.both:
            assert theirs.header.frame_id == ours.header.frame_id
            for name in ("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time"):
                np.testing.assert_allclose(getattr(theirs, name), getattr(ours, name), rtol=1e-6, err_msg=name)
            assert (theirs.range_min, theirs.range_max) == (ours.range_min, ours.range_max)


if __name__ == "__main__":
    import rostest

    rospy.init_node("sim_laser_test")
    rostest.rosrun("kurumaisu", "sim_laser_test", SimLaserTest, sys.argv)
