# SPDX-License-Identifier: BSD-3-Clause
"""Records a drive and looks meanwhile whether it excites what a calibration must know. It commands nothing."""

from __future__ import annotations

import threading
import time
from functools import partial
from pathlib import Path

import numpy as np
from nav_msgs.msg import Odometry

from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.msg import Voltages
from kurumaisu.paper.chair import advice
from kurumaisu.paper.options import PaperOptions
from kurumaisu.ros import life
from kurumaisu.ros.inbox import seconds_of, subscribe
from kurumaisu.ros.messages import command_of
from kurumaisu.ros.recorder import Recorder
from kurumaisu.ros.rotation import planar
from kurumaisu.types import FloatArray

_TOPICS = ("voltages", "ground_truth", "odom", "scan", "cmd_vel_out", "/tf_static")
_GLANCE = 0.05  # [s] of wall time
_ROWS = 10**6  # of a topic at most, the newest: hours


class Received:
    """What came so far: poses of ground_truth, of odom where there is none; voltages."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._rows: dict[str, list[tuple[float, ...]]] = {"voltages": [], "ground_truth": [], "odom": []}
        subscribe("voltages", Voltages, self._voltages, "CALIBRATE_BAD_VOLTAGES", queue_size=1000)
        for topic in ("ground_truth", "odom"):
            subscribe(topic, Odometry, partial(self._pose, topic), "CALIBRATE_BAD_POSE", queue_size=1000)

    def run(self) -> Run | None:
        """Return what was heard as a run, or None while voltages or poses have not come."""
        with self._lock:
            tables = {name: _table(rows) for name, rows in self._rows.items() if len(rows) > 1}
        pose = tables.get("ground_truth", tables.get("odom"))
        if pose is None or "voltages" not in tables:
            return None
        pose[:, 3] = np.unwrap(pose[:, 3])
        volts = tables["voltages"]
        columns = ("v_f", "v_s", "v", "w") if np.nan_to_num(volts[:, 3:]).any() else ("v_f", "v_s")
        return Run(
            "drive",
            voltage=Series.of_table(volts[:, : 1 + len(columns)], *columns),
            pose=Series.of_table(pose, "x", "y", "theta"),
        )

    @property
    def measured(self) -> bool:
        """Whether a reference measures the pose."""
        return bool(self._rows["ground_truth"])

    def _voltages(self, m: Voltages) -> None:
        volts = command_of(m)
        self._add("voltages", (seconds_of(m), volts.v_f, volts.v_s, m.v, m.w))

    def _pose(self, name: str, m: Odometry) -> None:
        self._add(name, (seconds_of(m), *planar(m.pose.pose).tolist()))

    def _add(self, name: str, row: tuple[float, ...]) -> None:
        with self._lock:
            rows = self._rows[name]
            if not rows or row[0] > rows[-1][0]:
                rows.append(row)
            del rows[:-_ROWS]


def _table(rows: list[tuple[float, ...]]) -> FloatArray:
    return np.array(rows, dtype=np.float64)


def record(bag: Path, options: PaperOptions, every: float, split: int) -> int:
    """Record until nothing is missing, or Ctrl-C; return 0, or 1 when something is. What Recorder refuses is logged."""
    return life.run("calibrate", partial(_record, bag, options, every, split), anonymous=True)


def _record(bag: Path, options: PaperOptions, every: float, split: int, own: life.Life) -> int:
    heard = Received()
    recorder = Recorder(bag, _TOPICS, split=split)
    said: list[str] = []
    missing = ["nothing was heard yet"]
    try:
        due = time.monotonic() + every
        while missing and not own.asked.is_set():
            if time.monotonic() >= due:
                recorder.check()
                missing = _look(heard, options)
                if missing != said:
                    _tell(missing, heard)
                said = missing
                due = time.monotonic() + every
            time.sleep(_GLANCE)
    finally:
        recorder.close()
    names = " ".join(map(str, recorder.bags))
    print(
        f"calibrate: {names}: {'enough' if not missing else 'not enough; --keep branches, or drive again'}", flush=True
    )
    return int(bool(missing))


def _look(heard: Received, options: PaperOptions) -> list[str]:
    run = heard.run()
    if run is None:
        return ["no voltages, or no poses on ground_truth or odom"]
    return advice.missing([run], options)


def _tell(missing: list[str], heard: Received) -> None:
    reference = "" if heard.measured else " (judged by odom, without ground_truth; the particle filter decides later)"
    print(f"\nstill missing{reference}:" if missing else "\nnothing is missing", flush=True)
    for words in missing:
        print(f"  {words}", flush=True)
