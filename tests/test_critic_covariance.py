# SPDX-License-Identifier: BSD-3-Clause
"""Noise that is larger along a few directions, against the whole matrix, written out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import null_space
from scipy.stats import multivariate_normal

from kurumaisu.critic.engine.covariance import Covariance, orthonormal, without

ROWS = 12


@st.composite
def columns(draw, most=5):
    """Columns of sizes from hardly any to far above the noise, some of them the sum of others, or none at all."""
    rng = np.random.default_rng(draw(st.integers(0, 999)))
    count = draw(st.integers(0, most))
    u = rng.standard_normal((ROWS, count)) * 10.0 ** rng.uniform(-1, 3, count)
    if count > 2 and draw(st.booleans()):
        u[:, 0] = u[:, 1] + u[:, 2]
    return u


def residual(seed):
    return 3 * np.random.default_rng(seed).standard_normal(ROWS)


@given(columns(), st.integers(0, 999))
def test_it_is_the_identity_and_the_columns(u, seed):
    dense, r, covariance = np.eye(ROWS) + u @ u.T, residual(seed), Covariance(u)
    assert covariance.log_determinant == pytest.approx(np.linalg.slogdet(dense)[1], abs=1e-3)
    np.testing.assert_allclose(covariance.inverse(r), np.linalg.solve(dense, r), rtol=1e-4, atol=1e-3)
    directions = covariance.along(np.eye(ROWS))
    np.testing.assert_allclose(directions @ directions.T, np.eye(len(directions)), atol=1e-3)
    np.testing.assert_allclose((directions.T * covariance.variances) @ directions, u @ u.T, rtol=1e-6, atol=1e-3)


@given(columns(), st.integers(0, 999))
def test_single_precision_is_enough_along_the_directions(u, seed):
    covariance, x = Covariance(u), np.random.default_rng(seed).standard_normal((ROWS, 3))
    rough = covariance.along(x.astype(np.float32))
    for one in (covariance.lost, covariance.variances / (1 + covariance.variances) ** 2):
        np.testing.assert_allclose(
            (rough.T * one) @ rough, (covariance.along(x).T * one) @ covariance.along(x), atol=1e-3
        )


@given(columns(), columns(), st.floats(0.1, 3.0))
def test_more_columns_beside_it_are_as_if_they_had_been_there(u, x, share):
    found = Covariance(u).scaled(share).beside(x)
    dense = np.eye(ROWS) + share**2 * u @ u.T + x @ x.T
    np.testing.assert_allclose(found.inverse(np.eye(ROWS)), np.linalg.inv(dense), atol=2e-3)
    assert found.log_determinant == pytest.approx(np.linalg.slogdet(dense)[1], abs=5e-3)


@given(columns(), st.integers(0, 999))
def test_its_gain_is_that_of_a_normal_distribution_over_white_noise(u, seed):
    r, nothing = residual(seed), np.zeros(ROWS)
    law = multivariate_normal(nothing, np.eye(ROWS) + u @ u.T)
    white = multivariate_normal(nothing, np.eye(ROWS))
    assert Covariance(u).gain(r) == pytest.approx(law.logpdf(r) - white.logpdf(r), rel=1e-4, abs=1e-3)


@given(columns(), st.floats(0.1, 3.0))
def test_a_share_of_it_is_that_of_columns_of_that_share(u, share):
    dense = np.eye(ROWS) + share**2 * u @ u.T
    scaled = Covariance(u).scaled(share)
    white = scaled.whiten(np.eye(ROWS))
    np.testing.assert_allclose(white @ dense @ white.T, np.eye(ROWS), atol=2e-3)
    assert scaled.log_determinant == pytest.approx(np.linalg.slogdet(dense)[1], abs=2e-3)


@given(columns(), columns(), st.integers(0, 999))
def test_what_is_whitened_has_the_same_products(u, x, seed):
    """Of columns together as of a residual by itself: X' C^-1 X."""
    covariance, r = Covariance(u), residual(seed)
    inverse = np.linalg.inv(np.eye(ROWS) + u @ u.T)
    size = max(float(np.abs(x).max(initial=0.0)), 1.0)
    white = covariance.whiten(x)
    np.testing.assert_allclose(white.T @ white, x.T @ inverse @ x, atol=1e-3 * size**2)
    np.testing.assert_allclose(white.T @ covariance.whiten(r), x.T @ inverse @ r, atol=1e-2 * size)


def test_without_columns_it_is_white_noise():
    nothing, r = Covariance(np.empty((ROWS, 0))), residual(1)
    assert (nothing.gain(r), nothing.log_determinant) == (0.0, 0.0)
    np.testing.assert_array_equal(nothing.whiten(r), r)


@given(columns(), st.integers(0, 999))
def test_a_basis_spans_what_columns_do_and_the_rest_is_beside_it(u, seed):
    basis = orthonormal(u)
    np.testing.assert_allclose(basis.T @ basis, np.eye(basis.shape[1]), atol=1e-6)
    scaled = u / np.maximum(np.linalg.norm(u, axis=0), 1e-12)  # small columns count as large ones do
    r = residual(seed)
    beside = null_space(scaled.T, rcond=1e-6) if u.shape[1] else np.eye(ROWS)
    assert basis.shape[1] == ROWS - beside.shape[1]
    np.testing.assert_allclose(without(basis, r), beside @ (beside.T @ r), atol=1e-5)
