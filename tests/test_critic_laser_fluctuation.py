# SPDX-License-Identifier: BSD-3-Clause
"""What differs from scan to scan is noise; what all scans of a stand share is a miss of something, and no scatter."""

import numpy as np
import pytest

from kurumaisu import effects
from kurumaisu.bench.hidden import Ask, make
from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.critic.ranges.noise.scan_noise import NoiseLikelihood, with_lasting_common_mode
from kurumaisu.critic.ranges.noise.shared_errors import Gram, Grams, Layout, ScanNoise, whitened
from kurumaisu.critic.ranges.scans.gathering import gather
from kurumaisu.critic.ranges.scans.valid_readings import cut_off_ends
from kurumaisu.critic.ranges.search.normal_equations import Assembly
from kurumaisu.critic.scatter.scan_fit import fluctuating
from kurumaisu.critic.scatter.statistics import Statistics
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
POSES = ScanNoise(position_sd=0.01, heading_sd=0.002, common_sd=1e-4, common_tau=1.0)


def say(_):
    """Progress that nobody reads."""


@pytest.fixture(scope="module")
def stands(tmp_path_factory):
    """Scans of stands in a room, 7 of each, without anything hidden."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("kurumaisu.critic.ranges.scans.gathering.MOST_SCANS", 84)
        case = make(Ask("null", regime="clean", design="room", family="laser"), 7, tmp_path_factory.mktemp("room"))
        return Assembly(gather(case.recording, MODEL), frozenset())


def numbers(assembly, error, readings=None):
    """The statistics by name, of readings that are off by this."""
    statistics = Statistics(assembly, POSES)
    base = assembly.marks.base
    said = base + error if readings is None else readings
    off = np.where(np.isfinite(said), said - base, np.nan)
    return dict(zip(statistics.names(), statistics.of(np.round(said, 3), off), strict=True))


def noise(assembly, seed):
    return assembly.first.sd * np.random.default_rng(seed).standard_normal(assembly.residual.shape)


@pytest.mark.parametrize(("each", "told"), [("stand", False), ("scan", True)])
def test_scans_are_off_together_only_where_they_differ_within_a_stand(stands, each, told):
    """What an equation misses differs from stand to stand, as the walls do."""
    rng, stand = np.random.default_rng(2), stands.layout.stand
    off = rng.standard_normal(stand.max() + 1)[stand] if each == "stand" else rng.standard_normal(len(stand))
    plain, moved = noise(stands, 3), noise(stands, 3) + 4e-4 * off[:, np.newaxis]
    name = "spread of whole scans"
    assert (numbers(stands, moved)[name] - numbers(stands, plain)[name] > 0.5) == told


@pytest.mark.parametrize(("kept", "told"), [(True, False), (False, True)])
def test_neighbours_correlate_by_what_no_beam_keeps(stands, kept, told):
    """Offsets that beams have for good may be alike, too: a mirror is polished, not rolled by dice."""
    rng, shape = np.random.default_rng(4), stands.residual.shape
    rough = rng.standard_normal((1 if kept else shape[0], shape[1] + 2))
    alike = (rough[:, 2:] + rough[:, 1:-1] + rough[:, :-2]) / np.sqrt(3)
    found = numbers(stands, noise(stands, 5) + 0.5 * stands.first.sd * alike)
    assert (found["correlation of beams 1 apart"] > 0.08) == told


@pytest.mark.parametrize(("kept", "told"), [(True, False), (False, True)])
def test_how_far_readings_scatter_is_what_no_beam_keeps(stands, kept, told):
    """Offsets of beams are as large at an incidence as their draws happen to be: noise that grows with it hid there."""
    rng, shape = np.random.default_rng(6), stands.residual.shape
    more = stands.first.sd * rng.standard_normal((1, shape[1]) if kept else shape)
    plain, moved = numbers(stands, noise(stands, 5)), numbers(stands, noise(stands, 5) + more)
    by_incidence = [moved[name] - plain[name] for name in plain if name.startswith("spread, incidence")]
    assert (min(by_incidence) > 0.4) == told
    assert (max(by_incidence) > 0.1) == told
    name = "spread of the means per beam"
    assert (moved[name] - plain[name] > 0.8) == kept  # what scatters spreads them by no more than it does by chance
    assert abs(moved[name] - plain[name]) < 0.3 or kept


def test_of_scans_that_stand_alone_goes_what_beams_keep_in_all_of_them():
    rng = np.random.default_rng(1)
    z, inside = rng.standard_normal((9, 50)), rng.random((9, 50)) < 0.9
    stand = np.array([-1, -1, -1, 0, 0, 0, 0, 1, -1])
    inside[3:6, 0] = False
    out, known = fluctuating(z, inside, stand)
    for group in ([0, 1, 2, 7, 8], [3, 4, 5, 6]):
        whole = inside[group].all(axis=0)
        np.testing.assert_allclose(out[group].sum(axis=0), 0, atol=1e-12)
        np.testing.assert_allclose(
            (out[group] ** 2).sum(axis=0)[whole], len(group) * z[group].var(axis=0, ddof=1)[whole]
        )
    assert inside[6, 0]
    assert not known[6, 0]  # it has nothing to differ from
    assert (out[~inside] == 0).all()


@pytest.mark.parametrize(("louder", "least", "most"), [(1.0, -0.05, 0.05), (1.2, 0.3, 0.42)])
def test_what_is_cut_off_says_nothing_of_the_scatter(stands, louder, least, most):
    """Though the poses err by a centimetre, which moves readings of oblique walls over the cut."""
    statistics = Statistics(stands, POSES)
    error = louder * noise(stands, 6) + statistics.pose_errors(np.random.default_rng(8))
    cut = float(np.quantile(stands.marks.base[stands.geometry], 0.6))
    found = numbers(stands, error, np.minimum(stands.marks.base + error, cut))
    assert found["upper cut-off of the readings"] == pytest.approx(cut / 0.05, abs=0.02)
    spread = [found[f"spread, {name} {i} of 4"] for name in ("range", "incidence") for i in (1, 2)]
    assert least < min(spread) <= max(spread) < most
    gone = numbers(stands, error, np.minimum(stands.marks.base + error, 0.2))
    assert np.isfinite(list(gone.values())).all(), "of which not one is left"


def test_a_pile_lies_where_it_lies_on_its_grid():
    """Not a step farther in, as the sums of binary fractions may have it."""
    rng = np.random.default_rng(3)
    for end in np.round(np.arange(2.5, 2.6, 0.001), 3):
        walls = np.round(rng.uniform(1.0, 4.0, 4000), 3)
        assert cut_off_ends(np.minimum(walls, end))[1] == pytest.approx(end, abs=1e-9)


def test_columns_that_others_draw_as_well_speak_for_no_noise():
    """A curve over the time has a knot for each stand, and one over the heading another for the same."""
    rng, count, each = np.random.default_rng(5), 12, 8
    stand = np.repeat(np.arange(count), each)
    layout = Layout(100.0 * stand + 0.1 * np.tile(np.arange(each), count), np.zeros(len(stand), dtype=int), stand)
    sd, beams = np.full(40, 0.002), np.ones(40, dtype=bool)
    grams = []
    for k in stand:
        once = np.tile(np.eye(count)[k], (40, 1))
        left = 0.002 * rng.standard_normal((40, 1))
        rows = whitened(np.hstack([np.ones((40, 1)), once, once, left]), beams, sd, 0.0)
        grams.append(Gram(rows.T @ rows, 0, 1))
    few, many = (NoiseLikelihood(Grams.summed(grams), layout, np.arange(n)) for n in (count, 2 * count))
    noises = [ScanNoise(0.002, 0.001, common, 1.0) for common in (1e-5, 8e-4)]
    cost = [[likelihood(noise) for noise in noises] for likelihood in (few, many)]
    assert np.diff(cost[1]) == pytest.approx(np.diff(cost[0]), abs=1e-3)
    assert np.diff(cost[0]) > 1.0, "scans are not off together"


@pytest.mark.parametrize("there", [True, False])
def test_a_common_mode_may_last_as_long_as_stands_that_are_shorter_cannot_deny(there):
    """What it wanders by within a stand is known; what stands differ by is not, and effects must be surer than that."""
    rng, count, each, beams = np.random.default_rng(6), 15, 16, 40
    stand = np.repeat(np.arange(count), each)
    layout = Layout(100.0 * stand + 0.1 * np.tile(np.arange(each), count), np.zeros(len(stand), dtype=int), stand)
    walk = np.concatenate([np.cumsum(2e-4 * rng.standard_normal(each)) for _ in range(count)])
    grams = []
    for k in range(len(stand)):
        left = 0.001 * rng.standard_normal((beams, 1)) + there * walk[k]
        columns = np.hstack([np.ones((beams, 1)), np.tile(np.eye(count)[stand[k]], (beams, 1)), left])
        rows = whitened(columns, np.ones(beams, dtype=bool), np.full(beams, 0.001), 0.0)
        grams.append(Gram(rows.T @ rows, 0, 1))
    likeliest = ScanNoise(0.002, 0.001, 4.5e-4 if there else 2e-5, 1.0)
    wary = with_lasting_common_mode(NoiseLikelihood(Grams.summed(grams), layout), likeliest)
    if not there:
        assert wary == likeliest, "there is none"
        return
    assert wary.common_tau > 3.0
    assert wary.common_sd**2 / wary.common_tau == pytest.approx(0.5 * 2e-4**2 / 0.1, rel=0.4)


def test_what_comes_and_goes_with_the_time_is_no_common_mode(tmp_path, monkeypatch):
    monkeypatch.setattr("kurumaisu.critic.ranges.scans.gathering.MOST_SCANS", 72)
    case = make(Ask("unknown", ("pulse_bias",), regime="clean", family="laser"), 29464, tmp_path)
    ids = frozenset({"laser.common_mode", "laser.offset", "laser.warmup", effects.SMOOTH})
    finding = criticise_scans(case.recording, MODEL, say, ids)
    assert finding.causes == ()
    assert any(unknown.covariate == "time" for unknown in finding.unknown[:3])
    null = criticise_scans(case.null, MODEL, say, ids)
    assert (null.causes, null.unknown, null.confounded) == ((), (), ())
