# SPDX-License-Identifier: BSD-3-Clause
"""What the benchmarks of the laser call good and bad."""

import math
import os
import time
from dataclasses import replace

import pytest

from kurumaisu.bench.faults.laser.cases import CASES, Case
from kurumaisu.bench.faults.laser.run import Result, noted, run, verdict
from kurumaisu.bench.processes import master
from kurumaisu.bench.rigs.heard_scans import Status, read_scan, read_status
from kurumaisu.bench.rigs.laser import Driver, fed, ours, sensor_at, stock

CASE = Case(1, ("corrupt@20",), (1, 1), 0.26, proof="Bad Sums", level=1)
STATUS = Status(1, "bad sums: 1", {"Bad Sums": "1", "Lost Scans": "1", "Reconnects": "0", "Last Error": "LASER_X: y"})
GOOD = Result(
    scans=70,
    lost=1,
    twice=0,
    wrong=0,
    blank="",
    gap=0.2,
    stamp=0.03,
    back=0,
    cpu=0.01,
    grown=0.1,
    exit=0.3,
    status=STATUS,
)


def test_a_scan_that_was_heard():
    topic, scan = read_scan("scan /laser_3/scan 12.5 1000.25 1000.0 1234 682 1 0 2 3\n")
    assert (topic, scan.arrival, scan.stamp, scan.range, scan.beams) == ("/laser_3/scan", 12.5, 1000.0, 1234, 682)
    assert scan.wrong
    assert not replace(scan, others=0).wrong
    assert replace(scan, others=0, codes=1).wrong


def test_a_status_that_was_heard():
    name, status = read_status("status 2 laser_1: Hardware Status\tNot connected\tBad Sums=3\tLast Error=A=B\n")
    assert name == "laser_1: Hardware Status"
    assert status == Status(2, "Not connected", {"Bad Sums": "3", "Last Error": "A=B"})


def test_a_good_driver():
    assert verdict(CASE, GOOD) == []
    assert noted(STATUS, ["Bad Sums", "Lost", "Reconnects"]) == "Bad Sums 1, Lost Scans 1, LASER_X"


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"scans": 0}, "no scan"),
        ({"lost": 0}, "lost 0"),
        ({"lost": 2}, "lost 2"),
        ({"twice": 1}, "twice"),
        ({"wrong": 1}, "wrong"),
        ({"back": 1}, "stamps back"),
        ({"gap": 0.3}, "gap"),
        ({"stamp": 0.06}, "stamp off"),
        ({"stamp": math.nan}, "stamp off"),
        ({"cpu": 0.5}, "CPU"),
        ({"cpu": math.nan}, "died"),
        ({"exit": math.inf}, "exit"),
        ({"grown": 9.0}, "memory"),
        ({"status": replace(STATUS, values={"Bad Sums": "0"})}, "no Bad Sums"),
        ({"status": replace(STATUS, level=0)}, "level 0"),
        ({"status": None}, "no Bad Sums"),
    ],
)
def test_a_bad_driver(change, word):
    assert any(word in found for found in verdict(CASE, replace(GOOD, **change)))


def test_a_peer_has_diagnostics_of_its_own():
    assert verdict(CASE, replace(GOOD, status=None), ours=False) == []


def test_what_must_not_be_published():
    case = replace(CASE, lost=None)
    assert verdict(case, GOOD) == ["70 scans"]
    assert verdict(case, replace(GOOD, scans=0)) == []


def test_the_outage_is_the_sensors():
    assert verdict(replace(CASE, outage=1.0), replace(GOOD, gap=1.2)) == []


def test_all_eighteen_are_there():
    assert {case.number for case in CASES} == set(range(1, 19))


def test_every_case_is_a_sensors(tmp_path):
    for case in CASES:
        with sensor_at(case.sensor, case.faults, tmp_path / "urg", tcp=case.tcp) as sensor:
            assert sensor.address.words


def test_mrpts_own_driver_is_seen_to_publish_a_damaged_scan(tmp_path):
    with sensor_at("urg_04lx_ug01", ("corrupt@6",), tmp_path / "urg", tcp=True) as sensor, fed([sensor]):
        driver = Driver(stock(sensor.address), dict(os.environ), tmp_path / "log", heard=True)
        try:
            assert driver.heard is not None
            deadline = time.monotonic() + 20
            while len(driver.heard.scans()) < 10 and time.monotonic() < deadline:
                time.sleep(0.05)
            scans = driver.heard.scans()
        finally:
            driver.stop()
    assert len(scans) >= 10, (tmp_path / "log").read_text()[-500:]
    assert [scan.others for scan in scans if scan.wrong] == [1]
    # it stamps a scan when it comes: 98 ms after step 0, which the first beam follows by 4 ms
    assert all(sensor.latency(scan) > 0 and sensor.stamp_error(scan) > 0.05 for scan in scans)


def test_our_driver_loses_the_damaged_scan_only(tmp_path):
    case = Case(1, ("corrupt@5",), (1, 1))
    with master() as environment:
        (result,) = run([case], lambda address, name, _: ours(address, name), 2.5, environment, tmp_path)
    assert (result.lost, result.wrong, result.twice, result.back) == (1, 0, 0, 0)
    assert result.status
    assert result.status.values["Bad Sums"] == "1"
