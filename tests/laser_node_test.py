#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""laser_nodes on virtual sensors: what they publish, take and refuse."""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
import time
import unittest
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import roslib.packages
import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from dynamic_reconfigure.client import Client
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from std_srvs.srv import Trigger

from kurumaisu.ros.testing.nodes import PATIENCE, Topic, unexplained, wait_for
from kurumaisu.virtual_urg import Pty, Tcp, VirtualUrg, load_sensor

SENSOR = load_sensor("urg_04lx")
EXIT = 2.0  # [s] in which a node must end, whatever its sensor does


LAUNCH = """
<launch>
  <node pkg="kurumaisu" type="laser_node" name="urg_node">
    <param name="ip_address" value=""/>
    <param name="serial_port" value="{serial}"/>
    <param name="frame_id" value="base_laser"/>
    <param name="calibrate_time" value="true"/>
    <param name="publish_multiecho" value="false"/>
    <param name="angle_min" value="-1.5707963"/>
    <param name="angle_max" value="1.5707963"/>
  </node>
  <group ns="named">
    <include file="$(find kurumaisu)/launch/laser.launch">
      <arg name="ip_address" value="127.0.0.1"/>
    </include>
    <param name="laser_node/ip_port" value="{tcp}"/>
  </group>
</launch>
"""


def program(name: str) -> str:
    return str(roslib.packages.find_node("kurumaisu", name)[0])


def begin(name: str, **parameters: Any) -> subprocess.Popen[str]:
    """Start a laser_node, its topics under /NAME; parameters are private ones."""
    rospy.set_param(f"/{name}/laser_node", {"diagnostic_period": 0.2, **parameters})
    return subprocess.Popen(
        [program("laser_node"), f"__ns:=/{name}"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


@contextmanager
def laser_node(name: str, **parameters: Any) -> Iterator[subprocess.Popen[str]]:
    """Run a laser_node; it must end by SIGINT, in time and with exit status 0."""
    process = begin(name, **parameters)
    try:
        yield process
        start = time.monotonic()
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0, output
        assert time.monotonic() - start < EXIT
    finally:
        process.kill()
        process.wait()


class Diagnostics:
    """The diagnostics of one node."""

    def __init__(self, name: str) -> None:
        self._prefix = f"{name}/laser_node: "
        self._topic = Topic("/diagnostics", DiagnosticArray)

    def wait(self, title: str, level: int, words: str = "") -> dict[str, str]:
        """Return the values of the next status of that level whose message has the words."""

        def fits(status: Any) -> bool:
            return status.name.endswith(self._prefix + title) and status.level == level and words in status.message

        def found(message: Any) -> bool:
            return any(fits(status) for status in message.status)

        message = self._topic.wait(found, f"{title}: level {level}, {words}")
        return {item.key: item.value for status in message.status if fits(status) for item in status.values}


def fed_ranges() -> np.ndarray[Any, Any]:
    """Return what a sensor sees (steps,) [m]: a ramp of whole millimetres, a hole, nothing in reach."""
    ranges = np.round(np.linspace(0.5, 4.0, SENSOR.steps), 3)
    ranges[100:120] = np.nan
    ranges[200:230] = np.inf
    return ranges


class LaserNode(unittest.TestCase):
    """laser_nodes and their sensors."""

    def setUp(self) -> None:
        self._folder = tempfile.TemporaryDirectory()
        self.link = Path(self._folder.name) / "urg"

    def tearDown(self) -> None:
        self._folder.cleanup()

    def pty(self, *faults: str, **options: Any) -> VirtualUrg:
        return VirtualUrg(SENSOR, Pty(self.link), faults=faults, **options)

    @staticmethod
    def age_of_next(scans: Topic) -> float:
        stamp = scans.wait(lambda _: True, "scans").header.stamp
        return float((rospy.Time.now() - stamp).to_sec())

    def check_fan(self, scan: Any, first: int, last: int) -> None:
        np.testing.assert_allclose(scan.angle_min, SENSOR.bearings[first], atol=1e-6)
        np.testing.assert_allclose(scan.angle_max, SENSOR.bearings[last], atol=1e-6)
        np.testing.assert_allclose(scan.angle_increment, SENSOR.increment, rtol=1e-6)
        np.testing.assert_allclose(scan.time_increment, SENSOR.step_time, rtol=1e-6)
        np.testing.assert_allclose([scan.range_min, scan.range_max], [0.02, 5.6], rtol=1e-6)
        np.testing.assert_allclose(scan.ranges, fed_ranges()[first : last + 1], atol=1e-6)

    def test_scans_status_services_and_reconfigure(self) -> None:
        with self.pty() as urg, laser_node("plain", serial_port=str(self.link), frame_id="/front"):
            urg.show(fed_ranges())
            scans, diagnostics = Topic("/plain/scan", LaserScan), Diagnostics("plain")
            scan = scans.wait(lambda m: np.isfinite(m.ranges[0]), "scans")
            ages = [self.age_of_next(scans) for _ in range(5)]
            assert 0.06 < min(ages) < 0.5  # it takes 71 ms to measure; the test itself may look late
            assert scan.header.frame_id == "front"
            np.testing.assert_allclose(scan.scan_time, 0.1, rtol=1e-6)
            assert unexplained("/plain/laser_node", "laser_node") == set()
            self.check_fan(scan, 0, SENSOR.steps - 1)
            self.check_status("plain", diagnostics)
            self.check_reconfigure(scans)
            self.check_refusals(scans)

    def check_status(self, name: str, diagnostics: Diagnostics) -> None:
        values = diagnostics.wait("Hardware Status", DiagnosticStatus.OK, "Streaming")
        assert values["Device ID"] == "H0000000"
        assert values["Serial Port"] == str(self.link)
        assert values["Bad Sums"] == "0"
        rate = lambda: float(diagnostics.wait("Laser Scan", DiagnosticStatus.OK)["Rate [1/s]"])  # noqa: E731
        wait_for(lambda: abs(rate() - 10) < 0.5, "ten scans a second")
        latched = rospy.wait_for_message(f"/{name}/laser_status", DiagnosticStatus, PATIENCE)
        assert (latched.level, latched.message, latched.hardware_id) == (0, "Streaming", "H0000000")
        for service in ("update_laser_status", "laser_node/self_test", "laser_node/restart"):
            answer = rospy.ServiceProxy(f"/{name}/{service}", Trigger)()
            assert answer.success, f"{service}: {answer.message}"

    def check_reconfigure(self, scans: Topic) -> None:
        client = Client("/plain/laser_node", timeout=PATIENCE)
        try:
            front = SENSOR.front - SENSOR.first
            wanted = {"angle_min": -0.5, "angle_max": 0.5, "frame_id": "rear", "time_offset": 5.0, "skip": 1}
            begin = rospy.Time.now()
            client.update_configuration(wanted)
            scan = scans.wait(lambda m: m.header.frame_id == "rear" and len(m.ranges) < SENSOR.steps, "a small fan")
            self.check_fan(scan, front - 81, front + 81)  # 0.5 rad are 81.49 steps
            np.testing.assert_allclose(scan.scan_time, 0.2, rtol=1e-6)
            assert (scan.header.stamp - begin).to_sec() > 5.0 - 0.5
            assert (scan.header.stamp - rospy.Time.now()).to_sec() < 5.0
            client.update_configuration({"cluster": 3, "time_offset": 0.0, "skip": 0})
            clustered = scans.wait(lambda m: len(m.ranges) == len(scan.ranges) // 3, "clusters of three")
            np.testing.assert_allclose(clustered.angle_increment, 3 * SENSOR.increment, rtol=1e-6)
        finally:
            client.close()

    def check_refusals(self, scans: Topic) -> None:
        """What cannot be is set back, what can be in the same request is taken; the scans go on as before."""
        client = Client("/plain/laser_node", timeout=PATIENCE)
        try:
            back = client.update_configuration({"angle_min": 0.7, "frame_id": "side"})
            assert (back["angle_min"], back["frame_id"]) == (-0.5, "side")
            back = client.update_configuration({"frame_id": "/", "skip": 12})
            assert (back["frame_id"], back["skip"]) == ("side", 9)  # limits are dynamic_reconfigure's own
            client.update_configuration({"skip": 0, "publish_intensity": True})  # this sensor has none
            scan = scans.wait(lambda m: m.header.frame_id == "side", "scans go on")
            assert not scan.intensities
        finally:
            client.close()

    def test_bad_sum_is_told_and_costs_one_scan(self) -> None:
        with self.pty("corrupt@6") as urg, laser_node("damaged", serial_port=str(self.link)):
            scans, diagnostics = Topic("/damaged/scan", LaserScan), Diagnostics("damaged")
            urg.show(fed_ranges())
            values = diagnostics.wait("Hardware Status", DiagnosticStatus.WARN, "bad sums: 1")
            assert "LASER_DAMAGED" in values["Last Error"]
            values = diagnostics.wait("Hardware Status", DiagnosticStatus.OK)
            assert (values["Bad Sums"], values["Lost Scans"], values["Reconnects"]) == ("1", "1", "0")
            stamps = [m.header.stamp.to_sec() for m in scans.messages]
            assert abs(max(np.diff(stamps)) - 0.2) < 0.02

    def test_second_owner_of_a_port_is_refused(self) -> None:
        port = str(self.link)
        with self.pty(), laser_node("owner", serial_port=port):
            scans = Topic("/owner/scan", LaserScan)
            scans.wait(lambda m: True, "scans")
            with laser_node("late", serial_port=port):
                self.check_refused("late")
                scans.wait(lambda m: True, "scans go on")
            identify = subprocess.run([program("getID"), port], capture_output=True, text=True, check=False)
            assert identify.returncode == 1
            assert "LASER_IN_USE" in identify.stderr

    def check_refused(self, name: str) -> None:
        diagnostics = Diagnostics(name)
        diagnostics.wait("Hardware Status", DiagnosticStatus.ERROR, "LASER_IN_USE")
        diagnostics.wait("Laser Scan", DiagnosticStatus.STALE, "No scan yet")
        status = rospy.wait_for_message(f"/{name}/laser_status", DiagnosticStatus, PATIENCE)
        assert status.level == DiagnosticStatus.ERROR
        assert not rospy.ServiceProxy(f"/{name}/update_laser_status", Trigger)().success

    def test_it_ends_though_nobody_answers(self) -> None:
        sensor = VirtualUrg(SENSOR, Tcp(), faults=["blackhole"])
        with sensor, laser_node("lost", ip_address="127.0.0.1", ip_port=sensor.port):
            Diagnostics("lost").wait("Hardware Status", DiagnosticStatus.ERROR, "Not connected")
            rospy.wait_for_service("/lost/update_laser_status", PATIENCE)

    def test_senseless_parameters_stop_the_start(self) -> None:
        cases: list[tuple[dict[str, Any], str]] = [
            ({"angle_min": 1.0, "angle_max": 0.5}, "angle_min must be less than angle_max: 1, 0.5"),
            ({"serial_baud": 1200}, "serial_baud is not a rate of SCIP 2.0: 1200"),
            ({"angle_mni": 0.0}, "/laser_node/angle_mni: is not a known key"),
        ]
        processes = [begin(f"refused{i}", **changes) for i, (changes, _) in enumerate(cases)]
        try:
            for process, (_, message) in zip(processes, cases, strict=True):
                output, _ = process.communicate(timeout=PATIENCE)
                assert process.returncode == 1, output
                assert message in output
                assert "FATAL" in output
        finally:
            for process in processes:
                process.kill()
                process.wait()

    def test_simulated_time(self) -> None:
        """The sensor's clock is simulated time: stamps are exact, though the host's clock runs by jerks."""
        rospy.set_param("/use_sim_time", True)
        clock = rospy.Publisher("/clock", Clock, queue_size=1)
        try:
            node = laser_node("simulated", serial_port=str(self.link), time_mode="device", time_offset=0.25)
            with self.pty(fed=True) as urg, node:
                scans = Topic("/simulated/scan", LaserScan)
                starts = self.feed(urg, clock, scans, first_turn=1000)
            first_beam = SENSOR.first * SENSOR.step_time
            for scan in scans.messages:
                start = min(starts, key=lambda t, m=scan: abs(t - m.header.stamp.to_sec() + 0.25 + first_beam))
                assert abs(start + first_beam + 0.25 - scan.header.stamp.to_sec()) < 1e-6
        finally:
            rospy.set_param("/use_sim_time", False)
            clock.unregister()

    def feed(self, urg: VirtualUrg, clock: rospy.Publisher, scans: Topic, first_turn: int) -> list[float]:
        """Turn the mirror, several times as fast as it really does, until ten scans are there; return the starts."""
        starts: list[float] = []

        def turn() -> bool:
            start = (first_turn + len(starts)) * SENSOR.scan_time
            starts.append(start)
            clock.publish(Clock(rospy.Time.from_sec(start + SENSOR.scan_time)))
            urg.measure(start + SENSOR.scan_time, start, fed_ranges())
            time.sleep(0.02)
            return len(scans.messages) >= 10

        wait_for(turn, "ten scans")
        return starts

    def test_launch_files(self) -> None:
        """laser.launch, and one of the form of urg_node's own with its pkg and type changed."""
        launch = Path(self._folder.name) / "both.launch"
        with self.pty() as urg, VirtualUrg(SENSOR, Tcp()) as ethernet:
            launch.write_text(LAUNCH.format(serial=self.link, tcp=ethernet.port))
            for each in (urg, ethernet):
                each.show(fed_ranges())
            process = subprocess.Popen(["roslaunch", str(launch)], stdout=subprocess.PIPE, text=True)
            try:
                scan = Topic("/scan", LaserScan).wait(lambda m: True, "urg_node's form")
                assert (scan.header.frame_id, len(scan.ranges)) == ("base_laser", 513)  # 90 degrees are 256 steps
                Topic("/named/scan", LaserScan).wait(lambda m: len(m.ranges) == SENSOR.steps, "laser.launch")
                assert rospy.get_param("/named/laser_node/cluster") == 1  # from launch/laser_node.yaml
            finally:
                process.send_signal(signal.SIGINT)
                process.communicate(timeout=PATIENCE)

    def test_get_id(self) -> None:
        with self.pty() as urg:
            loud = subprocess.run([program("getID"), urg.address], capture_output=True, text=True, check=True)
            assert loud.stdout == f"Device at {urg.address} has ID H0000000\n"
        with VirtualUrg(SENSOR, Tcp()) as urg:
            quiet = subprocess.run(
                [program("getID"), "--quiet", urg.address], capture_output=True, text=True, check=True
            )
            assert quiet.stdout == "H0000000\n"
        with VirtualUrg(SENSOR, Tcp(), faults=["blackhole"]) as urg:
            silent = subprocess.run(
                [program("getID"), urg.address], capture_output=True, text=True, check=False, timeout=PATIENCE
            )
            assert silent.returncode == 1
            assert silent.stdout == ""


if __name__ == "__main__":
    rospy.init_node("laser_node_test", disable_signals=True)
    rostest.rosrun("kurumaisu", "laser_node_test", LaserNode, sys.argv)
