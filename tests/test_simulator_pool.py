# SPDX-License-Identifier: BSD-3-Clause
"""Simulations side by side, and the example of docs/simulator.md."""

import re
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sim_worlds import LASER, OPTIONS, ROOM, robot, simulator

from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.sim import SimulatorPool
from kurumaisu.sim.robots.run import run
from kurumaisu.types import FloatArray
from kurumaisu.world import load_world

NOISY = LASER.replace("fov 180", "fov 180 noise [0.0004 0.01 0.5]")
CROWD = ROOM + robot(NOISY) + robot(NOISY, "0 2 0 90")
COMMANDS = np.random.default_rng(1).uniform(-1, 1, (12, 5, 2, 3))


def pool(folder: Path, threads: int) -> SimulatorPool:
    return SimulatorPool([simulator(folder, CROWD, threads=1) for _ in range(5)], threads)


@pytest.mark.parametrize("threads", [1, 2, 3, 9])
def test_each_is_as_if_it_were_alone(tmp_path: Path, threads: int) -> None:
    alone = simulator(tmp_path, CROWD)
    expected = []
    for number in range(5):
        alone.reset(number)
        poses = [alone.step(row[number]).poses for row in COMMANDS][-1]
        expected.append((poses, alone.state_hash()))
    with pool(tmp_path, threads) as together:
        together.reset(range(5))
        seen = [together.step(row) for row in COMMANDS][-1]
        hashes = together.map(lambda _, sim: sim.state_hash())
    for (poses, digest), observation, other in zip(expected, seen, hashes, strict=True):
        np.testing.assert_array_equal(poses, observation.poses)
        assert digest == other


def test_what_does_not_fit_is_said(tmp_path: Path) -> None:
    with pool(tmp_path, 2) as together:
        with pytest.raises(Error, match="seeds: must be 5, one for each simulation, not 2"):
            together.reset([1, 2])
        with pytest.raises(Error, match="commands: must be 5"):
            together.step(COMMANDS[0, :4])
        with pytest.raises(Error, match=r"commands: must have shape \(2, 3\)"):
            together.step(COMMANDS[0, :, :1])
    with pytest.raises(Error, match="threads: must be at least 1: 0"):
        SimulatorPool([], 0)
    with SimulatorPool([], 2) as nothing:
        assert nothing.step([]) == ()


def drive(seed: int, world: Path, commands: FloatArray) -> FloatArray:
    return run(load_world(world), replace(OPTIONS, threads=1), commands, seed)


def test_processes_give_the_same(tmp_path: Path) -> None:
    text = ROOM + robot('localization "odom" ' + NOISY) * 1
    sim = simulator(tmp_path, text)
    commands = COMMANDS[:, 0, :1]
    sim.reset(3)
    expected = [sim.step(row).poses for row in commands]
    with ProcessPoolExecutor(1) as executor:
        poses = executor.submit(drive, 3, tmp_path / "t.world", commands).result()
    np.testing.assert_array_equal(poses, expected)


def test_the_example_of_the_documentation_runs(capsys: pytest.CaptureFixture[str]) -> None:
    text = (Path(__file__).parents[1] / "docs/simulator.md").read_text()
    (example,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    exec(compile(example, "docs/simulator.md", "exec"), {})
    out = capsys.readouterr().out
    (digest,) = re.findall(r"state ([0-9a-f]{64})", out)
    assert len(example.splitlines()) <= 25
    exec(compile(example, "docs/simulator.md", "exec"), {})
    assert digest in capsys.readouterr().out


def test_the_documentation_has_every_option() -> None:
    text = (Path(__file__).parents[1] / "docs/simulator.md").read_text()
    keys = re.findall(r"^(\w+):", shipped("launch/simulator.yaml").read_text(), re.MULTILINE)
    assert [key for key in keys if f"| `{key}` |" not in text] == []
