# SPDX-License-Identifier: BSD-3-Clause
"""The guard as a person starts it: in a terminal, which closes or which nobody reads; with streams that are closed."""

import contextlib
import itertools
import os
import pty
import re
import subprocess
import threading
import time
import tty

import pytest
import yaml

from kurumaisu.bench.guard_client import RawClient
from kurumaisu.bench.guard_rig import Rig
from kurumaisu.bench.processes import program
from kurumaisu.params import shipped

PATIENCE = 10.0  # [s]
PERIOD = 0.02  # [s] of a client
SILENT = 0.5  # [s] without an answer, on a busy machine


class Terminal(Rig):
    """Sentinel and guard in a terminal of their own."""

    def start(self):
        self.pid, self.terminal = pty.fork()
        if self.pid == 0:
            os.execv(program("guard"), ["guard", str(self.device), str(self.settings)])

    def end(self):
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, 9)
            os.waitpid(self.pid, 0)


class Driver(threading.Thread):
    """Drives until it is told to stop; answered: the times [s, monotonic] at which the guard did."""

    def __init__(self, rig):
        super().__init__(daemon=True)
        self.client, self.stop, self.answered = RawClient(rig.socket), False, []
        self.client.arm(0.5)
        self.start()

    def run(self):
        with contextlib.suppress(OSError):  # of a guard that has ended
            while not self.stop:
                self.client.put(0.4)
                if self.client.answers():
                    self.answered.append(time.monotonic())
                time.sleep(PERIOD)


def wait_for(condition, what):
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.01)


@pytest.fixture
def driven(tmp_path):
    """Yield a rig that drives, and its driver."""
    rig = Terminal(tmp_path)
    with rig.board():
        rig.start()
        wait_for(rig.socket.exists, "the socket")
        driver = Driver(rig)
        wait_for(lambda: rig.changes() and rig.changes()[-1].neutral is False, "motion")
        yield rig, driver
        driver.stop = True
        driver.join()


@pytest.mark.parametrize(
    "act",
    [
        pytest.param(lambda rig: os.close(rig.terminal), id="closed"),
        pytest.param(lambda rig: os.write(rig.terminal, b"\x1c"), id="Ctrl-backslash"),
        pytest.param(lambda rig: os.write(rig.terminal, b"\x1a"), id="Ctrl-Z"),
        pytest.param(lambda rig: os.write(rig.terminal, b"\x03"), id="Ctrl-C"),
    ],
)
def test_what_a_terminal_does_is_followed_by_neutral(driven, act):
    rig, _ = driven
    begin = time.monotonic()
    act(rig)
    since = rig.neutral(PATIENCE, after=begin)
    assert since is not None
    assert since - begin < 1.0  # how soon, scripts/bench base_faults tells
    wait_for(lambda: not rig.socket.exists() or os.waitpid(rig.pid, os.WNOHANG) != (0, 0), "the end")


def test_a_terminal_that_nobody_reads_keeps_nobody_waiting(driven):
    rig, driver = driven
    begin = time.monotonic()
    for _ in range(3000):  # each is two lines
        with contextlib.suppress(BlockingIOError):
            RawClient(rig.socket).close()
    answered = [t for t in driver.answered if t > begin - SILENT] + [time.monotonic()]
    assert max(b - a for a, b in itertools.pairwise(answered)) < SILENT
    os.set_blocking(rig.terminal, False)
    said = b""

    def dropped():
        nonlocal said
        with contextlib.suppress(BlockingIOError):
            said += os.read(rig.terminal, 65536)
        RawClient(rig.socket).close()
        return b"GUARD_LOG_DROPPED: " in said

    wait_for(dropped, "how many lines were dropped")


@pytest.mark.parametrize("closed", ["2>&-", "<&- 2>&-", "<&- >&- 2>&-"])
def test_with_streams_that_are_closed_no_message_goes_to_the_board(tmp_path, closed):
    ours, board = pty.openpty()
    tty.setraw(board)
    rig = Rig(tmp_path, device={"port": os.ttyname(board), "boot": 0.2}, guard={"neutral_patience": 0.5})
    os.close(board)
    command = ["bash", "-c", f'exec "$0" --neutral "$@" {closed}', program("guard"), str(rig.device), str(rig.settings)]
    process = subprocess.Popen(command)
    heard = bytearray()
    os.set_blocking(ours, False)
    while process.poll() is None:
        with contextlib.suppress(OSError):
            heard += os.read(ours, 4096)
        time.sleep(0.01)
    os.close(ours)
    assert process.returncode == 1  # the board said nothing
    assert re.fullmatch(rb"(ID\?\r)+", heard), heard


def test_the_limits_that_ship_allow_what_base_node_may_ask_for_in_a_tick():
    guard, base = (yaml.safe_load(shipped(f"launch/{name}.yaml").read_text()) for name in ("guard", "base_node"))
    for axis in ("translation", "steering"):
        limits = guard["limits"][axis]
        assert limits["rate"] / base["rate"] >= limits["step"]  # test_guard_steps: a tick asks for less than a step
