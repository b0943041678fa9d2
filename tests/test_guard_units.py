# SPDX-License-Identifier: BSD-3-Clause
"""systemd's unit and udev's rules of the D/A converter's guard: they parse, and say what the guard rests on."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
TEMPLATE = ROOT / "launch/systemd/kurumaisu-guard.service.in"
RULES = ROOT / "launch/udev/60-kurumaisu-dac.rules"
FILES = ("lib/kurumaisu/guard", "share/kurumaisu/launch/guard.yaml", "share/kurumaisu/launch/dac/serial_ascii.yaml")


def rendered(prefix):
    """Return the unit as CMake makes it for an install prefix."""
    text = TEMPLATE.read_text().replace("@CMAKE_INSTALL_PREFIX@", str(prefix)).replace("@PROJECT_NAME@", "kurumaisu")
    assert "@" not in text
    return text


@pytest.fixture
def unit(tmp_path):
    """Return a unit whose files exist, and are nothing."""
    prefix = tmp_path / "prefix"
    for name in FILES:
        (prefix / name).parent.mkdir(parents=True, exist_ok=True)
        (prefix / name).write_text("#!/bin/sh\n")
        (prefix / name).chmod(0o755)
    path = tmp_path / "kurumaisu-guard.service"
    path.write_text(rendered(prefix))
    return path


def entries(path):
    """Return (section, key) -> values; a line that is neither fails."""
    found, section = {}, ""
    for line in path.read_text().splitlines():
        if match := re.fullmatch(r"\[(\w+)\]", line):
            section = match[1]
        elif line and not line.startswith("#"):
            key, value = re.fullmatch(r"(\w+)=(.*)", line).groups()
            found.setdefault((section, key), []).append(value)
    return found


def test_systemd_understands_the_unit(unit):
    if not shutil.which("systemd-analyze"):
        pytest.skip("no systemd-analyze here")
    command = ["systemd-analyze", "verify", "--man=no", str(unit)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert [line for line in (done.stdout + done.stderr).splitlines() if unit.name in line or "prefix" in line] == []
    unit.write_text(unit.read_text().replace("WatchdogSec=", "WatchdogSecs="))
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert "WatchdogSecs" in done.stdout + done.stderr  # or the check above says nothing


def test_the_unit_covers_the_guard_in_every_way(unit):
    got = entries(unit)
    settings = yaml.safe_load((ROOT / "launch/guard.yaml").read_text())
    assert got["Service", "Type"] == ["notify"]
    assert got["Service", "Restart"] == ["always"]
    assert got["Service", "ExecStopPost"] == [got["Service", "ExecStart"][0].replace("guard $", "guard --neutral $", 1)]
    assert float(got["Service", "WatchdogSec"][0]) > 2 * settings["sentinel_silence"]
    assert float(got["Service", "TimeoutStopSec"][0]) > settings["sentinel_silence"] + settings["neutral_patience"]
    assert settings["socket"].startswith(f"/run/{got['Service', 'RuntimeDirectory'][0]}/")
    assert int(got["Service", "LimitRTPRIO"][0]) >= settings["priority"]


def test_every_path_in_the_unit_is_one_of_what_is_installed(unit):
    prefix = str(unit.parent / "prefix")
    named = {path.removeprefix(prefix + "/") for path in re.findall(rf"{re.escape(prefix)}/[\w./]+", unit.read_text())}
    assert named == set(FILES)
    assert (
        "install(TARGETS guard RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})"
        in (ROOT / "src/guard/CMakeLists.txt").read_text()
    )
    assert all((ROOT / name.removeprefix("share/kurumaisu/")).exists() for name in named if name.startswith("share"))


def test_udev_rules_are_assignments_and_matches():
    part = r'[A-Z]+(\{\w+\})?(==|!=|=|\+=)"[^"]*"'
    lines = [line for line in RULES.read_text().splitlines() if line and not line.startswith("#")]
    assert lines
    for line in lines:
        assert re.fullmatch(rf"{part}(, {part})*", line), line
    links = re.findall(r'SYMLINK\+="(\w+)"', RULES.read_text())
    files = [yaml.safe_load(path.read_text()) for path in (ROOT / "launch/dac").glob("*.yaml")]
    assert {device["port"] for device in files if str(device.get("port", "")).startswith("/dev/")} == {
        f"/dev/{links[0]}"
    }
    chips = re.search(r'ATTR\{name\}=="([^"]+)"', RULES.read_text())[1].split("|")
    assert sorted(chips) == sorted(device["device"] for device in files if device["kind"] == "iio")
