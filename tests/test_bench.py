# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks are found by name; those of the base and the simulator judge what they measure."""

import math

import numpy as np
import pytest

from kurumaisu.bench import __main__, peers
from kurumaisu.bench.accuracy.stage import beams
from kurumaisu.bench.speed import base, chair, rays, robots, sim, ways
from kurumaisu.bench.table import Table
from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.world import load_world


def test_without_a_name_each_is_listed_with_a_line_of_what_it_measures(capsys):
    assert __main__.main([]) == 0
    lines = capsys.readouterr().out.splitlines()[2:]
    assert [line.split()[0] for line in lines] == list(__main__.MODULES)
    assert all(len(line.split(maxsplit=1)[1]) > 30 for line in lines)


@pytest.mark.parametrize(
    ("name", "words"), [("simm", "did you mean sim?"), ("table", f"there are {len(__main__.MODULES)}: scripts/bench")]
)
def test_a_name_that_is_none(name, words, capsys):
    assert __main__.main([name]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("name", __main__.MODULES)
def test_help_says_what_it_measures_and_how_to_write_it_into_a_page(name, capsys):
    with pytest.raises(SystemExit) as stop:
        __main__.main([name, "--help"])
    assert stop.value.code == 0
    usage, *others = capsys.readouterr().out.split("\n\n")
    assert usage.startswith(f"usage: scripts/bench {name} ")
    assert len(others[0]) > 30
    assert not others[0].startswith("options")
    assert "--write PAGE" in others[-1]


def test_base(capsys):
    assert __main__.main(["base", "--repeats", "1"]) in (0, 1)  # the limit of time is the machine's
    out = capsys.readouterr().out
    assert all(name in out for name in ("published, steering", "corrected, translation", "base.lag_w", "all"))


@pytest.mark.parametrize(("worst", "dearest", "status"), [(1e-15, 0.9, 0), (1e-9, 0.9, 1), (1e-15, 1.1, 1)])
def test_base_fails_beyond_its_limits(monkeypatch, worst, dearest, status):
    monkeypatch.setattr(base, "_round_trips", lambda repeats: worst)
    monkeypatch.setattr(base, "_minutes", lambda repeats: dearest)
    assert base.main([]) == status


def test_sim(capsys):
    assert __main__.main(["sim", "--repeats", "1", "--poses", "2", "--seconds", "1"]) == 0
    lines = capsys.readouterr().out.splitlines()

    def cells(name):
        return next(line[28:].split() for line in lines if line.startswith(name))

    names = ("Scene.cast_fan", "Scene.cast, a ray", "pymunk", "numpy")
    assert all(float(cells(name)[0]) > 0 for name in names)  # rays per second
    assert all(float(cells(name)[-1]) < 1e-9 for name in names[1:])  # metres
    floors = [cells(name) for name in ("even ", "uneven ")]
    assert [row[-1] for row in floors] == ["10", "10"]  # the eleventh begins at 1 s
    assert all(float(row[0]) > 0 for row in floors)
    worlds = [cells(f"{robots} x ") for robots in (1, 100, 1000)]
    assert all(float(row[0]) > 0 and row[1] == "-" for row in worlds)


def test_sim_fails_beyond_its_limit(monkeypatch):
    monkeypatch.setattr(ways, "compare", lambda *_: 1e-6)
    monkeypatch.setattr(chair, "simulated_time", lambda *_: None)
    for part in (rays, robots):
        monkeypatch.setattr(part, "table", lambda *_: None)
    assert sim.main([]) == 1


def test_sim_wants_a_free_circle(monkeypatch):
    monkeypatch.setattr(chair, "_START", np.array([1.0, 1.0, 0.0]))
    with pytest.raises(Error, match="contact at"):
        sim.main(["--repeats", "1", "--poses", "1", "--seconds", "20"])


def test_ways_know_free_from_solid():
    world = load_world(shipped("worlds/building.world"))
    poses = ways.free_poses(world, 500, np.random.default_rng(2))
    assert poses.shape == (500, 3)
    shaft = (abs(poses[:, 0] - 8.45) < 1.75) & (abs(poses[:, 1] - 3.0) < 1.2)
    assert not shaft.any()
    assert ((poses[:, :2] > 0.1) & (poses[:, :2] < (11.9, 8.9))).all()  # between the outer walls


def test_ways_brute_force_at_known_distances():
    walls = np.array([[3.0, -1.0, 3.0, 1.0], [5.0, -9.0, 5.0, 9.0], [-1.0, -1.0, 1.0, -1.0]])
    ranges = ways.brute_force(walls, np.zeros(3), np.array([0.0, math.atan2(2, 5), -math.pi / 2, math.pi / 2]))
    np.testing.assert_allclose(ranges, [3.0, math.hypot(2, 5), 1.0, math.inf], rtol=1e-12)


def test_table_columns_stay_in_line(capsys):
    table = Table("title", "name", "error [mm]")
    table.row("first", 1.23456)
    table.row("second", "none")
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "title"
    assert len({len(lines[2]), *(len(line) for line in lines[4:])}) == 1
    assert lines[4].endswith("1.235")


def test_a_peers_words():
    run = peers.read_run("[Loading]\nload 0.5\ncpu 2\nmemory 64\nmodels 3\npose 1 2 0 0.5\n")
    assert (run.load, run.cpu, run.memory, run.models) == (0.5, 2.0, 64.0, 3)
    np.testing.assert_array_equal(run.poses, [[1, 2, 0, 0.5]])
    with pytest.raises(Error, match="load, cpu or memory: 'load 1"):
        peers.read_run("load 1\n")


def test_a_peer_that_is_not_there(tmp_path):
    with pytest.raises(Error, match="returned"):
        peers.Stage(tmp_path, tmp_path)


def test_agreement_leaves_out_jumps_but_no_slopes():
    slope = [np.array([value, value]) for value in (5.0, 4.8, 4.9, 5.1, 5.2)]  # here, right2, right, left, left2
    slope[3][1] = 7.0
    assert beams._edges(slope, 0.02).tolist() == [False, True]
