# SPDX-License-Identifier: BSD-3-Clause
"""What stops say about noise: a chair that rests says nothing about how it was shaken before."""

import numpy as np

from kurumaisu.bench.hidden.base import recordings
from kurumaisu.bench.hidden.generator.noise import Colour, Regime
from kurumaisu.bench.hidden.oracle import noise_of
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import GRID, Drive, prepare
from kurumaisu.critic.noise.base_noise import whitener
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
# A yaw rate that wanders slowly, seen by a reference that knows the heading closely: each stop is seen to the degree.
SLOW = Regime((Colour((0.01, 0.0045, 0.053), 1.33),), 0.012, 0.0011)


def turned_too_far(seed):
    """Return, per drive, by how many sds the known noise seems to turn the chair while it moves."""
    data = recordings.recording("", recordings.draw_drives(None, SLOW, np.random.default_rng(seed), rate=10.0), ())
    for run in data.runs:
        drive = prepare(run, MODEL)
        turn = np.zeros_like(drive.measured)
        turn[:, 2] = drive.activity * np.diff(drive.times)
        both = np.column_stack([(drive.measured - replay.increments(drive, MODEL, ())).ravel(), turn.ravel()])
        left, column = whitener(drive, noise_of(SLOW)).whiten(both).T
        yield left @ column / np.linalg.norm(column)


def test_stops_do_not_make_slow_noise_a_turn():
    """Had it been little before each stop, which it seems to be at rest, it would be far too large after it."""
    seen = [z for seed in range(10) for z in turned_too_far(seed)]
    assert np.sqrt(np.mean(np.square(seen))) < 1.3  # of 30, one in 100 is above


def test_a_chair_may_roll_on_and_is_shaken_from_its_start_on():
    v = np.repeat([0.0, 0.5, 0.0], [100, 105, 95])
    times = np.arange(0.0, len(v) * GRID, 0.1)
    drive = Drive("made", "command", 0.0, v, np.zeros_like(v), times, np.zeros((len(times), 3)))
    np.testing.assert_allclose(drive.activity[[9, 10, 19, 20, 21]], [0.0, 1.0, 1.0, 0.5, 0.0], atol=1e-9)
    whole = drive.activity**2 + drive.rolling**2
    np.testing.assert_allclose(whole[[9, 10, 19, 20]], [0.0, 1.0, 1.0, 2.5 / 3], atol=1e-9)
    np.testing.assert_allclose(whole[[21, 22, 23]], [1.5 / 3, 0.5 / 3, 0.0], atol=1e-9)
