# SPDX-License-Identifier: BSD-3-Clause
"""One voltage, two yaw rates: slow turns by the law as printed, whose sign nobody wrote down."""

import numpy as np
import pytest

from kurumaisu.critic.base.drive import from_voltages
from kurumaisu.critic.sanity import examination
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.params import load_model, shipped
from kurumaisu.types import FloatArray

DT = 0.02
MODEL = load_model(shipped("launch/md100.yaml"))


def _volts(w: FloatArray) -> FloatArray:
    """Equation (2) as printed, 0 V at rest."""
    return np.where(w > 0, -0.499211 * w + 0.104181, np.where(w < 0, -0.469278 * w - 0.169476, 0.0))


def _slow(rng: np.random.Generator, *, held: bool) -> FloatArray:
    """Return yaw rates of two minutes of slow turns, held for seconds or as one waves a stick."""
    t = np.arange(0.0, 120.0, DT)
    if held:
        return np.repeat(rng.uniform(-0.35, 0.35, len(t) // 100), 100)
    return np.asarray(0.3 * np.sin(2 * np.pi * t / 9.0) + 0.05 * np.sin(2 * np.pi * t / 2.3))


def _run(w: FloatArray, lag: float, rng: np.random.Generator, sign: float = 1.0) -> Run:
    """Return a drive at 0.3 m/s with these yaw rates, without commands; sign: of V_s as written down."""
    t = DT * np.arange(len(w))
    driven = np.empty_like(w)
    state = 0.0
    for i, asked in enumerate(w):
        state += (asked - state) * (DT / (lag + DT))
        driven[i] = state
    heading = np.concatenate([[0.0], np.cumsum(driven[:-1]) * DT])
    way = 0.3 * DT * np.column_stack([np.cos(heading), np.sin(heading)])
    poses = np.column_stack([np.concatenate([[[0.0, 0.0]], np.cumsum(way[:-1], axis=0)]), heading])
    poses += rng.normal(0.0, [0.003, 0.003, 0.003], poses.shape)
    volts = np.column_stack([np.full(len(t), 1.32402 * 0.3 + 0.127906), sign * _volts(w)])
    return Run("run", voltage=Series(t, volts, ("v_f", "v_s")), pose=Series(t, poses, ("x", "y", "theta")))


def _wrong(run: Run) -> list[str]:
    return examination.examine(Recording("recording", (run,), train=("run",)), MODEL).invalid


@pytest.mark.parametrize("lag", [0.0, 0.25])
@pytest.mark.parametrize("held", [True, False])
def test_the_motion_tells_the_sign_where_no_command_does(lag: float, held: bool) -> None:
    rng = np.random.default_rng(7)
    asked = _slow(rng, held=held)
    _, v, w = from_voltages(_run(asked, lag, rng), MODEL)
    assert v == pytest.approx(np.full(len(v), 0.3), abs=1e-4)
    right = np.abs(w - asked) < 1e-4
    assert right.mean() > (0.99 if lag == 0 else 0.93)


@pytest.mark.parametrize("held", [True, False])
def test_slow_turns_are_no_wrong_sign(held: bool) -> None:
    rng = np.random.default_rng(8)
    assert _wrong(_run(_slow(rng, held=held), 0.1, rng)) == []


def test_a_wrong_sign_of_fast_turns_is_said() -> None:
    rng = np.random.default_rng(9)
    fast = np.repeat(rng.choice([-0.9, -0.7, 0.7, 0.9], 60), 100)
    assert _wrong(_run(fast, 0.0, rng)) == []
    assert any("v_s has the wrong sign" in words for words in _wrong(_run(fast, 0.0, rng, sign=-1.0)))
