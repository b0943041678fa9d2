# SPDX-License-Identifier: BSD-3-Clause
"""What a curve does to the increments: against the simulated drive itself, and however its basis is stored."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from kurumaisu.bench.hidden.base import recordings
from kurumaisu.bench.hidden.generator.noise import USUAL
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.covariates import with_covariates
from kurumaisu.critic.base.drive import edges_of, prepare, split
from kurumaisu.critic.base.sensitivity import Sensitivity, reference_increments
from kurumaisu.critic.unknown import curves as curves_
from kurumaisu.critic.unknown.bases import Basis
from kurumaisu.effects import smooth_id
from kurumaisu.params import EffectSetting, load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))


@pytest.fixture(scope="module")
def drive():
    drives = recordings.draw_drives("rich", USUAL, np.random.default_rng(4), seconds=20.0, rate=50.0)
    return prepare(recordings.recording("columns", drives, []).runs[0], MODEL)


@pytest.fixture(scope="module")
def placed():
    """Return the drive with where it was: that is where a reference is bent."""
    drives = recordings.draw_drives("rich", USUAL, np.random.default_rng(4), seconds=20.0, rate=50.0)
    run = recordings.recording("columns", drives, []).runs[0]
    return with_covariates(prepare(run, MODEL), run)


def seen_within_a_cell(drive):
    """Return the drive as seen by a reference of which several poses fall between two points of the grid."""
    times = np.concatenate([drive.times[:1] + 1.0 + 0.0031 * np.arange(40), drive.times[60:64]])
    poses = np.stack([np.interp(times, drive.times, column) for column in drive.poses.T], axis=-1)
    return drive.seen_at(times, poses)


@pytest.mark.parametrize("channel", ["v", "lateral", "w", "v_gain", "w_gain", "curvature", "speed"])
@pytest.mark.parametrize("cut", ["whole", "part", "within a cell"])
def test_columns_are_what_a_little_of_the_curve_changes(drive, channel, cut):
    seen = {"whole": drive, "part": split(drive, 3)[1], "within a cell": seen_within_a_cell(drive)}[cut]
    motion = replay.motion(seen, MODEL, ())
    along = "v" if channel == "w_gain" else "w"
    knots = np.array([-0.5, 0.0, 0.4])
    values = np.array([0.7, -0.4, 1.0])
    rates = np.interp(motion.v if along == "v" else motion.w, knots, values)[:, None]
    small = 1e-5

    def moved(sign):
        named = {f"knot_{i}": float(k) for i, k in enumerate(knots)}
        named |= {f"value_{i}": float(sign * small * value) for i, value in enumerate(values)}
        return replay.increments(seen, MODEL, [EffectSetting(smooth_id(channel, along), named)]).ravel()

    wanted = (moved(1) - moved(-1)) / (2 * small)
    assert np.abs(wanted).max() > 1e-3
    np.testing.assert_allclose(Sensitivity(seen, motion).increments(channel, rates)[:, 0], wanted, atol=5e-6)


@pytest.mark.parametrize("channel", ["reference_x", "reference_y", "reference_heading"])
@pytest.mark.parametrize("covariate", ["x", "y", "w"])
@pytest.mark.parametrize("cut", ["whole", "part", "within a cell"])
def test_columns_of_a_reference_are_what_a_little_of_its_curve_changes(placed, channel, covariate, cut):
    seen = {"whole": placed, "part": split(placed, 3)[1], "within a cell": seen_within_a_cell(placed)}[cut]
    motion = replay.motion(seen, MODEL, ())
    basis = Basis(covariate, np.array([-1.0, 0.0, 0.4, 1.5]), {}, (), 0.0, 1.0)
    small = 1e-5 * np.array([0.7, -0.4, 1.0, 0.2])

    def moved(sign):
        setting = EffectSetting(smooth_id(channel, covariate), basis.parameters(sign * small))
        return replay.increments(seen, MODEL, [setting]).ravel()

    wanted = (moved(1) - moved(-1)) / 2
    assert np.abs(wanted).max() > 1e-8
    errors = basis.matrix(edges_of(basis.samples(motion)))
    found = reference_increments(seen, motion, channel, errors) @ small
    np.testing.assert_allclose(found, wanted, atol=5e-4 * np.abs(wanted).max())


@pytest.mark.parametrize("channel", ["v", "w"])
def test_a_sparse_basis_does_what_it_does_written_out(drive, channel):
    sensitivity = Sensitivity(drive, replay.motion(drive, MODEL, ()))
    cells = np.arange(len(drive.v))
    sparse = csr_array((np.ones(len(cells)), (cells, cells // 20)))
    np.testing.assert_allclose(
        sensitivity.increments(channel, sparse), sensitivity.increments(channel, sparse.toarray()), atol=1e-15
    )


def test_waves_that_are_turned_on_from_one_to_the_next_are_waves():
    way = np.linspace(0.0, 80.0, 500)
    waves = np.linspace(0.4, 3.3, 37)  # more than go at once, and no multiple of it
    waved = np.column_stack(list(curves_._waves(way, waves))).reshape(len(way), -1, 2)
    phase = 2 * np.pi * np.multiply.outer(way, waves)
    np.testing.assert_allclose(waved, np.stack([np.cos(phase), np.sin(phase)], axis=-1), atol=1e-11)


def test_no_rates_do_nothing(drive):
    motion = replay.motion(drive, MODEL, ())
    none = Sensitivity(drive, motion).increments("v", np.empty((len(motion.v), 0)))
    assert none.shape == (drive.measured.size, 0)
