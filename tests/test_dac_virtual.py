# SPDX-License-Identifier: BSD-3-Clause
"""virtual_dac as a program: faults from its input, its log, and how it ends."""

import os
import signal
import subprocess
import time
from pathlib import Path

import pytest
import rospkg

EXAMPLE = Path(rospkg.RosPack().get_path("kurumaisu")) / "launch/dac/serial_ascii.yaml"
DEADLINE = 10.0  # [s] that only a failure meets
PREFIXES = os.environ["CMAKE_PREFIX_PATH"].split(":")


def program(name):
    (path,) = {path for path in (Path(prefix, "lib/kurumaisu", name) for prefix in PREFIXES) if path.exists()}
    return str(path)


@pytest.fixture
def start(tmp_path):
    """Start the board; with the folder in which `dac` is its port and `log` its log."""
    started = []

    def board(*faults, stdin=subprocess.PIPE, file=EXAMPLE):
        command = [program("virtual_dac"), str(file), str(tmp_path / "dac"), "--log", str(tmp_path / "log"), *faults]
        started.append(subprocess.Popen(command, stdin=stdin, stdout=subprocess.PIPE, text=True))
        assert started[-1].stdout.readline() == f"a virtual board at {tmp_path / 'dac'}\n"
        return started[-1]

    yield board
    for process in started:
        with process:  # closes its streams, and waits
            process.kill()


def wait_for(condition):
    deadline = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.001)


def set_voltages_at(tmp_path, *volts):
    file = tmp_path / "device.yaml"
    text = EXAMPLE.read_text().replace("port: /dev/kurumaisu_dac", f"port: {tmp_path / 'dac'}")
    text = text.replace("reply_timeout: 0.05", "reply_timeout: 2.0")  # this computer may be busy
    text = text.replace("boot: 3.0", "boot: 0.0")
    file.write_text(text.replace("late_reply: 0.1", "late_reply: 2.0"))
    return [program("set_voltages"), str(file), *map(str, volts)]


def set_voltages(tmp_path, *volts):
    command = set_voltages_at(tmp_path, *volts)
    return subprocess.run(command, input="\n", capture_output=True, text=True, timeout=DEADLINE, check=False)


def test_the_log_tells_when(start, tmp_path):
    board = start()
    before = time.monotonic_ns()
    done = set_voltages(tmp_path, 0.5, -0.2, 2.5)
    after = time.monotonic_ns()
    assert done.returncode == 0, done.stderr
    rows = [line.split() for line in (tmp_path / "log").read_text().splitlines()]
    times = [int(row[0]) for row in rows]
    assert before < times[0]
    assert times == sorted(times)
    assert times[-1] < after
    assert {row[1] for row in rows} == {"volts"}
    assert [float(word) for word in rows[4][2:]] == [float(word) for word in done.stdout.splitlines()[1].split()]
    board.stdin.write("volts\n")
    board.stdin.flush()
    assert board.stdout.readline() == done.stdout.splitlines()[2] + "\n"


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_in_neutral(start, tmp_path, end):
    start()
    command = set_voltages_at(tmp_path, 0.5, -0.2, 2.5)
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as running:
        for _ in range(2):
            running.stdout.readline()
        assert (tmp_path / "log").read_text().splitlines()[-1].split()[2] != "0.000000"
        running.send_signal(end)
        assert running.wait(DEADLINE) == 0
    assert (tmp_path / "log").read_text().splitlines()[-1].split()[2:4] == ["0.000000", "0.000000"]


def test_faults_come_from_the_input_and_the_command_line(start, tmp_path):
    board = start("wrong@1x4")
    assert "DAC_WRONG_REPLY" in set_voltages(tmp_path, 0, 0, 2.5).stderr
    board.stdin.write("deaf=1\nunplug=60\n")
    board.stdin.flush()
    assert "takes no =SECONDS" in board.stdout.readline()
    assert board.stdout.readline() == "unplug=60\n"
    assert not (tmp_path / "dac").exists()
    assert "DAC_NO_PORT" in set_voltages(tmp_path, 0, 0, 2.5).stderr
    assert (tmp_path / "log").read_text().endswith(" unplugged\n")


def test_it_ends_with_its_input_and_takes_its_link_along(start, tmp_path):
    board = start()
    board.stdin.close()
    assert board.wait(DEADLINE) == 0
    assert board.stdout.read() == "0 changes, 0 commands, 0 not understood\n"
    assert not (tmp_path / "dac").is_symlink()


def test_without_an_input_it_goes_on_until_it_is_told(start, tmp_path):
    board = start("__name:=board", stdin=subprocess.DEVNULL)  # as roslaunch starts it
    assert set_voltages(tmp_path, 0, 0, 2.5).returncode == 0
    board.send_signal(signal.SIGTERM)
    assert board.wait(DEADLINE) == 0
    assert not (tmp_path / "dac").is_symlink()


def said(log):
    return [[float(word) for word in line.split()[2:]] for line in log.read_text().splitlines()]


def held_at(scale, codes):
    return [scale * (codes[0] - codes[2]), scale * (codes[1] - codes[2]), scale * codes[2]]


@pytest.mark.parametrize("chip", ["mcp4728", "ad5592r"])
def test_a_chip_is_a_tree_of_files(start, tmp_path, chip):
    """Codes are recomputed from the scale that the tree shows, by nothing of ours."""
    tree = tmp_path / "dac"
    file = tmp_path / "device.yaml"
    file.write_text(EXAMPLE.with_name(f"{chip}.yaml").read_text().replace("/sys/bus/iio/devices", str(tree)))
    board = start(file=file)
    command = [program("set_voltages"), str(file), "0.5", "-0.2", "2.5"]
    log = tmp_path / "log"
    before = time.monotonic_ns()
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as running:
        for _ in range(2):
            running.stdout.readline()
        scale = float((tree / "iio:device0/out_voltage0_scale").read_text()) / 1000
        codes = [round(volt / scale) for volt in (0.5 + 2.5, -0.2 + 2.5, 2.5)]
        wait_for(lambda: said(log)[-1:] == [pytest.approx(held_at(scale, codes), abs=1e-5)])
    wait_for(lambda: said(log)[-1] == pytest.approx([0, 0, scale * codes[2]], abs=1e-5))
    times = [int(line.split()[0]) for line in log.read_text().splitlines()]
    assert before < times[0] <= times[-1] < time.monotonic_ns()
    board.stdin.write("unplug=60\n")
    board.stdin.flush()
    assert board.stdout.readline() == "unplug=60\n"
    assert "DAC_NO_PORT" in subprocess.run(command, input="\n", capture_output=True, text=True, check=False).stderr
    board.stdin.close()
    assert board.wait(DEADLINE) == 0
    assert not tree.exists()


def test_a_chip_comes_back_with_the_codes_it_had(start, tmp_path):
    tree = tmp_path / "dac"
    file = tmp_path / "device.yaml"
    file.write_text(EXAMPLE.with_name("mcp4728.yaml").read_text().replace("/sys/bus/iio/devices", str(tree)))
    board = start(file=file)
    raw = tree / "iio:device0/out_voltage0_raw"
    raw.write_text("1234\n")
    log = tmp_path / "log"
    wait_for(lambda: "volts" in log.read_text())
    board.stdin.write("unplug=0.05\n")
    board.stdin.flush()
    wait_for(lambda: log.read_text().endswith(" plugged\n"))
    assert raw.read_text() == "1234\n"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "DEVICE.yaml PLACE"),
        ([str(EXAMPLE.with_name("mcp4728.yaml")), "no/such/folder"], "no/such/folder"),
        ([str(EXAMPLE.with_name("mcp4728.yaml")), "."], "exists already"),
        ([str(EXAMPLE.with_name("mcp4728.yaml")), "chip", "deaf"], "can only be unplugged"),
        ([str(EXAMPLE.with_name("dacs_82ada_unverified.yaml")), "dac"], "manual"),
        ([str(EXAMPLE), "dac", "sulk"], "no such fault"),
        ([str(EXAMPLE), "no/such/folder"], "no/such/folder"),
    ],
)
def test_refusals(arguments, words, tmp_path):
    command = [program("virtual_dac"), *arguments]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, cwd=tmp_path, text=True, check=False)
    assert done.returncode != 0
    assert words in done.stderr
    assert not (tmp_path / "dac").is_symlink()
