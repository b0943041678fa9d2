# SPDX-License-Identifier: BSD-3-Clause
"""The chair's scan: published by the simulator itself, or made by a driver of the virtual URG that it feeds."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Protocol

import rospy
from sensor_msgs.msg import LaserScan

from kurumaisu.params import Laser
from kurumaisu.ros import messages
from kurumaisu.ros.sim.settings import SimSettings
from kurumaisu.sim.chair.scanner import Scan
from kurumaisu.virtual_urg import load_sensor
from kurumaisu.virtual_urg.chair_laser import VirtualLaser, check_fan, remainder

_NS = 1_000_000_000
_GLANCE = 0.02  # [s] of wall time in which a service is noticed by who waits for a scan


class LaserOutput(Protocol):
    """Where the scans of the simulator go; times are those of /clock [ns], epoch: at the simulation's time 0."""

    def publish(self, scan: Scan, epoch: int) -> None:
        """Publish a scan that has just ended, before /clock says so."""

    def advance(self, now: int, scan: Scan | None, epoch: int) -> None:
        """Tell the time, after every step and /clock, and the scan that has ended in it, if one has."""

    def wait(self, hurry: Callable[[], bool]) -> None:
        """Let who makes scans of it keep up, unless something is in a hurry."""

    def close(self) -> None:
        """End."""


class DirectLaser:
    """The topic `scan`."""

    def __init__(self, laser: Laser, topic: str) -> None:
        self._laser = laser
        self._topic = rospy.Publisher(topic, LaserScan, queue_size=10)

    def publish(self, scan: Scan, epoch: int) -> None:
        """Send it."""
        first_beam = messages.stamp_of(epoch + round(scan.time * _NS))
        self._topic.publish(messages.laser_scan(first_beam, self._laser, scan.ranges))

    def advance(self, now: int, scan: Scan | None, epoch: int) -> None:
        """Nobody asks for it."""

    def wait(self, hurry: Callable[[], bool]) -> None:
        """Whoever hears it later than others is on his own."""

    def close(self) -> None:
        """Nothing is held."""


class DrivenLaser:
    """The virtual URG; `scan` is heard, to know that its driver keeps up. What it is fed goes out on `~scan`."""

    def __init__(self, laser: Laser, device: VirtualLaser, patience: float) -> None:
        """Advertise; patience [s] of wall time: how long simulated time waits for a scan."""
        self._direct = DirectLaser(laser, "~scan")
        self._device = device
        self._patience = patience
        self._news = threading.Condition()  # over what follows
        self._owed: float | None = None  # stamp [s] of the scan that has not come back
        self._given_up = True  # until one comes
        self._late = 0
        self._driver = rospy.Subscriber("scan", rospy.AnyMsg, self._hear, queue_size=10, tcp_nodelay=True)

    def publish(self, scan: Scan, epoch: int) -> None:
        """Send it for comparison."""
        self._direct.publish(scan, epoch)

    def advance(self, now: int, scan: Scan | None, epoch: int) -> None:
        """Turn the sensor's clock on, and give it the scan."""
        if scan is None:
            self._device.advance(now, None, epoch)
            return
        with self._news:  # before it is sent: the driver may be faster than this thread
            self._owed = None if self._given_up else scan.time + epoch / _NS
        if not self._device.advance(now, scan, epoch):
            with self._news:
                self._owed = None

    def wait(self, hurry: Callable[[], bool]) -> None:
        """Wait until the driver has published the scan that was fed last, within patience."""
        with self._news:
            deadline = time.monotonic() + self._patience
            while self._owed is not None and self._driver.get_num_connections() and not hurry():
                remaining = deadline - time.monotonic()
                if remaining <= 0:
                    self._give_up(self._owed)
                    return
                self._news.wait(min(remaining, _GLANCE))

    def close(self) -> None:
        """Unplug it."""
        self._driver.unregister()
        self._device.close()

    def _give_up(self, owed: float) -> None:
        self._owed, self._given_up = None, True
        self._late += 1
        rospy.logwarn_throttle(
            10.0,
            f"SIM_LASER_LATE no scan came back within {self._patience:g} s of {owed:.3f} s of the clock: "
            f"time continues; {self._late} times so far, {self._device.counters['dropped']} scans dropped",
        )

    def _hear(self, message: rospy.AnyMsg) -> None:
        with self._news:
            self._owed, self._given_up = None, False
            self._news.notify_all()


def laser_output(settings: SimSettings) -> DirectLaser | DrivenLaser:
    """Return what is chosen. Raise Error naming model and sensor where they contradict each other."""
    laser, driver = settings.model.laser, settings.driver
    if driver is None:
        return DirectLaser(laser, "scan")
    sensor = load_sensor(driver.sensor)
    check_fan(laser, sensor, driver.model)
    device = VirtualLaser(sensor, laser, driver.port, driver.faults, driver.intensity)
    late = remainder(sensor, round(settings.start_time * _NS))
    rospy.loginfo(
        f"SIM_LASER_PORT {sensor.model.name} at {device.address}; SIM_LASER_REMAINDER its clock of milliseconds makes "
        f"stamps late by {late:.9f} s"
    )
    return DrivenLaser(laser, device, driver.patience)
