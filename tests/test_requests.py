# SPDX-License-Identifier: BSD-3-Clause
"""Calls from other threads are served by the loop, and their errors go back to who asked."""

import threading

import pytest

from kurumaisu.errors import Error
from kurumaisu.sim.live.requests import Requests


def ask_from_a_thread(requests, action):
    """Return a thread and where its outcome will be."""
    outcome = []

    def ask():
        try:
            outcome.append(requests.ask(action))
        except Exception as error:
            outcome.append(error)

    thread = threading.Thread(target=ask)
    thread.start()
    return thread, outcome


def test_the_loop_runs_what_is_asked_and_the_asker_gets_the_answer():
    requests = Requests()
    thread, outcome = ask_from_a_thread(requests, threading.get_ident)
    requests.wait(10)
    requests.serve()
    thread.join(10)
    assert outcome == [threading.get_ident()]
    assert not requests


def test_an_error_belongs_to_who_asked():
    def fail():
        raise Error("no")

    requests = Requests()
    thread, outcome = ask_from_a_thread(requests, fail)
    requests.wait(10)
    requests.serve()
    thread.join(10)
    assert str(outcome[0]) == "no"


def test_nobody_waits_for_a_loop_that_has_ended():
    requests = Requests()
    thread, outcome = ask_from_a_thread(requests, lambda: 1)
    requests.wait(10)
    requests.close()
    thread.join(10)
    assert isinstance(outcome[0], RuntimeError)
    with pytest.raises(RuntimeError):
        requests.ask(lambda: 1)
