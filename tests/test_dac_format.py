# SPDX-License-Identifier: BSD-3-Clause
"""A board in Python, which shares no code with the one in C++: frames are what Python's own format() makes of them."""

import os
import pty
import random
import select
import subprocess
import threading
import tty
from pathlib import Path

import pytest
import rospkg
import yaml

SHARE = Path(rospkg.RosPack().get_path("kurumaisu"))
EXAMPLE = SHARE / "launch/dac/serial_ascii.yaml"
DEADLINE = 10.0  # [s] that only a failure meets


class Board(threading.Thread):
    """Answer every line with "OK" at a pty until it is closed; keep the lines."""

    def __init__(self):
        super().__init__(daemon=True)
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        self.port = os.ttyname(self.slave)
        self.lines = []
        self.closing = os.pipe()
        self.start()

    def run(self):
        text = b""
        while self.closing[0] not in select.select([self.master, self.closing[0]], [], [])[0]:
            text += os.read(self.master, 4096)
            *lines, text = text.split(b"\r")
            for line in lines:
                self.lines.append(line.decode())
                os.write(self.master, b"OK\r")

    def close(self):
        os.close(self.closing[1])
        self.join(DEADLINE)
        for descriptor in (self.master, self.slave, self.closing[0]):
            os.close(descriptor)


@pytest.fixture(scope="module")
def program():
    (path,) = {path for path in map(Path, _programs()) if path.exists()}
    return path


def _programs():
    prefixes = os.environ["CMAKE_PREFIX_PATH"].split(":")
    return {f"{prefix}/lib/kurumaisu/set_voltages" for prefix in prefixes}


def put_out(program, device, folder, volts):
    """Return the lines that the board got, and what the program says is held, for the first and the asked voltages."""
    board = Board()
    try:
        device = dict(device, port=board.port)
        file = folder / "device.yaml"
        file.write_text(yaml.safe_dump(device))
        command = [program, str(file), *map(repr, volts)]
        done = subprocess.run(command, input="\n", text=True, capture_output=True, timeout=DEADLINE, check=False)
    finally:
        board.close()
    assert done.returncode == 0, done.stderr
    return board.lines, [[float(word) for word in line.split()] for line in done.stdout.splitlines()]


def half_away(value):
    return int(abs(value) + 0.5) * (1 if value >= 0 else -1)


def expected(device, volts):
    """Return (signal, code, pin) of each channel, by the words of docs/dac.md."""
    rows, reference = [], 0.0
    for signal, volt in zip(("reference", "translation", "steering"), (volts[2], volts[0], volts[1]), strict=True):
        channel = device["channels"][signal]
        band, code = channel["volt"], channel["code"]
        zero = reference if channel.get("add_reference") else 0.0
        pin = min(max(volt, band["min"]), band["max"]) + zero
        number = half_away(code["per_volt"] * pin + code["at_zero"])
        edge = [(value + zero) * code["per_volt"] + code["at_zero"] for value in (band["min"], band["max"])]
        if not min(edge) - 1e-9 <= number <= max(edge) + 1e-9:
            number += 1 if number < min(edge) else -1
        number = min(max(number, code["min"]), code["max"])
        pin = (number - code["at_zero"]) / code["per_volt"]
        reference = pin if signal == "reference" else reference
        rows.append((signal, number, pin))
    return rows


HEADS = ("W{ch}", "{ch}=", "set {ch} {{x}} ")
CODES = ("{code}", "{code:d}", "{code:6d}", "{code:05d}", "{code:x}", "{code:04X}", "{code:7x}")
PINS = ("{volt:.0f}", "{volt:.3f}", "{volt:+.4f}", "{volt:08.3f}", "{volt:+9.2f}")
ODD = (0.0, -0.0, 1e300, -1e300, 5e-324)


@pytest.mark.parametrize("seed", range(25))
def test_frames_are_what_python_makes_of_them(program, tmp_path, seed):
    chance = random.Random(seed)
    either = [chance.choice(ODD) if chance.random() < 0.3 else chance.uniform(-3, 3) for _ in range(2)]
    volts = (*either, chance.uniform(2.3, 2.7))
    ch, code, pin = (chance.choice(choices) for choices in (HEADS, CODES, PINS))
    one_frame = chance.random() < 0.5
    device = yaml.safe_load(EXAMPLE.read_text())
    device.update(can_identify=False, start=[], reply_timeout=1.0, late_reply=1.0)
    one = f"{ch}{code} {pin}"
    signals = ("reference", "translation", "steering")
    if one_frame:
        one = ";".join(one.replace("{c", "{" + s + ".c").replace("{v", "{" + s + ".v") for s in signals)
    device["write"] = {"frame": "all" if one_frame else "channel", "send": one, "expect": "OK"}
    lines, held = put_out(program, device, tmp_path, volts)

    rows = expected(device, volts)
    fields = {s: {"ch": device["channels"][s]["ch"], "code": number, "volt": value} for s, number, value in rows}
    if one_frame:
        wanted = [one.format(**{s: type(s, (), fields[s]) for s in signals})]
    else:
        wanted = [one.format(**fields[s]) for s in signals]
    count = len(wanted)
    assert len(lines) == 3 * count  # neutral, as asked, neutral
    assert lines[count : 2 * count] == wanted
    reference = rows[0][2]
    assert held[1] == pytest.approx([rows[1][2] - reference, rows[2][2] - reference, reference], abs=2e-6)
    assert held[0][:2] == pytest.approx([0.0, 0.0], abs=0.51 / 819)
    assert held[2] == held[0]


@pytest.mark.parametrize("volts", [(float("nan"), 0.0, 2.5), (0.0, float("inf"), 2.5)])
def test_a_voltage_that_is_none_is_refused_and_neutral_was_sent(program, tmp_path, volts):
    device = yaml.safe_load(EXAMPLE.read_text())
    device.update(can_identify=False, start=[])
    device["write"]["expect"] = "OK"
    with pytest.raises(AssertionError, match="is not finite"):
        put_out(program, device, tmp_path, volts)
