# SPDX-License-Identifier: BSD-3-Clause
"""The generator of hidden faults: its noise, its z, its nulls, and that a seed says all."""

from dataclasses import replace

import numpy as np
import pytest

from kurumaisu.bench.hidden import Ask, make, names_of
from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.base.recordings import Scale, draw_drives, gates
from kurumaisu.bench.hidden.base.sizing import left_after_rivals, size_for
from kurumaisu.bench.hidden.base.whitening import Path, Whitener, deviation
from kurumaisu.bench.hidden.generator.drives import rich
from kurumaisu.bench.hidden.generator.motion import STEP, Setting, drive, integrate
from kurumaisu.bench.hidden.generator.noise import REGIMES, Colour, Regime, draw_rates, draw_reference
from kurumaisu.bench.hidden.unknown.forms import UNKNOWN_BASE
from kurumaisu.errors import Error

WITHOUT = ("base.sign", "base.steering_law", "base.process_noise")  # a size to choose, or a mean
MEANS = [name for name in BASE if name not in WITHOUT]


def same(one, other):
    return all(
        np.array_equal(getattr(a, part).values, getattr(b, part).values)
        for a, b in zip(one.runs, other.runs, strict=True)
        for part in ("command", "voltage", "pose")
    )


def test_a_seed_says_all():
    ask = Ask("pair")
    first, again, other = make(ask, 3), make(ask, 3), make(ask, 4)
    assert same(first.recording, again.recording)
    assert first.truth.ids == again.truth.ids
    assert first.truth.z == pytest.approx(again.truth.z, rel=1e-9)
    assert not same(first.recording, other.recording)


def test_a_null_is_the_twin_without_the_fault():
    one, other = make(Ask("single", ("base.gain_v",)), 5), make(Ask("single", ("base.lag_w",)), 5)
    assert same(one.null, other.null)
    assert not same(one.null, one.recording)
    nothing = make(Ask("null"), 5)
    assert same(nothing.null, nothing.recording)
    assert nothing.truth.ids == ()


@pytest.mark.parametrize("name", REGIMES)
def test_the_noise_of_the_rates_is_what_was_asked_for(name):
    regime = REGIMES[name]
    noise = draw_rates(regime, 400_000, np.random.default_rng(1))
    asked = np.sum([np.square(colour.sd) for colour in regime.colours], axis=0)
    np.testing.assert_allclose(noise.var(axis=0), asked, rtol=0.15)
    lag = round(0.1 / STEP)
    kept = np.sum([np.square(colour.sd) * np.exp(-0.1 / colour.tau) for colour in regime.colours], axis=0)
    np.testing.assert_allclose((noise[lag:] * noise[:-lag]).mean(axis=0), kept, atol=0.15 * asked.max())


def test_the_errors_of_the_reference_are_what_was_asked_for():
    regime, stamps = REGIMES["lasting"], np.arange(0, 40_000, 0.1)
    errors = draw_reference(regime, stamps, np.random.default_rng(1))
    np.testing.assert_allclose(errors.var(axis=0), regime.reference_variance, rtol=0.05)
    kept = regime.lasting * np.exp(-0.5 / regime.lasting_tau)
    np.testing.assert_allclose((errors[5:] * errors[:-5]).mean(axis=0), kept * regime.reference_variance, rtol=0.1)


def test_arcs_end_where_geometry_says():
    command = np.array([[0.0, 0.5, 0.4], [5.0, 0.0, 0.0]])
    setting = Setting(command, np.zeros(3), np.array([0.0, 5.0, 5.5]))
    end = drive(setting, ())[0][-1]
    radius = 0.5 / 0.4
    np.testing.assert_allclose(end, [radius * np.sin(2.0), radius * (1 - np.cos(2.0)), 2.0], atol=1e-5)


def test_what_the_reference_sees_of_a_null_is_drive_and_noise_only():
    """Body steps of the null beside the noise-free drive: zero mean, no more spread than the noise makes."""
    regime = Regime((Colour((1e-9, 1e-9, 1e-9), 0.3),), 0.004, 0.002)
    drives = draw_drives("rich", regime, np.random.default_rng(2))
    for setting, error in zip(drives.settings, drives.errors, strict=True):
        left = drive(setting, ())[0] + error - drive(Setting(setting.command, setting.start, setting.stamps), ())[0]
        np.testing.assert_allclose(left.std(axis=0), [0.004, 0.004, 0.002], rtol=0.12)
        assert np.all(np.abs(left.mean(axis=0)) < 4 * left.std(axis=0) / np.sqrt(len(left)))


@pytest.fixture(scope="module")
def scale():
    return Scale(draw_drives("rich", REGIMES["usual"], np.random.default_rng(8)))


@pytest.mark.parametrize("form", ["plain", "other"])
@pytest.mark.parametrize("name", MEANS)
def test_every_base_id_reaches_the_z_that_is_asked_for(name, form, scale):
    hidden = BASE[name]
    make_fault = lambda sizes: hidden.fault(sizes, form)  # noqa: E731
    sizes = size_for(scale, make_fault, hidden.draw(np.random.default_rng(9)), hidden.most, 15.0)
    assert np.linalg.norm(scale.signals([[make_fault(sizes)]])) == pytest.approx(15.0, rel=0.1)


@pytest.mark.parametrize("name", WITHOUT)
def test_what_has_no_size_or_no_mean_is_there(name):
    case = make(Ask("single", (name,), z=15.0, regime="usual"), 8)
    assert case.truth.z > 14
    assert not same(case.recording, case.null)


def test_z_is_that_of_a_dense_covariance():
    """The filter's z against the covariance of poses made of every noise increment on a fine grid."""
    regime = Regime((Colour((0.02, 0.01, 0.05), 0.4), Colour((0.01, 0.002, 0.02), 2.0)), 0.004, 0.006)
    command = np.array([[0.0, 0.5, 0.3], [2.0, -0.3, 0.4], [3.5, 0.0, 0.0]])
    stamps = np.arange(0.0, 4.0, 0.1)
    setting = Setting(command, np.array([0.3, -0.2, 0.7]), stamps)
    nominal, rates = drive(setting, ())
    fault = BASE["base.gain_w"].fault({"size": 0.05}, "plain")
    signal = deviation(nominal, drive(setting, [fault])[0])
    whitener = Whitener(Path(stamps, nominal[None], gates(rates.moving, stamps)[None]), regime)
    z = np.linalg.norm(whitener.whiten(signal[None, :, :, None]))
    assert z == pytest.approx(dense_z(signal, setting, rates, regime), rel=0.02)


def dense_z(signal, setting, rates, regime):
    path, heading = integrate(rates), rates.headings()
    t, stamps = rates.t, setting.stamps
    n = 3 * len(stamps)
    covariance = np.tile([regime.position_sd**2, regime.position_sd**2, regime.heading_sd**2], len(stamps)) * np.eye(n)
    middle = (path[1:] + path[:-1]) / 2
    response = np.zeros((3, len(stamps), 3, len(t)))  # channel of noise; stamp; x, y, heading; cell
    for k, stamp in enumerate(stamps):
        at = middle[min(round(stamp / STEP), len(t) - 1)]
        past = (t < stamp) * rates.moving * STEP
        response[0, k] = past * np.stack([np.cos(heading), np.sin(heading), 0 * t])
        response[1, k] = past * np.stack([-np.sin(heading), np.cos(heading), 0 * t])
        response[2, k] = past * np.stack([-(at[1] - middle[:, 1]), at[0] - middle[:, 0], 1 + 0 * t])
    for colour in regime.colours:
        kernel = np.exp(-np.abs(t[:, None] - t[None]) / colour.tau)
        for channel, sd in enumerate(colour.sd):
            flat = response[channel].reshape(n, -1)
            covariance += sd**2 * flat @ kernel @ flat.T
    start = np.concatenate([np.eye(3)] * len(stamps))  # a drive begins where it begins; turns move what follows
    start[0::3, 2] = -(nominal_of(setting)[:, 1] - setting.start[1])
    start[1::3, 2] = nominal_of(setting)[:, 0] - setting.start[0]
    weight = np.linalg.inv(covariance)
    flat = signal.ravel()
    left = flat - start @ np.linalg.solve(start.T @ weight @ start, start.T @ weight @ flat)
    return np.sqrt(left @ weight @ left)


def nominal_of(setting):
    return drive(setting, ())[0]


@pytest.mark.parametrize("name", ["two colours", "lasting"])
def test_the_noise_whitens_to_unit_white(name):
    """What the drives of a null deviate from their noise-free twins is what the filter expects."""
    regime = REGIMES[name]
    drives = draw_drives("rich", regime, np.random.default_rng(4), seconds=40.0)
    scale = Scale(drives)
    left = [
        deviation(nominal_of(replace(setting, noise=None)), drive(setting, ())[0] + error)
        for setting, error in zip(drives.settings, drives.errors, strict=True)
    ]
    white = scale.whitener.whiten(np.stack(left)[..., None])[:, 0]
    assert white.std() == pytest.approx(1.0, abs=0.06)
    assert abs(np.corrcoef(white[:-3], white[3:])[0, 1]) < 0.1
    white_again = scale.whitener.whiten(scale.whitener.colour(np.ones((3, len(drives.settings[0].stamps), 3, 2))))
    np.testing.assert_allclose(white_again, 1.0, atol=1e-6)


def test_louder_noise_whitens_to_unit_white_where_it_is_known():
    fault = BASE["base.process_noise"].fault({"size": 3.0}, "plain")
    drives = draw_drives("rich", REGIMES["usual"], np.random.default_rng(5), seconds=40.0)
    left = np.stack(
        [
            deviation(nominal_of(replace(setting, noise=None)), drive(setting, [fault])[0] + error)
            for setting, error in zip(drives.settings, drives.errors, strict=True)
        ]
    )
    scale = Scale(drives)
    assert scale.louder(fault).whitener.whiten(left[..., None]).std() == pytest.approx(1.0, abs=0.08)
    assert scale.whitener.whiten(left[..., None]).std() > 1.5


def test_what_hides_in_loud_noise_is_sized_by_that_noise():
    quiet = make(Ask("single", ("base.gain_v",), z=15.0, regime="usual", form="plain"), 8).truth
    loud = make(Ask("pair", ("base.gain_v", "base.process_noise"), z=15.0, regime="usual", form="plain"), 8).truth
    assert loud.z_alone == pytest.approx({"base.gain_v": 15.0, "base.process_noise": 15.0}, rel=0.05)
    sizes = [abs(truth.parameters["base.gain_v"]["gain"]) for truth in (quiet, loud)]
    assert sizes[1] > 1.05 * sizes[0]


@pytest.mark.parametrize(("z", "apart"), [(10.0, False), (200.0, True)])
def test_a_short_delay_is_a_lag_of_both_axes_and_a_long_one_is_not(z, apart):
    truth = make(Ask("single", ("base.delay",), z=z, regime="usual"), 9).truth
    assert truth.rival == "base.payload"
    assert (truth.z_rival > 20.0) == apart
    assert apart or truth.z_rival < 3.0


def test_a_rival_is_tried_in_the_place_of_one_cause_beside_the_others():
    """Turning about a point beside base_link is a marker there, whatever the turns are; a slower left turn is none."""
    truth = make(Ask("pair", ("base.left_right_gain", "base.cross_w_to_v"), z=50.0, regime="usual"), 9).truth
    assert truth.rival == "base.marker_y"
    assert truth.z_rival < 0.5
    assert min(truth.z_alone.values()) > 40.0


def test_z_left_beside_a_rival_is_the_projection():
    rng = np.random.default_rng(6)
    signal, columns = rng.standard_normal(50), rng.standard_normal((50, 2))
    q = np.linalg.qr(columns)[0]
    left = np.sqrt(signal @ signal - ((q.T @ signal) ** 2).sum())
    assert left_after_rivals(signal, {"rival": columns})["rival"] == pytest.approx(left)


def test_an_exact_pair_is_known_as_such():
    truth = make(Ask("single", ("base.cross_w_to_v",), z=20.0), 9).truth
    assert truth.rival == "base.marker_y"
    assert truth.z_rival < 0.5
    assert ("base.marker_y",) in truth.accepted


@pytest.mark.parametrize("name", names_of("unknown", "base"))
def test_what_is_in_no_catalogue_is_left_by_all_of_it(name):
    truth = make(Ask("unknown", (name,), z=8.0, regime="usual"), 10).truth
    assert truth.ids == ()
    assert truth.z == pytest.approx(8.0, rel=0.1)
    assert truth.z_rival >= truth.z * 0.99


@pytest.mark.parametrize(
    ("name", "sizes", "law"),
    [
        ("heading_veer", {"size": 0.2, "bearing": 0.5}, lambda path: (0, 0.2 * np.sin(path[2] - 0.5))),
        ("draught", {"size": 0.2, "door": 0.3}, lambda path: (0, 0.2 * np.exp(-2 * (path[1] - 0.3) ** 2))),
        ("carpet", {"size": 0.3, "edge": 0.2}, lambda path: (-0.3 * (path[0] > 0.2), 0)),
    ],
)
def test_what_follows_the_pose_follows_the_one_that_the_chair_has(name, sizes, law):
    """By noise, and by what it does itself, the chair is soon elsewhere than it was asked to be."""
    noise = draw_rates(REGIMES["usual"], round(63.0 / STEP), np.random.default_rng(3))
    command = rich(60.0, np.random.default_rng(4))
    setting = Setting(command, np.zeros(3), np.arange(0.0, 61.0, 0.1), noise)
    nominal, rates = drive(setting, ())[1], drive(setting, [UNKNOWN_BASE[name].fault(sizes, "plain")])[1]
    path = integrate(rates)
    middle = 0.5 * (path[:-1] + path[1:])
    assert np.abs(path - integrate(nominal)).max() > 0.5
    in_v, in_w = law(middle.T)
    np.testing.assert_allclose(rates.w - nominal.w, in_w * rates.moving, atol=1e-3)
    assert np.mean(np.abs(rates.v - nominal.v * (1 + in_v)) > 1e-9) < 0.01  # but for the cells in which an edge lies


@pytest.mark.parametrize("name", names_of("wrong", "base"))
def test_wrong_data_differ_from_their_null(name):
    case = make(Ask("wrong", (name,)), 11)
    assert not all(
        np.array_equal(getattr(a, part).t, getattr(b, part).t)
        and np.array_equal(getattr(a, part).values, getattr(b, part).values)
        for a, b in zip(case.recording.runs, case.null.runs, strict=True)
        for part in ("command", "voltage", "pose")
    )
    assert all(np.all(np.diff(run.pose.t) > 0) for run in case.recording.runs)


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (Ask("singel"), "singel"),
        (Ask("single", ("base.nothing",)), "base.nothing"),
        (Ask("single", ("laser.tilt",)), "folder"),
        (Ask("pair", ("laser.tilt", "base.gain_v")), "all of the base"),
    ],
)
def test_what_cannot_be_hidden_is_said(ask, message):
    with pytest.raises(Error, match=message):
        make(ask, 1)
