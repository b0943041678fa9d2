# SPDX-License-Identifier: BSD-3-Clause
"""systemd's unit of the chair's nodes: it parses, starts them anew, and lets no other computer in."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
TEMPLATE = ROOT / "launch/systemd/kurumaisu-robot.service.in"
GUARD = ROOT / "launch/systemd/kurumaisu-guard.service.in"


@pytest.fixture
def unit(tmp_path):
    """Return the unit as CMake makes it, for an install space in which env.sh is nothing."""
    start = tmp_path / "prefix/env.sh"
    start.parent.mkdir()
    start.write_text("#!/bin/sh\n")
    start.chmod(0o755)
    text = TEMPLATE.read_text().replace("@CMAKE_INSTALL_PREFIX@", str(start.parent))
    path = tmp_path / "kurumaisu-robot.service"
    path.write_text(text.replace("@PROJECT_NAME@", "kurumaisu"))
    return path


def entries(path):
    lines = [line for line in path.read_text().splitlines() if re.match(r"\w+=", line)]
    found = {}
    for key, value in (line.split("=", 1) for line in lines):
        found.setdefault(key, []).append(value)
    return found


def test_systemd_understands_the_unit(unit):
    if not shutil.which("systemd-analyze"):
        pytest.skip("no systemd-analyze here")
    command = ["systemd-analyze", "verify", "--man=no", str(unit)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert [line for line in (done.stdout + done.stderr).splitlines() if unit.name in line or "prefix" in line] == []


def test_it_starts_what_ended_anew(unit):
    """roslaunch ends with 0 when a required node has ended."""
    got = entries(unit)
    assert got["Restart"] == ["always"]
    assert got["StartLimitIntervalSec"] == ["0"]
    assert got["KillSignal"] == ["SIGINT"]
    assert "roslaunch kurumaisu robot.launch $ARGUMENTS" in got["ExecStart"][0]
    robot, base = ((ROOT / f"launch/{name}.launch").read_text() for name in ("robot", "base"))
    assert re.search(r'name="launch_watch" required="true"', robot)
    assert re.search(r'name="base_node" required="true"', base)


def test_no_other_computer_gets_in(unit):
    got = entries(unit)
    assert (got["IPAddressDeny"], got["IPAddressAllow"]) == (["any"], ["localhost"])
    assert "ROS_HOSTNAME=localhost" in got["Environment"][0]


def test_it_may_use_the_guard(unit):
    assert entries(unit)["Group"] == entries(GUARD)["Group"]  # whose socket is that group's
    assert entries(unit)["After"] == ["kurumaisu-guard.service"]
    assert int(entries(unit)["LimitRTPRIO"][0]) >= 20
