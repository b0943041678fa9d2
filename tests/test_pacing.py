# SPDX-License-Identifier: BSD-3-Clause
"""A wait for simulated time ends when its speed changes, and is never longer than a glance."""

import math
import threading
import time

import pytest

from kurumaisu.errors import Error
from kurumaisu.sim.live.pacing import Pacer
from kurumaisu.sim.live.requests import Requests

STEP = 0.01  # [s]


def seconds_until_due(pacer, requests):
    begin = time.monotonic()
    while not pacer.wait(requests):
        if requests:
            requests.serve()
        assert time.monotonic() - begin < 20
    return time.monotonic() - begin


def test_steps_are_due_at_the_speed():
    pacer, requests = Pacer(0.5), Requests()
    begin = time.monotonic()
    for _ in range(10):
        pacer.step(STEP)
        seconds_until_due(pacer, requests)
    assert time.monotonic() - begin == pytest.approx(10 * STEP / 0.5, abs=0.1)


def test_a_wait_of_hours_ends_when_the_speed_changes():
    pacer, requests = Pacer(1e-6), Requests()

    def hurry():
        pacer.speed = 1.0

    pacer.step(STEP)
    asker = threading.Timer(0.3, requests.ask, (hurry,))
    asker.start()
    assert seconds_until_due(pacer, requests) < 5
    asker.join()


def test_what_is_left_of_a_step_counts_at_the_new_speed():
    pacer = Pacer(1.0)
    pacer.step(1000.0)
    pacer.speed = 10000.0
    assert seconds_until_due(pacer, Requests()) == pytest.approx(0.1, abs=0.09)


def test_no_step_waits_as_fast_as_possible():
    pacer = Pacer(1.0)
    pacer.step(1000.0)
    pacer.speed = 0.0
    for _ in range(1000):
        pacer.step(1000.0)
        assert pacer.wait(Requests())


@pytest.mark.parametrize("speed", [1e-300, 1e-7, -1.0, 1e300, math.inf, math.nan])
def test_a_speed_that_makes_no_sense_is_refused(speed):
    with pytest.raises(Error, match=r"speed.*: must be a number from 1e-06 to 1e"):
        Pacer(speed)
    pacer = Pacer(2.0)
    with pytest.raises(Error, match="speed"):
        pacer.speed = speed
    assert pacer.speed == 2.0
