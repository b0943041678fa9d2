# SPDX-License-Identifier: BSD-3-Clause
"""critic watch: the verdict on the last minutes of a running robot, on diagnostics."""

from __future__ import annotations

import argparse
import re
import threading
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, LaserScan, Temperature

from kurumaisu import program
from kurumaisu.critic.app.options import add_effects, whole_number
from kurumaisu.critic.app.results import causes
from kurumaisu.critic.app.watch import ContinuousCritic, Heard, WatchedCriticism, Window
from kurumaisu.critic.bags import messages
from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.data.meta import Meta, read_meta, recording_of_meta
from kurumaisu.critic.data.reading import check_run, usable
from kurumaisu.critic.values.recording import Recording
from kurumaisu.critic.values.selection import effect_ids
from kurumaisu.errors import Error, one_line
from kurumaisu.msg import Voltages
from kurumaisu.params import load_model, shipped
from kurumaisu.ros import life
from kurumaisu.ros.inbox import seconds_of, subscribe

_TOPICS = {
    "command": ("cmd_vel", Twist),
    "voltage": ("voltages", Voltages),
    "pose": ("ground_truth", Odometry),
    "odom": ("odom", Odometry),
    "scan": ("scan", LaserScan),
    "battery": ("battery", BatteryState),
    "temperature": ("temperature", Temperature),
}
_NEEDED = {"poses": ("pose", "odom"), "commands": ("command", "voltage")}  # one of each
_LIMIT = 32 * 2**20  # bytes that a topic's rows may take: 10 min of scans of 682 beams at 10 Hz
_SILENT = 5.0  # [s] after which a topic that was heard is told as silent
_PERIOD = 1.0  # [s] of wall time between two messages
_LEVELS = {
    "none": DiagnosticStatus.OK,
    "named": DiagnosticStatus.WARN,
    "confounded": DiagnosticStatus.WARN,
    "unknown": DiagnosticStatus.WARN,
    "invalid_data": DiagnosticStatus.ERROR,
}
_COUNT = re.compile(r"[\d.]+ (s|Hz)")  # what changes without anything having happened
_DESCRIPTION = """\
Listen to a running robot, criticise the last minutes repeatedly in a separate
process; print and publish the verdict. Ends with ROS or Ctrl-C."""
_EPILOG = """\
subscribes to:
  cmd_vel, voltages, ground_truth, odom, scan, battery, temperature
publishes:
  diagnostics

examples:
  critic watch
  critic watch --window 300 --every 60 ground_truth:=/mocap/pose
  critic watch --meta recordings/office/meta.yaml
  rostopic echo diagnostics

More: docs/critic.md"""


class CriticWatch:
    """Hears topics in threads of their own; step, called once a second, criticises and publishes."""

    def __init__(self, options: argparse.Namespace, model: Path, meta: Meta, ids: frozenset[str] | None) -> None:
        self._model = load_model(model).name
        self._meta = meta
        self._every = options.every
        self._lock = threading.Lock()
        self._window = Window(tuple(_TOPICS), options.window, _LIMIT)
        self._rolling = ContinuousCritic(model, ids)
        self._begun = -self._every
        self._last = WatchedCriticism(None, "nothing has been criticised yet")
        self._answered: float | None = None  # ROS time [s]
        self._number = 0
        self._told: object = None
        self._problems: tuple[str, ...] = ()
        self._publisher = rospy.Publisher("diagnostics", DiagnosticArray, queue_size=1)
        self._subscribers = [
            subscribe(name, kind, partial(self._hear, part), "CRITIC_BAD_MESSAGE", queue_size=100)
            for part, (name, kind) in _TOPICS.items()
        ]

    def step(self) -> None:
        """Look for an answer, begin the next criticism if it is due, publish."""
        now = time.monotonic()
        answer = self._rolling.answer(now)
        if answer is not None:
            self._last, self._answered = answer, rospy.get_time()
            self._number += 1
        if not self._rolling.busy and now - self._begun >= self._every:
            self._begin(now)
        self._publish()

    def _begin(self, now: float) -> None:
        try:
            recording = self._recording()
        except Error as error:
            self._begun, self._last = now, WatchedCriticism(None, one_line(error))
            return
        if recording is not None:
            self._begun = now
            self._rolling.start(recording, now)

    def close(self) -> None:
        """End what was begun."""
        self._rolling.close()

    def _hear(self, part: str, message: Any) -> None:
        row, stamp = _row(part, message), _stamp(message)
        with self._lock:
            if part == "scan":
                fan, row, _ = row
                self._window.see(fan)
            if stamp is None:
                self._window.add_received(part, float(rospy.get_time()), row)
            else:
                self._window.add(part, stamp, row)

    def _recording(self) -> Recording | None:
        """Return what is in the window, None while nothing can be said of it.

        Raise Error for scans that are not of the laser of meta.yaml.
        """
        faults, meta = Faults(), self._meta
        with self._lock:
            run = self._window.run("window", faults)
        if not usable(run):
            return None
        check_run(run, meta.laser, faults)
        return recording_of_meta("window", (run,), meta, faults, train=("window",), test=())

    def _publish(self) -> None:
        with self._lock:
            now = rospy.get_time()
            topics = {part: _fares(self._window.heard(part), now) for part in _TOPICS}
        missing = _missing(topics)
        verdict = self._last.verdict
        level = DiagnosticStatus.WARN if verdict is None else _LEVELS[verdict.verdict]
        self._tell(missing)
        values = {"verdict": "" if verdict is None else verdict.verdict, "criticisms": str(self._number)}
        values["age [s]"] = "" if self._answered is None else f"{now - self._answered:.1f}"
        values["under way"] = "yes" if self._rolling.busy else "no"
        if verdict is not None:
            values["causes"] = "; ".join(causes(verdict))
            values["confounded"] = "; ".join(" | ".join(group) for group in verdict.confounded)
            values["unknown"] = "; ".join(f"{item.channel} over {item.covariate}" for item in verdict.unknown)
            values["problems"] = "; ".join(verdict.problems)
        values |= {rospy.resolve_name(_TOPICS[part][0]): words for part, (_, words) in topics.items()}
        status = DiagnosticStatus(
            level=max(level, DiagnosticStatus.WARN) if missing else level,
            name="critic: verdict",
            message=f"{missing}{self._last.headline}",
            hardware_id=self._model,
            values=[KeyValue(key, value) for key, value in values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = rospy.get_rostime()
        self._publisher.publish(message)

    def _tell(self, missing: str) -> None:
        """Print each answer, and what is missing when that is something else."""
        told = self._number, self._last.headline, _COUNT.sub("", missing)
        if told == self._told:
            return
        self._told = told
        count = f"criticism {self._number}: " if self._number else ""
        print(f"critic watch: {time.strftime('%H:%M:%S')} {count}{missing}{self._last.headline}", flush=True)


def _fares(heard: Heard, now: float) -> tuple[bool, str]:
    """Return whether a topic lives, and how it fares in words."""
    if heard.newest is None:
        return False, "never heard"
    if now - heard.newest > _SILENT:
        return False, f"silent for {now - heard.newest:.0f} s"
    rate = (heard.rows - 1) / heard.span if heard.span > 0 else 0.0
    return True, f"{rate:.1f} Hz, {heard.span:.0f} s kept"


def _missing(topics: dict[str, tuple[bool, str]]) -> str:
    """Return what is dead of what a verdict needs, in words that come before the verdict, else ''."""
    told = ""
    for what, parts in _NEEDED.items():
        if not any(topics[part][0] for part in parts):
            told += f"no {what}: {', '.join(f'{_TOPICS[part][0]} {topics[part][1]}' for part in parts)}. "
    return told


def _row(part: str, message: Any) -> Any:
    """Return a message as a row of its part; of a scan the fan, the ranges and the intensities."""
    if part == "battery":
        return (message.voltage,)
    if part == "temperature":
        return (message.temperature,)
    return messages.converter(part, message._type.replace("/", "/msg/"))(message)


def _stamp(message: Any) -> float | None:
    """Return when a message was measured [s]; None where it does not say so. Raise Error for a stamp of nonsense."""
    header = getattr(message, "header", None)
    return seconds_of(message) if header is not None and header.stamp else None


def main(arguments: Sequence[str]) -> int:
    """Watch until ROS ends; return the exit code. Raise Error for options that make no sense."""
    options = _parser().parse_args(rospy.myargv(["watch", *arguments])[1:])
    ids = effect_ids(options.only, options.without)
    meta = read_meta(options.meta) if options.meta is not None else Meta()
    model = options.model or meta.model or shipped("launch/md100.yaml")
    load_model(model)

    def node(own: life.Life) -> int:
        watch = CriticWatch(options, model, meta, ids)
        try:
            while not own.asked.wait(_PERIOD):
                watch.step()
        finally:
            watch.close()
        return 0

    return life.run("critic_watch", node)


def _parser() -> argparse.ArgumentParser:
    parser = program.text_parser("critic watch", _DESCRIPTION, _EPILOG)
    add = parser.add_argument
    add("--window", type=whole_number, default=120, metavar="S", help="seconds of driving to judge by (120)")
    add("--every", type=whole_number, default=30, metavar="S", help="seconds from one criticism to the next (30)")
    add("--model", type=Path, metavar="FILE", help="model to criticise (md100.yaml)")
    add("--meta", type=Path, metavar="FILE", help="a recording's meta.yaml: its model, world, laser and truth are used")
    add_effects(parser)
    return parser
