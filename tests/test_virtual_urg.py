# SPDX-License-Identifier: BSD-3-Clause
"""A virtual URG as its clients meet it: places, time, and what it says; by a client that shares no code with it."""

import itertools
import re
import stat
import subprocess
import sys
import termios
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from urg_client import Client, in_its_turn, number, until

from kurumaisu.errors import Error
from kurumaisu.virtual_urg import Pty, Tcp, VirtualUrg, load_sensor
from kurumaisu.virtual_urg.cli import main
from kurumaisu.virtual_urg.models import sensor_names

USB = load_sensor("urg_04lx_ug01")  # answers at once: no SCIP 1.1, no rate
RAMP = np.linspace(0.1, 5.0, USB.steps).round(3)
RAMP_MM = (1000 * RAMP).round().astype(int)


def test_shipped_sensors():
    assert sensor_names() == ["urg_04lx", "urg_04lx_ug01", "utm_30lx"]
    angles = {name: np.degrees(load_sensor(name).bearings[[0, -1]]) for name in sensor_names()}
    assert angles["urg_04lx"] == pytest.approx([-119.531, 119.883], abs=5e-4)
    assert angles["utm_30lx"] == pytest.approx([-135, 135])
    assert [load_sensor(name).steps for name in sensor_names()] == [682, 682, 1081]


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("protocol: 2", "protocol: true", "protocol: must be an integer"),
        ("boot_time: 1.0", "bot_time: 1.0", "boot_time: is missing"),
        ("bauds: []", "bauds: [fast]", "bauds: must be a list"),
        ("AMAX: 725", "AMAX: 40", "AMAX: must not be below AMIN = 44"),
        ("protocol: 2", "protocol: 2\nspeed: 1", "speed: is not a known key"),
        ("protocol: 2", "protocol: 3", "protocol must be 1 or 2: 3"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path, old, new, told):
    text = USB.path.read_text()
    assert old in text
    path = tmp_path / "a.yaml"
    path.write_text(text.replace(old, new))
    with pytest.raises(Error, match=told), VirtualUrg(load_sensor(path), Tcp()):
        pass


@pytest.fixture(params=["pty", "tcp"])
def at(request, tmp_path):
    return Pty(tmp_path / "urg") if request.param == "pty" else Tcp()


def place(urg):
    return urg.address if "/" in urg.address else urg.port


def test_ranges_arrive_a_turn_apart(at):
    in_its_turn(lambda: check_a_turn_apart(at))


def check_a_turn_apart(at):
    with VirtualUrg(USB, at) as urg:
        urg.show(RAMP)
        with Client(place(urg)) as client:
            asked = time.monotonic()
            client.stream()
            scans, times = [], []
            while len(scans) < 6:
                scans.append(client.scan())
                times.append(time.monotonic())
        for scan in scans:
            np.testing.assert_array_equal(scan.distances, RAMP_MM)
        assert {b.clock - a.clock for a, b in itertools.pairwise(scans)} == {100}
        # From step 0 to the first byte: 725 of 1024 steps and what the file adds.
        ready = 0.1 * 725 / 1024 + 0.027
        assert min(np.diff(times, prepend=asked)) > 0.05
        assert times[0] - asked > ready
        assert abs(np.median(np.diff(times)) - 0.1) < 0.01
        assert urg.counters["late"] == urg.counters["dropped"] == 0


def test_one_client_at_a_time():
    with VirtualUrg(USB, Tcp()) as urg, Client(urg.port) as first:
        assert b"00P" in first.ask(b"VV")
        with Client(urg.port) as second:
            second.send(b"VV\n")
            assert second.silent(0.1)
            assert b"00P" in first.ask(b"PP")
            first.close()
            assert b"00P" in second.message()
        assert urg.counters["clients"] == 2


def test_a_stream_ends_with_its_connection():
    with VirtualUrg(USB, Tcp()) as urg:
        with Client(urg.port) as first:
            first.stream()
            first.scan()
        with Client(urg.port) as second:
            assert second.silent(0.25)
            assert second.ask(b"QT") == b"QT\n00P"


def test_a_serial_sensor_does_not_notice_that_nobody_listens(tmp_path):
    with VirtualUrg(USB, Pty(tmp_path / "urg")) as urg:
        with Client(urg.address) as first:
            first.stream()
            before = first.scan().clock
            until(lambda: urg.counters["scans"] >= 2)  # one that the first leaves unread
        until(lambda: urg.counters["unheard"] >= 2)
        with Client(urg.address) as second:
            assert second.scan().clock > before + 200  # what the first left is gone


def test_terminal_is_raw_for_every_client(tmp_path):
    with VirtualUrg(USB, Pty(tmp_path / "urg")) as urg:
        for _ in range(2):
            with Client(urg.address) as client:
                iflag, oflag, cflag, lflag, *_ = termios.tcgetattr(client.fd)
                assert not iflag & (termios.ICRNL | termios.INLCR | termios.IGNCR | termios.IXON | termios.ISTRIP)
                assert not oflag & termios.OPOST
                assert not lflag & (termios.ECHO | termios.ICANON | termios.ISIG | termios.IEXTEN)
                assert cflag & termios.CSIZE == termios.CS8
                client.send(b"VV\r")
                assert client.message().startswith(b"VV\n00P")
                lines = termios.tcgetattr(client.fd)
                lines[3] |= termios.ECHO | termios.ICANON
                termios.tcsetattr(client.fd, termios.TCSANOW, lines)
            until(lambda: not urg.connected)


def test_link(tmp_path):
    link = tmp_path / "urg"
    with VirtualUrg(USB, Pty(link)):
        assert stat.S_ISCHR(link.stat().st_mode)
        with pytest.raises(Error, match=f"{link}.*exists"), VirtualUrg(USB, Pty(link)):
            pass
        assert link.exists()
    assert not link.is_symlink()
    link.symlink_to(tmp_path / "gone")  # as a killed process leaves it
    with VirtualUrg(USB, Pty(link)):
        assert stat.S_ISCHR(link.stat().st_mode)
        link.unlink()
        link.write_text("another's")
    assert link.read_text() == "another's"
    with pytest.raises(Error, match="exists"), VirtualUrg(USB, Pty(link)):
        pass
    with pytest.raises(Error, match="No such file"), VirtualUrg(USB, Pty(tmp_path / "no" / "urg")):
        pass
    assert link.read_text() == "another's"


def test_a_port_that_is_taken_is_refused():
    with VirtualUrg(USB, Tcp()) as urg, pytest.raises(Error, match=f"127.0.0.1:{urg.port}.*in use"):
        VirtualUrg(USB, Tcp(urg.port))


def test_fed_time_is_the_time(at):
    with VirtualUrg(USB, at, fed=True) as urg, Client(place(urg)) as client:
        urg.advance(7.25)
        client.ask(b"TM0")
        assert number(client.ask(b"TM1").split(b"\n")[2][:4]) == 7250
        client.ask(b"TM2")
        client.stream()
        for turn in range(3):
            start = 8 + 0.1 * turn
            assert urg.measure(start + 0.1, start, RAMP + turn / 100)
            scan = client.scan()
            assert scan.clock == round(1000 * start)
            np.testing.assert_array_equal(scan.distances, RAMP_MM + 10 * turn)
        assert client.silent(0.15)  # no turn but those that it is told of


def test_a_client_that_does_not_read_costs_whole_scans(at):
    patience, turns = 0.05, 200
    with VirtualUrg(USB, at, fed=True, patience=patience) as urg, Client(place(urg)) as client:
        client.stream()
        kept, waits = [], []
        while len(waits) < turns and (all(kept[-3:]) or len(kept) < 3):
            begin = time.monotonic()
            kept.append(urg.measure(0.1 * len(kept) + 0.1, 0.1 * len(kept), RAMP))
            waits.append(time.monotonic() - begin)
        assert len(kept) < turns  # somewhere the system has enough
        assert max(waits) < patience + 5  # it would be for ever
        assert urg.counters["dropped"] == kept.count(False)
        clocks = [client.scan().clock for _ in range(kept.count(True))]
        assert clocks == [100 * turn for turn, there in enumerate(kept) if there]


def test_waiting_leaves_python_alone():
    with VirtualUrg(USB, Tcp(), fed=True, patience=0.5) as urg, Client(urg.port) as client:
        client.stream()
        feeder = threading.Thread(target=lambda: [urg.measure(0.1 * i, 0.1 * i, RAMP) for i in range(1, 400)])
        feeder.start()
        until(lambda: urg.counters["dropped"] > 0)  # this needs the lock while the feeder waits in measure
        client.close()
        feeder.join(10)
        assert not feeder.is_alive()


def test_wrong_shapes_are_refused():
    with VirtualUrg(USB, Tcp()) as urg:
        with pytest.raises(Error, match="682 steps"):
            urg.show(np.ones(681))
        with pytest.raises(Error, match="682 steps"):
            urg.show(RAMP, intensities=np.ones(3))
        urg.close()
        with pytest.raises(Error, match="closed"):
            urg.show(RAMP)


def test_ten_at_once_lose_nothing():
    in_its_turn(check_ten_at_once)


def check_ten_at_once():
    urgs = [VirtualUrg(USB, Tcp()) for _ in range(10)]
    clients = [Client(urg.port) for urg in urgs]
    spent = time.process_time()
    for client in clients:
        client.stream()
    clocks = [[client.scan().clock for client in clients] for _ in range(12)]
    assert time.process_time() - spent < 0.6  # [s] of 1.2, with ten readers in Python
    assert set(np.diff(clocks, axis=0).ravel()) == {100}
    for urg, client in zip(urgs, clients, strict=True):
        assert urg.counters["late"] == urg.counters["dropped"] == 0
        client.close()
        urg.close()


def test_idle_costs_nothing(at):
    with VirtualUrg(USB, at) as urg:
        Client(place(urg)).close()
        until(lambda: not urg.connected)
        before = time.process_time()
        with Client(place(urg)) as client:
            client.ask(b"VV")
            assert client.silent(0.3)
        time.sleep(0.3)  # whatever it does in this time is too much
        assert time.process_time() - before < 0.02


def command(*arguments):
    code = "import sys; from kurumaisu.virtual_urg.cli import main; sys.exit(main())"
    return [sys.executable, "-c", code, *arguments]


@pytest.mark.parametrize("feed", ["--range 1.5", "--wall 1.5", "--world room.world --pose 3 3.9 0.1"])
def test_command(tmp_path, feed):
    worlds = Path(__file__).resolve().parents[1] / "worlds"
    link = tmp_path / "urg"
    arguments = command("--sensor", "urg_04lx_ug01", "--pty", str(link), *feed.split())
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, cwd=worlds)
    assert process.stdout.readline().decode() == f"URG-04LX-UG01 at {link}\n"
    with Client(link) as client:
        client.stream()
        distances = np.array([client.scan().distances for _ in range(3)])
    process.send_signal(2)
    counted = process.communicate(timeout=60)[0].decode()
    assert process.returncode == 0
    assert int(re.search(r"(\d+) scans sent", counted)[1]) >= 3
    assert not link.is_symlink()
    front = distances[:, 384 - 44]
    if "--range" in feed:
        assert (distances == 1500).all()
    elif "--wall" in feed:  # equation (4): 1.004587 * 1.5 + 0.058826, sd 2 mm
        assert abs(front - 1566).max() < 15
        assert len(set(front)) > 1
    else:
        # The face of the cupboard, at x = 5.4.
        truth = 1.004587 * (5.4 - 3) / np.cos(0.1) + 0.058826
        assert abs(front - 1000 * truth).max() < 15
        assert len(set(front)) > 1


def test_command_refuses_nonsense(tmp_path, capsys):
    def told(*arguments, code=1):
        with pytest.raises(SystemExit, match=str(code)):  # argparse's way, and what the script does
            sys.exit(main(list(arguments)))
        return capsys.readouterr().err

    assert "--pty --tcp is required" in told(code=2)
    assert "'sick' is neither a file *.yaml nor a known one; there are: urg_04lx, urg_04lx_ug01, utm_30lx" in told(
        "--sensor", "sick", "--tcp", "0"
    )
    assert "did you mean urg_04lx or urg_04lx_ug01" in told("--sensor", "urg_04xl", "--tcp", "0")
    assert "corupt@5: no such name" in told("--tcp", "0", "--fault", "corupt@5")
    assert "--world and --pose" in told("--tcp", "0", "--world", "a.world", code=2)
    assert f"{tmp_path}/no.world" in told("--tcp", "0", "--world", f"{tmp_path}/no.world", "--pose", "0", "0", "0")
    assert "70000" in told("--tcp", "70000")
    assert "1.2.3.4" in told("--tcp", "0", "--host", "1.2.3.4")
    assert "--range" in told("--tcp", "0", "--range", "-1", code=2)
    assert list(tmp_path.iterdir()) == []
