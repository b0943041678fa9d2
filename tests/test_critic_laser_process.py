# SPDX-License-Identifier: BSD-3-Clause
"""Scans criticised in another process: the same answer as in this one, also when that process dies."""

import pytest
from laser_scene import recording

from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.critic.processes import laser_process as module
from kurumaisu.critic.processes.worker import Worker
from kurumaisu.params import load_model, shipped

MD100 = shipped("launch/md100.yaml")
MODEL = load_model(MD100)


class Dying(Worker):
    """A worker whose process fails at once, whatever it is asked."""

    def send(self, task, *arguments):
        super().send(int, "no number")


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """A recording, and what is found of it in this process."""
    data = recording(tmp_path_factory.mktemp("room"), "laser.quadratic", 0.003, 7, scans=20)
    return data, criticise_scans(data, MODEL, lambda _: None)


@pytest.mark.parametrize("worker", [Worker, Dying])
def test_where_scans_are_criticised_makes_no_difference(alone, monkeypatch, worker):
    data, wanted = alone
    asked, here = [], []
    monkeypatch.setattr(module, "_MANY", 10)
    monkeypatch.setattr(module.os, "sched_getaffinity", lambda _: {0, 1})
    monkeypatch.setattr(module, "Worker", lambda: asked.append(worker) or worker())
    with module.criticise_in_own_process(data, MODEL, MD100, None) as scans_say:
        mean, found = scans_say(here.append)
    assert asked == [worker]
    assert bool(here) == (worker is Dying)
    assert found.causes == wanted.causes
    assert found.details == wanted.details
    assert mean.causes == wanted.causes
    assert not mean.pictures.comparisons
    assert [cause.id for cause in found.causes] == ["laser.quadratic"]
