# SPDX-License-Identifier: BSD-3-Clause
"""kurumaisu sim --viewer: a page drives the simulated chair, stops it, and moves what there is."""

import math
import os
import re
import signal
import subprocess
import sys

import pytest
from viewer_rig import viewer_settings

from kurumaisu.bench.speed.viewer.page import Page
from kurumaisu.experiments import base_limits
from kurumaisu.params import load_model, shipped
from kurumaisu.programs.live import LiveChair, Stick
from kurumaisu.sim.chair.simulator import ChairSimulator
from kurumaisu.sim.settings import load_dynamics
from kurumaisu.viewer import Hub, Server
from kurumaisu.world import load_world

MODEL = shipped("launch/md100.yaml")


@pytest.fixture
def live():
    """A page that may command a chair in the arena."""
    model = load_model(MODEL)
    simulator = ChairSimulator(
        model, load_world(shipped("worlds/arena.world")), load_dynamics(shipped("launch/physical.yaml"))
    )
    hub, how = Hub(), viewer_settings()
    chair = LiveChair(hub, "arena", simulator, model, MODEL, Stick(0.5, 0.8, 0.5), base_limits(), how.rate)
    server = Server(how, hub, chair, control=True)
    server.start()
    chair.start()
    page = Page(server.address)
    page.let_in(server.new_address())
    yield page
    page.close()
    server.close()
    chair.close()


def state(page):
    return page.newest["state"]


def wait(page, true, what):
    page.wait(lambda: "state" in page.newest and true(state(page)), what)


def test_it_drives_while_told_to_and_stops_of_itself(live):
    wait(live, lambda now: now["t"] > 0, "time")
    start = state(live)["truth"]
    for _ in range(5):
        assert live.ask("drive", v=9.0, w=0.0)["ok"]
        wait(live, lambda now: now["commanded"] == [0.5, 0.0], "the stick's limit")
    wait(live, lambda now: now["v"] == pytest.approx(0.5), "motion")
    wait(live, lambda now: now["commanded"] == [0.0, 0.0] and now["v"] == 0.0, "the dead-man")
    now = state(live)
    way = math.hypot(now["truth"][0] - start[0], now["truth"][1] - start[1])
    assert way > 0.2
    assert now["truth"][2] == pytest.approx(start[2])
    assert live.scans
    live.wait(lambda: live.ask("seed", value=7)["ok"] and state(live)["seed"] == 7, "another seed")
    assert state(live)["truth"] == start


def test_pause_step_speed(live):
    assert not live.ask("step")["ok"]
    assert live.ask("pause", on=True)["ok"]
    wait(live, lambda now: now["paused"], "pause")
    before = state(live)["t"]
    assert live.ask("step")["ok"]
    wait(live, lambda now: now["t"] == pytest.approx(before + 0.01), "a step")
    assert live.ask("speed", value=3.0)["ok"]
    wait(live, lambda now: now["speed"] == 3.0, "speed")
    assert not live.ask("speed", value=-1.0)["ok"]


def acting(page):
    """Return the effects that the page is shown as acting, with their values."""
    groups = page.newest["effects"]["groups"]
    return {one["id"]: {p["name"]: p["value"] for p in one["parameters"]} for one in groups if one["enabled"]}


def test_effects_are_shown_switched_and_saved(live, tmp_path):
    live.wait(lambda: "effects" in live.newest, "effects")
    own = acting(live)
    assert set(own) == {one.id for one in load_model(MODEL).effects}
    answer = live.ask("effect", effect="base.gain_v", enabled=True, values={"gain": 0.5})
    assert answer["ok"], answer
    live.wait(lambda: acting(live) == own | {"base.gain_v": {"gain": 0.5}}, "a gain")
    for _ in range(5):
        assert live.ask("drive", v=0.4, w=0.0)["ok"]
        wait(live, lambda now: now["commanded"] == [0.4, 0.0], "the command")
    wait(live, lambda now: now["v"] == pytest.approx(0.6), "half as much again")
    (tmp_path / "model.yaml").write_text(live.ask("save_model")["result"])
    assert {one.id for one in load_model(tmp_path / "model.yaml").effects} == {*own, "base.gain_v"}
    assert live.ask("effect", effect="base.gain_v", enabled=False, values={})["ok"]
    live.wait(lambda: acting(live) == own, "no gain")
    for wrong in ({"effect": "base.gian_v", "values": {}}, {"effect": "base.gain_v", "values": {"gain": 1e9}}):
        assert not live.ask("effect", enabled=True, **wrong)["ok"]
    assert acting(live) == own


def test_bodies_are_moved_but_no_walls(live):
    live.wait(lambda: "world" in live.newest and "state" in live.newest, "a world")
    world = live.newest["world"]
    chair = world["chair"]
    (crate, *_) = [body for body in world["bodies"] if body["kind"] == "obstacle"]
    (wall, *_) = [body for body in world["bodies"] if body["kind"] == "wall"]
    assert live.ask("pause", on=True)["ok"]
    assert live.ask("set_pose", body=crate["id"], x=0.0, y=0.0, yaw=0.5)["ok"]
    wait(live, lambda now: now["poses"][crate["id"]] == pytest.approx([0.0, 0.0, 0.5]), "the crate there")
    assert not live.ask("set_pose", body=wall["id"], x=0.0, y=0.0, yaw=0.0)["ok"]
    refused = live.ask("set_pose", body=chair, x=0.0, y=0.0, yaw=0.0)
    assert not refused["ok"]
    assert "does not fit" in refused["message"]
    assert not live.ask("drive", v=0.1, w=0.0, body=crate["id"])["ok"]


def test_the_program_prints_an_address_and_ends_at_a_signal():
    """Whichever thread gets it: NumPy's library starts some of its own."""
    command = "import sys; from kurumaisu.programs.main import main; sys.exit(main(['sim', '--viewer', '--port', '0']))"
    threads = os.environ | {"OPENBLAS_NUM_THREADS": "2"}
    with subprocess.Popen([sys.executable, "-c", command], stdout=subprocess.PIPE, text=True, env=threads) as process:
        assert "MD-100" in process.stdout.readline()
        assert re.match(r"open http://127\.0\.0\.1:\d+/#token=", process.stdout.readline())
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 0
