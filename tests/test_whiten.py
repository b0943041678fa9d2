# SPDX-License-Identifier: BSD-3-Clause
"""The whitening filter against the joint covariance written out in full."""

from itertools import pairwise

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
    "lasting": 0.0,
    "lasting_tau": 0.8,
}


def run(n: int, seed: int):
    rng = np.random.default_rng(seed)
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.05, 0.4, n))])
    poses = np.cumsum(rng.normal(0, [0.05, 0.02, 0.1], (n + 1, 3)), axis=0)
    return times, poses


def integral_covariance(a, b, c, d, tau):
    """Of a unit OU process over (a, b) and over (c, d): its integrals, plain and weighted by how late it is, (2, 2)."""

    def product(first, second):
        def kernel(t, s):
            weights = ((s - a) / (b - a) - 0.5) ** first * ((t - c) / (d - c) - 0.5) ** second
            return weights * np.exp(-abs(s - t) / tau)

        if a != c:
            return dblquad(kernel, a, b, lambda s: c, lambda s: d, epsabs=1e-12)[0]
        # The kernel has a kink where the times are the same: on each side of it there is none.
        below = dblquad(kernel, a, b, lambda s: c, lambda s: s, epsabs=1e-13)[0]
        return below + dblquad(kernel, a, b, lambda s: s, lambda s: d, epsabs=1e-13)[0]

    return np.array([[product(i, j) for j in (0, 1)] for i in (0, 1)])


def arcs(poses):
    """Return the ways of a chair that drives straight from pose to pose while it turns evenly, (n, 8)."""
    share = (np.arange(4000) + 0.5) / 4000
    out = []
    for here, there in pairwise(poses):
        dx, dy, turn = geometry.between(here, there)
        along = np.stack([np.cos(share * turn), np.sin(share * turn), (1 - share) * dx, (1 - share) * dy])
        out.append([*along.mean(axis=1), *(np.polyfit(share, row, 1)[0] for row in along)])
    return np.array(out)


def motion(way):
    """Return the derivative of an increment by the integrals of rate errors, plain and by lateness, (2, 3, 3)."""
    plain, late = ([[c, -s, -y], [s, c, x], [0, 0, turn]] for (c, s, x, y), turn in ((way[:4], 1), (way[4:], 0)))
    return np.array(plain), np.array(late)


def joint_covariance(times, poses, noise, activity, rolling, ways):
    """Of all increments' residuals, by numerical derivatives of the increments and quadrature of the OU processes."""
    n = len(times) - 1
    sds = [noise["position_sd"], noise["position_sd"], noise["heading_sd"]]
    shared = noise["lasting"] * np.exp(-abs(times[:, None] - times) / noise["lasting_tau"])
    same_pose = shared + (1 - noise["lasting"]) * np.eye(n + 1)
    by_pose = np.zeros((3 * n, 3 * (n + 1)))
    step = 1e-6
    for j in range(3 * (n + 1)):
        up, down = poses.copy(), poses.copy()
        up.flat[j] += step
        down.flat[j] -= step
        by_pose[:, j] = (
            (geometry.between(up[:-1], up[1:]) - geometry.between(down[:-1], down[1:])) / (2 * step)
        ).ravel()
    cov = by_pose @ np.kron(same_pose, np.diag(np.square(sds))) @ by_pose.T
    motions = [motion(way) for way in ways]
    for j in range(n):
        for k in range(n):
            for sd, tau in zip(noise["process_sd"], noise["process_tau"], strict=True):
                shared = integral_covariance(*times[j : j + 2], *times[k : k + 2], tau)
                first, second = motions[j], motions[k] * np.square(sd)
                block = activity[j] * activity[k] * np.einsum("pab,pq,qcb->ac", first, shared, second)
                if j == k:
                    block += rolling[k] ** 2 * shared[0, 0] * first[0] @ second[0].T
                cov[3 * j : 3 * j + 3, 3 * k : 3 * k + 3] += block
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
@pytest.mark.parametrize("lasting", [0.0, 0.6])
def test_against_the_joint_covariance(slow, activity, rolling, count, lasting):
    times, poses = run(6, 1)
    columns = np.random.default_rng(2).normal(size=(18, count))
    noise = {**NOISE, "process_sd": [NOISE["process_sd"][0], slow], "lasting": lasting}
    ways = arcs(poses)
    factors = [np.array(each, dtype=float) for each in (activity, rolling)]
    whitener = Whitener(poses, times, *factors, ways, **noise)
    white, log_determinants = whitener.whiten(columns), whitener.log_determinants
    cov = joint_covariance(times, poses, noise, activity, rolling, ways)
    np.testing.assert_allclose(whitener.gram(columns), white.T @ white, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(white.T @ white, columns.T @ np.linalg.solve(cov, columns), rtol=1e-5)
    assert log_determinants.sum() == pytest.approx(np.linalg.slogdet(cov)[1], abs=1e-4)


@pytest.mark.parametrize("count", [7, 8, 9, 21])  # increments, of which products are summed several at a time
def test_products_of_a_longer_drive_are_those_of_its_columns(count):
    times, poses = run(count, 1)
    columns = np.random.default_rng(2).normal(size=(3 * count, 11))
    whitener = Whitener(poses, times, np.ones(count), np.ones(count), arcs(poses), **NOISE)
    white = whitener.whiten(columns)
    np.testing.assert_allclose(whitener.gram(columns), white.T @ white, rtol=1e-10, atol=1e-10)


def test_short_steps_do_not_cancel():
    times = np.arange(50) * 1e-4
    poses = np.zeros((50, 3))
    whitener = Whitener(poses, times, np.ones(49), np.zeros(49), arcs(poses), **NOISE)
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
        ({"ways": np.zeros((5, 8))}, "one finite row per increment"),
        ({"ways": np.full((6, 8), np.nan)}, "one finite row per increment"),
        ({"process_tau": [0.0, 1.0]}, "positive"),
        ({"process_tau": [1.0, 0.0]}, "positive"),
        ({"lasting": 1.0}, "share below 1"),
        ({"lasting": -0.1}, "share below 1"),
        ({"lasting_tau": 0.0}, "lasting_tau positive"),
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
        "ways": arcs(poses),
        **NOISE,
        **change,
    }
    with pytest.raises(ValueError, match=message):
        Whitener(**arguments)


def test_columns_of_another_drive_are_refused():
    times, poses = run(6, 1)
    with pytest.raises(ValueError, match="three rows per increment"):
        Whitener(poses, times, np.ones(6), np.zeros(6), arcs(poses), **NOISE).whiten(np.zeros((17, 1)))
