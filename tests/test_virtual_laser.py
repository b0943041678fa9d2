# SPDX-License-Identifier: BSD-3-Clause
"""The simulator's scans through the virtual URG, read by a decoder of its own: ranges, codes, clock, intensities."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kurumaisu import effects
from kurumaisu._core import LaserError
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, Model, load_model, shipped
from kurumaisu.sim.chair.scanner import Scan
from kurumaisu.sim.chair.simulator import ChairSimulator, Command
from kurumaisu.sim.settings import load_dynamics
from kurumaisu.virtual_urg import Sensor, load_sensor
from kurumaisu.virtual_urg.chair_laser import VirtualLaser, check_fan, remainder, turn_start
from kurumaisu.world import load_world

FILE = shipped("launch/md100.yaml")
MODEL = load_model(FILE)
DYNAMICS = load_dynamics(shipped("launch/physical.yaml"))
MS, NS = 10**6, 10**9
EPOCH = NS  # of /clock at the simulation's time 0
ON_CLOCK = [e.id for e in effects.LASER if e.id.split(".")[1] in ("clock_skew", "latency", "sweep")]


class Client:
    """Asks for a stream and reads it: the protocol once more, in a few lines."""

    def __init__(self, address: str) -> None:
        host, port = address.rsplit(":", 1)
        self._socket = socket.create_connection((host, int(port)), timeout=5)
        self._rest = b""

    def ask(self, command: bytes) -> bytes:
        self._socket.sendall(command + b"\n")
        return self.reply()

    def reply(self) -> bytes:
        while b"\n\n" not in self._rest:
            self._rest += self._socket.recv(65536)
        reply, self._rest = self._rest.split(b"\n\n", 1)
        return reply

    def scan(self, width: int) -> tuple[int, np.ndarray]:
        """Return the clock [ms], and numbers of so many characters."""
        _echo, status, clock, *lines = self.reply().split(b"\n")
        assert status == b"99b"
        digits = np.frombuffer(b"".join(line[:-1] for line in lines), dtype=np.uint8).astype(int) - 0x30
        numbers = digits.reshape(-1, width) @ 64 ** np.arange(width - 1, -1, -1)
        return sum((digit - 0x30) * 64**power for power, digit in zip((3, 2, 1, 0), clock[:4], strict=True)), numbers

    def close(self) -> None:
        self._socket.close()


@contextmanager
def streaming(sensor: Sensor, model: Model, command: bytes) -> Iterator[tuple[VirtualLaser, Client]]:
    device = VirtualLaser(sensor, model.laser, "tcp:0", (), 1000.0)
    client = Client(device.address)
    try:
        device.advance(EPOCH, None, EPOCH)
        client.ask(b"SCIP2.0")
        assert client.ask(command).endswith(b"\n00P")
        yield device, client
    finally:
        client.close()
        device.close()


def driven(model: Model, count: int) -> Iterator[tuple[int, Scan | None]]:
    """Yield time [ns] and scan of each step on a curve, until there were so many scans."""
    simulator = ChairSimulator(model, load_world(shipped("worlds/room.world")), DYNAMICS)
    simulator.reset(3)
    command = Command(float(model.translation.volts(0.3)), float(model.steering.volts(0.6)), 1.0, 1.0)
    while count:
        seen = simulator.step(command)
        count -= seen.scan is not None
        yield EPOCH + round(seen.time * NS), seen.scan


def urg() -> Sensor:
    return load_sensor("urg_04lx")


@pytest.mark.parametrize("effect", [None, *ON_CLOCK])
def test_the_sensor_sends_what_the_simulator_saw(effect: str | None) -> None:
    model, sensor = MODEL, urg()
    if effect is not None:
        (cls,) = (e for e in effects.LASER if e.id == effect)
        values = {p.name: 0.03 for p in cls.parameters}
        model = replace(model, effects=(EffectSetting(effect, values),))
    late = 4 / 1024 / 10 * 11  # [s] of the first beam after step 0: 44 of 1024 steps in a tenth of a second
    kinds = set()
    with streaming(sensor, model, b"MD0044072501000") as (device, client):
        for now, scan in driven(model, 20):
            assert device.advance(now, scan, EPOCH) == (scan is not None)
            if scan is None:
                continue
            clock, distances = client.scan(3)
            # By the sensor's clock the first beam is where the simulator's stamp has it, but for the rounding to ms.
            assert clock / 1000 + late - (1.0 + scan.time) == pytest.approx(0.296875e-3, abs=1e-9)
            hit = np.isfinite(scan.ranges)
            np.testing.assert_allclose(distances[hit] / 1000, scan.ranges[hit], rtol=0, atol=1e-9)
            np.testing.assert_array_equal(distances[np.isinf(scan.ranges)], 0)
            np.testing.assert_array_equal(distances[np.isnan(scan.ranges)], 7)
            kinds |= set(np.unique(np.where(hit, 20, distances)))
        assert kinds >= {0, 20}
        assert device.counters["scans"] == 20


def test_pp_tells_the_model_s_gate() -> None:
    with streaming(urg(), MODEL, b"BM") as (_device, client):
        told = client.ask(b"PP").decode()
    assert "DMIN:60;" in told
    assert "DMAX:4000;" in told
    assert "ARES:1024;" in told


def test_intensities_are_reflectances() -> None:
    sensor = load_sensor("utm_30lx")
    law = LaserError(scale=1.0, datum_offset=0.0, sigma=[0.0] * 3, resolution=0.001, range_min=0.023, range_max=30.0)
    laser = replace(
        MODEL.laser,
        angle_min=float(sensor.bearings[0]),
        angle_increment=sensor.increment,
        beams=sensor.steps,
        scan_time=sensor.scan_time,
        time_increment=sensor.step_time,
        error=law,
        range_max=30.0,
    )
    model = replace(MODEL, laser=laser)
    check_fan(laser, sensor, FILE)
    with streaming(sensor, model, b"ME0000108001000") as (device, client):
        for now, scan in driven(model, 3):
            device.advance(now, scan, EPOCH)
            if scan is not None:
                _clock, numbers = client.scan(3)
                np.testing.assert_array_equal(numbers[1::2], np.round(1000 * scan.returns))
                assert scan.returns.max() > 0


def test_the_remainder_of_the_millisecond_is_that_of_the_launch_file() -> None:
    assert remainder(urg(), EPOCH) == pytest.approx(0.296875e-3, abs=1e-12)
    assert "time_offset: -2.96875e-4" in shipped("launch/sim_laser.yaml").read_text()
    for stamp in range(EPOCH, EPOCH + 100 * MS, 10 * MS):
        assert turn_start(urg(), stamp) % MS == 0
        assert remainder(urg(), stamp) == pytest.approx(0.296875e-3, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"beams": 681}, r"md100\.yaml: laser\.beams: is 681, but steps 44 to 725 of .*urg_04lx\.yaml make it 682"),
        ({"angle_min": -2.0923}, r"laser\.angle_min: is -2\.0923, .*make it -2\.08621387"),
        ({"scan_time": 0.2}, r"laser\.scan_time: is 0\.2, .*make it 0\.1"),
        ({"range_max": 10.0}, r"laser\.error\.range_max: is 10 m, but DMAX of .*urg_04lx\.yaml is 5\.6 m"),
    ],
)
def test_a_sensor_that_contradicts_the_model_is_refused(change: dict[str, float], message: str) -> None:
    with pytest.raises(Error, match=message):
        check_fan(replace(MODEL.laser, **change), urg(), FILE)


def test_a_turn_that_begins_before_the_last_one_is_left_out() -> None:
    with streaming(urg(), MODEL, b"MD0044072501000") as (device, client):
        ((now, scan),) = ((t, s) for t, s in driven(MODEL, 1) if s is not None)
        assert device.advance(now, scan, EPOCH)
        assert not device.advance(now + 10 * MS, scan, EPOCH)
        assert not device.advance(now + 20 * MS, scan, EPOCH - 5 * MS)
        assert device.advance(now + 30 * MS, scan, EPOCH + 5 * MS)
        assert client.scan(3)[0] + 5 == client.scan(3)[0]


def test_a_bad_port_is_refused(tmp_path: Path) -> None:
    with pytest.raises(Error, match="laser_port: must be the name of a link, or tcp:NUMBER: 'tcp:x'"):
        VirtualLaser(urg(), MODEL.laser, "tcp:x", (), 1.0)
    taken = tmp_path / "urg"
    taken.write_text("")
    with pytest.raises(Error, match=str(taken)):
        VirtualLaser(urg(), MODEL.laser, str(taken), (), 1.0)
