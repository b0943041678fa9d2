# SPDX-License-Identifier: BSD-3-Clause
"""The examples run, and the environment is one by Gymnasium's own checker."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from kurumaisu.errors import Error
from kurumaisu.examples import reach, wander


def test_wanderers_get_somewhere_and_a_seed_is_a_run(capsys: pytest.CaptureFixture[str]) -> None:
    states = []
    for _ in range(2):
        assert wander.main(["--seconds", "20"]) == 0
        out = capsys.readouterr().out
        driven = [float(metres) for metres in re.findall(r"([\d.]+) m driven", out)]
        assert len(driven) == 10
        assert min(driven) > 3
        states.append(re.findall(r"state (\w+)", out))
    assert states[0] == states[1]


def test_wander_says_what_it_needs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bare.world"
    path.write_text("position ( )")
    assert wander.main([str(path)]) == 1
    assert capsys.readouterr().err.rstrip().endswith("bare.world: this example wants robots with one laser each")
    assert wander.main([str(tmp_path / "none.world")]) == 1


def test_the_environment_passes_gymnasiums_checker() -> None:
    checker = pytest.importorskip("gymnasium.utils.env_checker", reason="gymnasium is not installed")
    from kurumaisu.examples.gym_env import GoalEnv

    checker.check_env(GoalEnv(), skip_render_check=True)


def test_the_hand_written_driver_reaches_its_goals(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("gymnasium", reason="gymnasium is not installed")
    assert reach.main(["--episodes", "4"]) == 0
    away = [float(metres) for metres in re.findall(r"goal ([\d.]+) m away", capsys.readouterr().out)]
    assert len(away) == 4
    assert max(away) <= 0.3


def test_an_episode_ends_at_a_collision() -> None:
    pytest.importorskip("gymnasium", reason="gymnasium is not installed")
    from kurumaisu.examples.gym_env import GoalEnv

    env = GoalEnv()
    env.reset(seed=3)
    for _ in range(200):
        _, reward, terminated, truncated, _ = env.step(np.array([1.0, 0.0], dtype=np.float32))
        if terminated:
            break
    assert terminated
    assert not truncated
    assert reward < -9


def test_without_gymnasium_the_example_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delitem(sys.modules, "kurumaisu.examples.gym_env", raising=False)
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    assert reach.main([]) == 1
    assert "pip install gymnasium" in capsys.readouterr().err


def test_the_environment_needs_a_laser(tmp_path: Path) -> None:
    pytest.importorskip("gymnasium", reason="gymnasium is not installed")
    from kurumaisu.examples.gym_env import GoalEnv

    path = tmp_path / "bare.world"
    path.write_text("position ( )")
    with pytest.raises(Error, match=r"bare\.world: the first robot has no laser"):
        GoalEnv(path)
