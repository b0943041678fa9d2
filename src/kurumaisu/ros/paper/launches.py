# SPDX-License-Identifier: BSD-3-Clause
"""Runs the paper's experiments that need ROS: each a launch file with a master of its own, which ends by itself."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import roslib.packages

from kurumaisu import children
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.errors import Error
from kurumaisu.paper.chair import dac_line
from kurumaisu.paper.chair.dac_line import Point
from kurumaisu.paper.laser import wall_experiment
from kurumaisu.paper.model_file import ModelFile
from kurumaisu.paper.options import PaperOptions
from kurumaisu.params import shipped

_TAIL = 15  # lines of the log shown after a failure
_PATIENCE = 20.0  # [s] of wall time for a process to start, or to end
_GLANCE = 0.05  # [s]
DEVICE, GUARD = "launch/dac/serial_ascii.yaml", "launch/guard.yaml"


def launch(arguments: Sequence[str], log: Path, deadline: float) -> None:
    """Run roslaunch until it ends. deadline [s] of wall time. Raise Error with the end of the log when it fails."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port = int(listener.getsockname()[1])
    environment = {
        **os.environ,
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_HOSTNAME": "127.0.0.1",
        "ROS_LOG_DIR": str(log.parent / "ros_log"),
    }
    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open("w", encoding="utf-8") as stream:
        command = ["roslaunch", "-p", str(port), "kurumaisu", *arguments]
        process = children.start(command, stdout=stream, stderr=subprocess.STDOUT, env=environment)
        try:
            why = _awaited(process, arguments[0], deadline)
        finally:
            children.interrupt(process, _PATIENCE)
    text = log.read_text(encoding="utf-8", errors="replace")
    if why or ("experiment: " in text and ": done, " not in text):
        tail = "\n".join(text.splitlines()[-_TAIL:])
        raise Error(f"roslaunch kurumaisu {arguments[0]} {why or 'was stopped'}; the end of {log}:\n{tail}")


def _awaited(process: subprocess.Popen[bytes], name: str, deadline: float) -> str:
    """Wait for a process to end, [s] at most; on a terminal say for how long. Return what went wrong, or nothing."""
    begin = time.monotonic()
    shown = sys.stderr.isatty()
    try:
        while (passed := time.monotonic() - begin) < deadline:
            if shown:
                print(f"\r{name}: {passed:.0f} s", end="", file=sys.stderr, flush=True)
            try:
                code = process.wait(min(1.0, deadline - passed))
            except subprocess.TimeoutExpired:
                continue
            return f"ended with code {code}" if code else ""
        return f"was not done after {deadline:.0f} s"
    finally:
        if shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)


def drive(model: Path, file: str, bag: Path, *, seed: int, speed: float) -> None:
    """Record a drive of launch/paper on the simulator, through base_node and its limits."""
    _away(bag)
    arguments = [f"model:={model}", f"file:={shipped(file)}", f"bag:={bag}", f"seed:={seed}", f"speed:={speed}"]
    launch(["identification.launch", *arguments], bag.with_suffix(".log"), 600.0)


def wall(model: Path, options: PaperOptions, folder: Path, *, seed: int, speed: float) -> None:
    """Record the simulated board through laser_node and the virtual URG into FOLDER/scans, a bag a distance."""
    wall_experiment.write_model(model, options.wall, folder / "bench.yaml")
    wall_experiment.write_script(options.wall, folder / "wall.yaml")
    for bag in sorted((folder / "scans").glob("*.bag")):
        bag.unlink()
    arguments = [f"file:={folder / 'wall.yaml'}", f"model:={folder / 'bench.yaml'}", f"bag:={folder / 'scans'}"]
    launch(["figure_12.launch", *arguments, f"seed:={seed}", f"speed:={speed}"], folder / "scans.log", 600.0)


def dac(model: Path, law: str, file: Path, folder: Path) -> list[Point]:
    """Return figure 10's points with one of a model's laws, at virtual_dac's pins behind base_node and guard."""
    own = folder / f"figure_10_{law}.yaml"
    chair = ModelFile(model)
    chair.replace(("voltage_law",), law)
    chair.write(own)
    bag, log = folder / f"figure_10_{law}.bag", folder / f"figure_10_{law}_dac.log"
    for path in (bag, log):
        _away(path)
    with tempfile.TemporaryDirectory() as place:  # a socket's path is short
        device, guard = Path(place) / "device.yaml", Path(place) / "guard.yaml"
        _rewrite(shipped(DEVICE), device, {("port",): f"{place}/dac"})
        _rewrite(shipped(GUARD), guard, {("model",): str(own), ("socket",): f"{place}/guard.sock"})
        arguments = [f"bag:={bag}", f"device:={device}", f"guard:={guard}", f"model:={own}", f"file:={file}"]
        with _board(device, f"{place}/dac", log):
            launch(["figure_10.launch", *arguments], bag.with_suffix(".log"), 180.0)
    offset = time.time() - time.monotonic()  # of ROS' time
    run = read_recording(bag).runs[0]
    assert run.command is not None
    return dac_line.points(run.command, dac_line.read_log(log, offset))


@contextmanager
def _board(device: Path, link: str, log: Path) -> Iterator[None]:
    """Run virtual_dac. Raise Error when it does not start."""
    (program, *_) = roslib.packages.find_node("kurumaisu", "virtual_dac") or [None]
    if program is None:
        raise Error("virtual_dac: is not built")
    command = [program, str(device), link, "--log", str(log)]
    process = children.start(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + _PATIENCE
        while not Path(link).exists():
            if process.poll() is not None or time.monotonic() > deadline:
                raise Error(f"virtual_dac {device} does not start")
            time.sleep(_GLANCE)
        yield
    finally:
        children.interrupt(process, _PATIENCE)


def _rewrite(source: Path, out: Path, values: dict[tuple[str, ...], str]) -> None:
    file = ModelFile(source)
    for key, value in values.items():
        file.replace(key, value)
    file.write(out)


def _away(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
