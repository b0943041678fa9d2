#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Effects switched in a running sim_node by a client of dynamic_reconfigure: on, changed, off, bounded, refused."""

import math
import sys
import unittest
from pathlib import Path

import numpy as np
import pytest
import rospy
import yaml
from dynamic_reconfigure.client import Client
from dynamic_reconfigure.msg import Config, DoubleParameter
from dynamic_reconfigure.srv import Reconfigure
from geometry_msgs.msg import Point, Pose, Quaternion
from kurumaisu.msg import Voltages
from kurumaisu.srv import SetPose
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock, Log
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String
from std_srvs.srv import Empty

from kurumaisu import effects
from kurumaisu.params import load_model
from kurumaisu.ros.testing.nodes import PATIENCE, Topic, wait_for

STEP = 0.01  # [s]


def key(effect, parameter):
    return f"{effect}_{parameter}".replace(".", "_")


class SimEffectsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.model = load_model(Path(rospy.get_param("~model")))
        cls.clock = Topic("/clock", Clock)
        cls.truth = Topic("ground_truth", Odometry)
        cls.scan = Topic("scan", LaserScan)
        cls.log = Topic("/rosout", Log)
        cls.acting = Topic("sim_node/effects", String)
        cls.voltages = rospy.Publisher("voltages", Voltages, queue_size=10)
        wait_for(cls.voltages.get_num_connections, "sim_node listens to voltages")
        wait_for(lambda: cls.acting.last, "what acts")
        cls.client = Client("/sim_node/live", timeout=PATIENCE)
        cls.start = dict(cls.client.get_configuration(timeout=PATIENCE))

    def setUp(self):
        rospy.ServiceProxy("reset", Empty)()

    def tearDown(self):
        self.client.update_configuration({name: value for name, value in self.start.items() if name != "groups"})

    def switch(self, effect, enabled=True, **values):
        """Return what the server says of the effect afterwards."""
        changes = {key(effect, name): value for name, value in values.items()}
        said = self.client.update_configuration({key(effect, "enabled"): enabled, **changes})
        return {name: said[key(effect, name)] for name in ("enabled", *values)}

    def drive(self, v, w):
        """Drive so from now on; return the stamp."""
        message = Voltages(
            translation=float(self.model.translation.volts(v)),
            steering=float(self.model.steering.volts(w)),
            reference=self.model.reference_voltage,
            v=v,
            w=w,
        )
        message.header.stamp = self.now() + rospy.Duration(2)  # half a second of the wall's, to come in time
        self.voltages.publish(message)
        return message.header.stamp

    def now(self):
        return self.clock.wait(lambda _: True, "the clock").clock

    def seen(self, stamp, seconds):
        """Return times after a stamp, x, y, v, w until so much later."""
        self.truth.wait(lambda m: m.header.stamp >= stamp + rospy.Duration.from_sec(seconds), "the truth")
        rows = [
            [
                (m.header.stamp - stamp).to_sec(),
                m.pose.pose.position.x,
                m.pose.pose.position.y,
                m.twist.twist.linear.x,
                m.twist.twist.angular.z,
            ]
            for m in self.truth.messages
            if stamp <= m.header.stamp <= stamp + rospy.Duration.from_sec(seconds)
        ]
        return np.array(rows)

    def test_what_the_files_say_is_on_at_the_start(self):
        on = {name for name, value in self.start.items() if name.endswith("_enabled") and value}
        assert on == {"base_gain_v_enabled"}
        assert self.start["base_gain_v_gain"] == 0.25
        assert len([name for name in self.start if name.endswith("_enabled")]) == len(effects.ALL)
        listed = yaml.safe_load(self.acting.messages[0].data)["effects"]
        assert [one["id"] for one in listed] == ["base.gain_v", "smooth.w.time"]
        assert listed[0]["parameters"] == {"gain": 0.25}

    def test_every_parameter_has_its_bounds_unit_and_a_group(self):
        described = {one["name"]: one for one in self.client.get_parameter_descriptions(timeout=PATIENCE)}
        groups = self.client.get_group_descriptions(timeout=PATIENCE)["groups"]
        assert set(groups) == {"base", "laser", "world"}
        for effect in effects.ALL:
            group = groups[effect.id.split(".")[0]]["groups"][effect.id]
            assert next(one["name"] for one in group["parameters"]) == key(effect.id, "enabled")
            for p in effect.parameters:
                one = described[key(effect.id, p.name)]
                assert (one["min"], one["max"]) == (p.lower, p.upper)
                assert f"[{p.unit}]" in one["description"]
                if effect.id != "base.gain_v":
                    assert one["default"] == p.null

    def test_a_lag_does_not_jump_the_pose_and_then_lags(self):
        start = self.drive(0.2, 0.0)
        assert self.seen(start, 1.0)[-1, 3] == pytest.approx(0.25, abs=1e-9)
        assert self.switch("base.lag_v", tau=0.5) == {"enabled": True, "tau": 0.5}
        stop = self.drive(0.0, 0.0)
        rows = self.seen(start, (stop - start).to_sec() - STEP)
        np.testing.assert_allclose(rows[1:, 3], 0.25, atol=1e-9)
        np.testing.assert_allclose(np.diff(rows[:, 1]), 0.25 * np.diff(rows[:, 0]), atol=1e-9)
        fading = self.seen(stop, 1.0)[1:]
        mean = (
            0.25 * 0.5 / STEP * (math.exp(STEP / 0.5) - 1) * np.exp(-fading[:, 0] / 0.5)
        )  # of the step that ends then
        np.testing.assert_allclose(fading[:, 3], mean, rtol=1e-6)
        self.switch("base.lag_v", enabled=False)
        start = self.drive(0.1, 0.0)
        stop = self.drive(0.0, 0.0)
        assert self.seen(stop, 0.5)[1:, 3].max() == pytest.approx(0.0, abs=1e-9)

    def test_the_scan_changes_and_comes_back(self):
        def ranges():
            after = self.now() + rospy.Duration(0, 200_000_000)
            return np.array(self.scan.wait(lambda m: m.header.stamp > after, "a scan").ranges)

        before = ranges()
        self.switch("laser.offset", offset=0.3)
        off = ranges()
        self.switch("laser.offset", enabled=False)
        again = ranges()
        near = np.isfinite(before) & np.isfinite(off) & np.isfinite(again)
        assert near.sum() > 200
        assert np.median((off - before)[near]) == pytest.approx(0.3, abs=0.001)
        assert np.median((again - before)[near]) == pytest.approx(0.0, abs=0.001)

    def test_too_much_is_bounded_and_said(self):
        assert self.switch("base.lag_w", tau=9.0) == {"enabled": True, "tau": 3.0}
        self.said("SIM_EFFECTS_BOUNDED base.lag_w: tau must be 0 to 3 s: 9; 3 is used")

    def test_what_is_no_number_or_no_parameter_is_left_out_and_said(self):
        ask = rospy.ServiceProxy("/sim_node/live/set_parameters", Reconfigure)
        ask(Config(doubles=[DoubleParameter("base_lag_w_tau", math.nan), DoubleParameter("base_lag_q_tau", 1.0)]))
        self.said("SIM_EFFECTS_BOUNDED base.lag_w: tau must be 0 to 3 s: nan; it stays as it is")
        self.said("SIM_EFFECTS_BOUNDED base_lag_q_tau: is not a parameter of an effect")
        assert ask(Config()).config.doubles[0].value == ask(Config()).config.doubles[0].value

    def test_walls_that_would_stand_in_the_chair_are_refused(self):
        near = Pose(position=Point(4.6, 2.0, 0.0), orientation=Quaternion(0.0, 0.0, 0.0, 1.0))
        assert rospy.ServiceProxy("set_pose", SetPose)("chair", near).success
        assert self.switch("world.map_error", scale=-0.2) == {"enabled": False, "scale": 0.0}  # the east wall at 4.8 m
        self.said("SIM_EFFECTS_REFUSED effects: a wall would be inside the chair")
        assert self.switch("world.map_error", scale=0.1) == {"enabled": True, "scale": 0.1}

    def test_all_of_them_one_after_another_and_off_again(self):
        self.drive(0.1, 0.1)
        for effect in effects.ALL:
            if effect.id == "world.map_error":
                continue
            self.switch(effect.id, **{p.name: p.null + p.scale for p in effect.parameters})
            assert effect.id in self.acting.last.data or wait_for(
                lambda name=effect.id: name in self.acting.last.data, effect.id
            )
        self.now()
        self.tearDown()
        stop = self.drive(0.2, 0.0)
        rows = self.seen(stop, 0.5)
        np.testing.assert_allclose(rows[1:, 3], 0.25, atol=1e-9)

    def said(self, words):
        wait_for(lambda: any(words in m.msg for m in self.log.messages), words)


if __name__ == "__main__":
    import rostest

    rospy.init_node("sim_effects_test")
    rostest.rosrun("kurumaisu", "sim_effects_test", SimEffectsTest, sys.argv)
