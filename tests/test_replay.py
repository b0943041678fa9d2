# SPDX-License-Identifier: BSD-3-Clause
"""record.launch and replay.launch: what is run again on a recording is what ran when it was recorded."""

import contextlib
import math
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import rosbag

from kurumaisu.bench.processes import master

PATIENCE = 60.0  # [s] of wall time for a process to end
TICK = 0.02  # [s] of base_node
DRIVES = (("0.5", "0.4"), ("-0.2", "0.5"))  # v [m/s], w [rad/s]


@contextlib.contextmanager
def running(*command: str, environment: dict[str, str]) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        process.wait(PATIENCE)


def wait_for_file(path: Path) -> None:
    """The program `rosbag` is a wrapper, which may end before the recorder itself has named the bag."""
    deadline = time.monotonic() + PATIENCE
    while not path.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert path.exists()


def wait_for_message(topic: str, environment: dict[str, str]) -> None:
    command = ["rostopic", "echo", "-n", "1", "--noarr", topic]
    subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, timeout=PATIENCE, check=True)


def record(bag: Path) -> None:
    """Record the simulator driven this way and that."""
    with master() as environment, running("roslaunch", "kurumaisu", "sim.launch", environment=environment):
        wait_for_message("/odom", environment)
        with running("roslaunch", "kurumaisu", "record.launch", f"bag:={bag}", environment=environment):
            wait_for_file(Path(f"{bag}.active"))
            wait_for_message("/scan", environment)
            for v, w in DRIVES:
                twist = f"{{linear: {{x: {v}}}, angular: {{z: {w}}}}}"
                with contextlib.suppress(subprocess.TimeoutExpired):
                    subprocess.run(
                        ["rostopic", "pub", "-r", "20", "/cmd_vel", "geometry_msgs/Twist", twist],
                        env=environment,
                        timeout=3.0,
                        stdout=subprocess.DEVNULL,
                        check=True,
                    )
            wait_for_message("/scan", environment)
        wait_for_file(bag)


def replay(bag: Path, out: Path) -> None:
    """Replay it and record what the re-run base says beside what was recorded."""
    topics = ["/odom", "/recorded/odom", "/voltages", "/recorded/voltages", "/scan", "/tf", "/recorded/tf"]
    with master() as environment, running("rosbag", "record", "-O", str(out), *topics, environment=environment):
        wait_for_file(Path(f"{out}.active"))
        command = ["roslaunch", "kurumaisu", "replay.launch", f"bag:={bag}"]
        subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, timeout=PATIENCE, check=True)
    wait_for_file(out)


def poses(bag: rosbag.Bag, topic: str) -> np.ndarray:
    """Return t, x, y, heading (n, 4) of an odometry topic."""
    rows = []
    for _, message, _ in bag.read_messages(topic):
        p, q = message.pose.pose.position, message.pose.pose.orientation
        rows.append((message.header.stamp.to_sec(), p.x, p.y, 2 * math.atan2(q.z, q.w)))
    return np.array(rows)


def test_the_base_run_again_goes_where_it_went(tmp_path):
    bag, out = tmp_path / "drive.bag", tmp_path / "again.bag"
    record(bag)
    with rosbag.Bag(bag) as recorded:
        info = recorded.get_type_and_topic_info().topics
        names = {topic.lstrip("/") for topic in info}
        assert {"cmd_vel", "voltages", "odom", "scan", "ground_truth", "tf", "tf_static"} <= names
    replay(bag, out)
    with rosbag.Bag(out) as both:
        then, now = poses(both, "/recorded/odom"), poses(both, "/odom")
        assert both.get_message_count("/scan") > 10
        frames = {t.child_frame_id for _, m, _ in both.read_messages("/tf") for t in m.transforms}
    assert frames == {"base_link"}  # of the base that runs now; the recorded tf is out of the way
    assert np.hypot(*np.diff(then[:, 1:3], axis=0).T).sum() > 1.0  # it has driven
    at = np.interp(then[-1, 0], now[:, 0], now[:, 1]), np.interp(then[-1, 0], now[:, 0], now[:, 2])
    # Each of two starts and two ends of commands may be taken a tick earlier or later.
    assert math.dist(at, then[-1, 1:3]) < 4 * 0.5 * TICK + 0.02
    heading = np.interp(then[-1, 0], now[:, 0], np.unwrap(now[:, 3])) - np.unwrap(then[:, 3])[-1]
    assert abs(math.remainder(heading, 2 * math.pi)) < 4 * 0.5 * TICK + 0.02
