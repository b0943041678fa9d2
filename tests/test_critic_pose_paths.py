# SPDX-License-Identifier: BSD-3-Clause
"""The way between two reference poses: what errors of the rates do along it, by moving a chair in small steps."""

import numpy as np
import pytest

from kurumaisu import geometry
from kurumaisu.critic.base.drive import GRID, Drive, pose_paths
from kurumaisu.critic.noise.base_noise import Noise, whitened

STEP = 0.0005  # [s]
V, W, HELD = [0.3, 0.0, 0.2, 0.3], [0.0, 1.2, -0.9, 0.6], 0.73  # commands change between two poses


def drive_of(seconds, error_v, error_w):
    """Return a drive asked for V and W in turn, and the poses at 10 Hz of a chair that errs by so much, (n,) each."""
    t = np.arange(0, seconds, STEP)
    at = (t / HELD).astype(int) % len(V)
    asked_v, asked_w = np.array(V)[at], np.array(W)[at]
    v, w = asked_v + error_v, asked_w + error_w
    heading = np.concatenate([[0.4], 0.4 + np.cumsum(w * STEP)])
    middle = (heading[1:] + heading[:-1]) / 2
    path = np.cumsum(np.stack([v * np.cos(middle), v * np.sin(middle)], axis=1) * STEP, axis=0)
    poses = np.column_stack([np.vstack([[0.0, 0.0], path]), heading])[:: round(0.1 / STEP)]
    cells = np.stack([asked_v, asked_w]).reshape(2, -1, round(GRID / STEP)).mean(axis=2)
    return Drive("made", "command", 0.0, *cells, 0.1 * np.arange(len(poses)), poses)


def simulated(drive):
    """Return the increments of the chair that does what it is asked, (m, 3)."""
    none = np.zeros(round(len(drive.v) * GRID / STEP))
    return drive_of(len(none) * STEP, none, none).measured


@pytest.mark.parametrize("late", [0.0, 1.0, -1.0])
@pytest.mark.parametrize("size", [0.001, 0.3], ids=["little", "much"])
@pytest.mark.parametrize("rates", ["v", "w", "both"])
def test_errors_act_along_the_way(late, size, rates):
    """With errors of v and w alike, to the second order: their means and how late they are say what they do."""
    t = np.arange(0, 3.0, STEP)
    error = size * (0.5 + late * (np.arange(len(t)) % 200 / 200 + STEP - 0.5))  # the same in each increment
    drive = drive_of(3.0, error * 0.1 * (rates != "w"), error * (rates != "v"))
    change = drive.measured - simulated(drive)
    c, s, x, y, late_c, late_s, late_x, late_y = drive.pose_paths.T
    mean, lateness = 0.1 * size * 0.5, 0.1 * size * late / 12
    told = 0.1 * (rates != "w") * np.stack([c * mean + late_c * lateness, s * mean + late_s * lateness])
    told += (rates != "v") * np.stack([-y * mean - late_y * lateness, x * mean + late_x * lateness])
    np.testing.assert_allclose(change[:, :2], told.T, atol=1.5e-3 * size * 0.1 * 0.3 + 1e-9)


def test_noise_of_the_motion_is_white_under_an_exact_reference():
    """Along the chord it was not, and drives were told of curves and slopes that nobody had put in."""
    rng = np.random.default_rng(3)
    tau, sd_v, sd_w = 0.3, 0.04, 0.08
    count = round(120.0 / STEP)
    decay = np.exp(-STEP / tau)
    drawn = rng.standard_normal((count, 2)) * np.sqrt(1 - decay**2) * [sd_v, sd_w]
    error = np.empty_like(drawn)
    last = rng.standard_normal(2) * [sd_v, sd_w]
    for i, row in enumerate(drawn):
        last = decay * last + row
        error[i] = last
    drive = drive_of(120.0, *error.T)
    noise = Noise(position_sd=1e-5, heading_sd=1e-5, sd_v=sd_v, sd_lateral=1e-5, sd_w=sd_w, tau=tau)
    left = (drive.measured - simulated(drive)).reshape(-1, 1)
    white = whitened(drive, left, noise)[0].reshape(-1, 3)
    squares = np.mean(white**2, axis=0)
    assert (squares > 0.6).all()
    assert (squares < 1.2).all()
    along = np.mean(white[1:] * white[:-1], axis=0) / squares
    np.testing.assert_allclose(along, 0.0, atol=0.2)  # along the chord: 0.8


def test_turns_are_counted_the_short_way():
    """A reference whose heading was lost across a gap may be a whole turn off."""
    times, edges = np.array([0.0, 0.1]), np.array([0.0, 0.1])
    path = np.array([[0.0, 0.0, 0.0], [0.03, 0.0, 0.1]])
    poses = path.copy()
    poses[1, 2] += 2 * np.pi
    np.testing.assert_allclose(pose_paths(times, poses, edges, path), pose_paths(times, path, edges, path), atol=1e-9)
    np.testing.assert_allclose(geometry.wrap(poses[1, 2]), 0.1)
