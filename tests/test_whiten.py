# SPDX-License-Identifier: BSD-3-Clause
"""The whitening filter against the joint covariance written out in full."""

import numpy as np
import pytest
from scipy.integrate import dblquad

from kurumaisu import geometry
from kurumaisu._core import Whitener

NOISE = {
    "position_sd": 0.01,
    "heading_sd": 0.004,
    "process_sd": [[0.03, 0.008, 0.05], [0.0, 0.0, 0.0]],
    "process_tau": [0.4, 3.0],
}


def run(n: int, seed: int):
    rng = np.random.default_rng(seed)
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.05, 0.4, n))])
    poses = np.cumsum(rng.normal(0, [0.05, 0.02, 0.1], (n + 1, 3)), axis=0)
    return times, poses


def integral_covariance(a, b, c, d, tau):
    """Of the integrals of a unit OU process over (a, b) and (c, d)."""
    inner = dblquad(lambda t, s: np.exp(-abs(s - t) / tau), a, b, lambda s: c, lambda s: d, epsabs=1e-12)
    return inner[0]


def joint_covariance(times, poses, noise, activity, rolling):
    """Of all increments' residuals, by numerical derivatives of the increments and quadrature of the OU processes."""
    n = len(times) - 1
    sds = [noise["position_sd"], noise["position_sd"], noise["heading_sd"]]
    by_pose = np.zeros((3 * n, 3 * (n + 1)))
    step = 1e-6
    for j in range(3 * (n + 1)):
        up, down = poses.copy(), poses.copy()
        up.flat[j] += step
        down.flat[j] -= step
        by_pose[:, j] = (
            (geometry.between(up[:-1], up[1:]) - geometry.between(down[:-1], down[1:])) / (2 * step)
        ).ravel()
    cov = by_pose @ np.diag(np.tile(np.square(sds), n + 1)) @ by_pose.T
    motions = []
    for k in range(n):
        dx, dy, turn = geometry.between(poses[k], poses[k + 1])
        c, s = np.cos(turn / 2), np.sin(turn / 2)
        motions.append(np.array([[c, -s, -dy / 2], [s, c, dx / 2], [0, 0, 1]]))
    for j in range(n):
        for k in range(n):
            for sd, tau in zip(noise["process_sd"], noise["process_tau"], strict=True):
                rates = integral_covariance(*times[j : j + 2], *times[k : k + 2], tau) * np.diag(np.square(sd))
                shared = activity[j] * activity[k] + (rolling[k] ** 2 if j == k else 0.0)
                cov[3 * j : 3 * j + 3, 3 * k : 3 * k + 3] += shared * motions[j] @ rates @ motions[k].T
    return cov


@pytest.mark.parametrize("slow", [[0.0, 0.0, 0.0], [0.02, 0.0, 0.03]], ids=["one colour", "two colours"])
@pytest.mark.parametrize(
    ("activity", "rolling"),
    [
        ([1, 1, 1, 1, 1, 1], [0, 0, 0, 0, 0, 0]),
        ([1.5, 0.0, 0.1, 1.0, 2.0, 0.3], [0, 0, 0, 0, 0, 0]),
        ([1.0, 0.4, 0.0, 0.0, 0.7, 1.0], [0.0, 0.8, 0.6, 0.0, 0.4, 0.0]),
    ],
    ids=["steady", "gated", "rolling"],
)
@pytest.mark.parametrize("count", [1, 2, 11])  # columns go through the filter several at a time
def test_against_the_joint_covariance(slow, activity, rolling, count):
    times, poses = run(6, 1)
    columns = np.random.default_rng(2).normal(size=(18, count))
    noise = {**NOISE, "process_sd": [NOISE["process_sd"][0], slow]}
    whitener = Whitener(poses, times, np.array(activity, dtype=float), np.array(rolling, dtype=float), **noise)
    white, log_determinants = whitener.whiten(columns), whitener.log_determinants
    cov = joint_covariance(times, poses, noise, activity, rolling)
    np.testing.assert_allclose(whitener.gram(columns), white.T @ white, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(white.T @ white, columns.T @ np.linalg.solve(cov, columns), rtol=1e-5)
    assert log_determinants.sum() == pytest.approx(np.linalg.slogdet(cov)[1], abs=1e-4)


def test_short_steps_do_not_cancel():
    times = np.arange(50) * 1e-4
    poses = np.zeros((50, 3))
    whitener = Whitener(poses, times, np.ones(49), np.zeros(49), **NOISE)
    assert np.isfinite(whitener.whiten(np.ones((147, 1)))).all()
    assert np.isfinite(whitener.log_determinants).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"times": np.zeros(7)}, "times must increase"),
        ({"times": np.arange(6.0)}, "same length"),
        ({"poses": np.zeros((7, 2))}, "shape"),
        ({"activity": np.ones(5)}, "activity must have one factor per increment"),
        ({"activity": -np.ones(6)}, "none negative"),
        ({"rolling": np.ones(5)}, "rolling must have one factor per increment"),
        ({"rolling": np.full(6, np.nan)}, "none negative"),
        ({"process_tau": [0.0, 1.0]}, "positive"),
        ({"process_tau": [1.0, 0.0]}, "positive"),
        ({"process_sd": [[0.1, -0.1, 0.1], [0.0, 0.0, 0.0]]}, "positive"),
        ({"process_sd": [[0.1, 0.1, 0.1], [0.0, -0.1, 0.0]]}, "positive"),
    ],
)
def test_bad_input_is_refused(change, message):
    times, poses = run(6, 1)
    arguments = {
        "poses": poses,
        "times": times,
        "activity": np.ones(6),
        "rolling": np.zeros(6),
        **NOISE,
        **change,
    }
    with pytest.raises(ValueError, match=message):
        Whitener(**arguments)


def test_columns_of_another_drive_are_refused():
    times, poses = run(6, 1)
    with pytest.raises(ValueError, match="three rows per increment"):
        Whitener(poses, times, np.ones(6), np.zeros(6), **NOISE).whiten(np.zeros((17, 1)))
