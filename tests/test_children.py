# SPDX-License-Identifier: BSD-3-Clause
"""What a program starts ends with it, however it ends."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from kurumaisu import children

TREE = Path(__file__).resolve().parents[1]
PATIENCE = 20.0  # [s]
PARENT = """
import sys, threading, time
from kurumaisu import children
begin = lambda: print(children.start(sys.argv[1:], start_new_session=True).pid, flush=True)
thread = threading.Thread(target=begin)
thread.start()
thread.join()  # the thread that asked for it ends long before the program
time.sleep(60)
"""


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except FileNotFoundError:
        return False


def until(condition) -> bool:
    deadline = time.monotonic() + PATIENCE
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.02)
    return condition()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT], ids=lambda number: number.name)
def test_a_child_ends_when_its_parent_is_ended(number):
    with subprocess.Popen([sys.executable, "-c", PARENT, "sleep", "60"], stdout=subprocess.PIPE, text=True) as parent:
        child = int(parent.stdout.readline())
        time.sleep(0.5)
        assert alive(child)
        parent.send_signal(number)
        parent.wait(PATIENCE)
        assert until(lambda: not alive(child))


def test_the_process_is_the_program_itself(tmp_path):
    """Its number, its exit code, its arguments as they are."""
    process = children.start(
        ["sh", "-c", 'echo "$$:$1:$PPID"; exit 7', "sh", "a  b$"], stdout=subprocess.PIPE, text=True
    )
    said, _ = process.communicate(timeout=PATIENCE)
    assert said == f"{process.pid}:a  b$:{os.getpid()}\n"
    assert process.returncode == 7


def test_a_program_that_is_missing_says_so(tmp_path):
    process = children.start([str(tmp_path / "missing")], stderr=subprocess.PIPE, text=True)
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 127
    assert "missing" in said
    with pytest.raises(OSError, match="nowhere"):
        children.start(["true"], cwd="/nowhere")


def test_it_is_interrupted_and_killed_when_it_is_deaf():
    deaf = children.start(["sh", "-c", 'trap "" INT; echo on; while :; do sleep 0.1; done'], stdout=subprocess.PIPE)
    deaf.stdout.readline()
    children.interrupt(deaf, 0.3)
    assert deaf.returncode == -signal.SIGKILL
    heeds = children.start(["sleep", "60"])
    children.interrupt(heeds, PATIENCE)
    assert heeds.returncode == -signal.SIGINT


def test_every_long_process_is_started_so():
    """Not by Popen itself, but for the critic's worker, which ends when its connection closes."""
    found = [
        path for path in (TREE / "src/kurumaisu").rglob("*.py") if re.search(r"\bPopen\(|os\.fork\(", path.read_text())
    ]
    names = {str(path.relative_to(TREE / "src/kurumaisu")) for path in found}
    assert names == {"children.py", "critic/processes/worker.py"}


def test_a_child_has_the_environment_that_it_was_given(tmp_path):
    given = {**os.environ, "PWD": "/where/roslaunch/was/called"}
    with children.start(["env"], env=given, cwd=tmp_path, stdout=subprocess.PIPE, text=True) as child:
        said = dict(line.split("=", 1) for line in child.communicate()[0].splitlines() if "=" in line)
    assert said["PWD"] == given["PWD"]
