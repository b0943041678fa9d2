# SPDX-License-Identifier: BSD-3-Clause
"""Parts of stageros that need no master: rates, the truth with its stamps, names in saved states, newcomers."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from sim_worlds import ROOM, drive, robot, simulator

from kurumaisu.effects import Reference
from kurumaisu.errors import Error
from kurumaisu.ros.stageros.names import Names
from kurumaisu.ros.stageros.rates import Pace
from kurumaisu.ros.stageros.saved_names import with_names, without_names
from kurumaisu.ros.stageros.settings import read_settings
from kurumaisu.ros.stageros.truth import GroundTruth
from kurumaisu.sim.robots import state
from kurumaisu.sim.robots.newcomers import renumbered
from kurumaisu.world.layout import family


def pace(interval=0.1, **rates):
    return Pace(read_settings({"rates": rates}, "/stageros").rates, interval)


def test_a_sensor_may_have_a_rate_of_its_own():
    one = pace(base_scan=5.0, image=2.0, sensors={"base_scan_1": 2.5, "/robot_1/base_scan_1": 1.0})
    assert one.every("odom") == 1
    assert one.every("base_scan") == 2
    topics = ("base_scan", "/base_scan_0", "/robot_0/base_scan_1", "robot_1/base_scan_1")
    assert [one.sensor("base_scan", topic) for topic in topics] == [2, 2, 4, 10]
    assert one.sensor("image", "/robot_0/image_1") == 5


@pytest.mark.parametrize(("rates", "message"), [
    ({"odom": 3.0}, "rates: odom: must divide the world's 10 Hz: 3"),
    ({"sensors": {"base_scan_0": 20.0}}, "rates: sensors.base_scan_0: must divide the world's 10 Hz: 20"),
    ({"sensors": {"base_scan_0": -1.0}}, "rates.sensors.base_scan_0: must be a finite number"),
    ({"sensors": 3}, "rates.sensors: must be a mapping"),
])  # fmt: skip
def test_bad_rates_are_named(rates, message):
    with pytest.raises(Error, match=message):
        pace(**rates)


def test_a_rate_of_no_sensor_is_named():
    one = pace(sensors={"base_scan_1": 5.0})
    one.check(["/robot_0/base_scan_0", "/robot_0/base_scan_1"])
    with pytest.raises(Error, match="base_scan_1: there is no sensor of this name; did you mean base_scan"):
        one.check(["base_scan"])


def test_bumpers_and_finders_are_asked_of_the_simulator():
    assert read_settings({}, "/s").options.devices == ()
    both = read_settings({"publish_bumpers": True, "publish_fiducials": True}, "/s")
    assert both.options.devices == ("bumper", "fiducial")


def test_the_truth_is_as_in_stage_ros(tmp_path):
    truth = GroundTruth(0.1)
    first, second = drive(simulator(tmp_path, ROOM + robot("", "0 0 0 90")), (0.5, 0, 1.0), 2)
    truth.take(first)
    assert truth.change(3_000_000_005).stamps.tolist() == [3_000_000_005]
    assert_array_equal(truth.change(0).before, truth.change(0).now)
    truth.take(second)
    change = truth.change(0)
    assert_array_equal(change.before, first.poses)
    assert_array_equal(change.now, second.poses)
    assert change.spans.tolist() == [0.1]


def test_a_reference_has_its_own_place_and_time(tmp_path):
    truth = GroundTruth(0.1)
    for seen in drive(simulator(tmp_path, robot()), (0.5, 0, 0), 20):
        poses = seen.poses[:, [0, 1, 3]] + [0.0, 0.3, 0.0]
        truth.take(replace(seen, reference=Reference(np.array([1.5 * seen.time]), poses, np.zeros((1, 3)))))
    change = truth.change(7_000_000_000)
    assert change.now[0, :2] == pytest.approx((1.0, 0.3))
    assert change.spans == pytest.approx([0.15])
    assert change.stamps.tolist() == [8_000_000_000]  # a second fast after two


def test_names_are_saved():
    names = [Names(None, False, False), Names("robot_4", True, False)]
    assert without_names(with_names(b"state\n", names, 5)) == ([None, "robot_4"], 5, b"state\n")


GOOD = {"robots": [None], "numbered": 1, "simulator": np.zeros(3, dtype=np.uint8)}


@pytest.mark.parametrize(
    ("known", "message"),
    [
        ({"world": "a"}, "is not one that stageros saved: it holds .'world'."),
        ({**GOOD, "robots": [1]}, "robots: must be names"),
        ({**GOOD, "robots": ["a b"]}, "robots: must be names"),
        ({**GOOD, "robots": 3}, "robots: must be names"),
        ({**GOOD, "numbered": True}, "numbered"),
        ({**GOOD, "simulator": "x"}, "simulator"),
    ],
)
def test_other_states_are_refused(known, message):
    with pytest.raises(Error, match=f"state: .*{message}"):
        without_names(state.pack(known))


def test_a_copy_is_numbered_from_0(tmp_path):
    models = simulator(tmp_path, robot() + robot("model ( model ( ) ) model ( )")).models
    copy = renumbered([models[index] for index in family(models, 1)], "twin")
    assert [(m.index, m.parent, m.root, m.name) for m in copy] == [
        *((0, -1, 0, "twin"), (1, 0, 0, None), (2, 1, 0, None), (3, 0, 0, None))
    ]
