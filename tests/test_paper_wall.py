# SPDX-License-Identifier: BSD-3-Clause
"""Equation (4) from scans of a wall that is made here, by hand, from the paper's numbers; figures 7 to 9 and 12."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from scipy.stats import binom

from kurumaisu.critic.values.recording import LaserMount, Recording, Run, Series
from kurumaisu.errors import Error
from kurumaisu.experiments import load_script
from kurumaisu.paper.commands.wall import figure_12
from kurumaisu.paper.laser import law as laser_law
from kurumaisu.paper.laser import law_file, wall_experiment
from kurumaisu.paper.laser.wall import ahead_of, on_wall, places_of
from kurumaisu.paper.options import load_options
from kurumaisu.params import load_model, shipped
from kurumaisu.ros.paper.command import main

OPTIONS = load_options()
MODEL = shipped("launch/md100.yaml")
LASER = load_model(MODEL).laser
FOUR = (1.004587, 0.058826, 0.002334, -0.000488, 0.000199)
DISTANCES = (0.2, 0.5, 1.0, 2.0, 4.0)
STEP = 2 * np.pi / 1024
HALF = 113  # steps to either side, 40 degrees


def scans(distance, rng, *, half_width=0.5, turned=0.0, sd=1.0, shift=0.0, count=50, gate=5.6):
    """Return readings (count, beams) of a board, by (4) in whole millimetres."""
    bearings = STEP * np.arange(-HALF, HALF + 1)
    r = distance / np.cos(bearings - turned)
    hit = np.abs(r * np.sin(bearings)) < half_width
    mu = FOUR[0] * r + FOUR[1] + shift
    sigma = sd * (FOUR[2] + FOUR[3] * r + FOUR[4] * r**2)
    readings = np.round(mu + sigma * rng.standard_normal((count, len(r))), 3)
    readings[:, ~hit] = np.inf
    readings[readings > gate] = np.inf
    return readings


def recorded(tables):
    runs = []
    for n, table in enumerate(tables):
        t = 0.1 * np.arange(len(table))
        columns = tuple(f"r{i}" for i in range(table.shape[1]))
        runs.append(Run(f"place_{n}", scan=Series(t, table, columns)))
    mount = LaserMount(0.3, 0.0, 0.0, -STEP * HALF, STEP, 2 * HALF + 1)
    return Recording("wall", tuple(runs), train=tuple(run.name for run in runs), laser=mount)


def ahead(seed, distances=DISTANCES, **how):
    rng = np.random.default_rng(seed)
    recording = recorded([scans(d, rng, **how) for d in distances])
    return [ahead_of(p, OPTIONS.wall) for p in places_of(recording, distances, LASER, OPTIONS.wall)]


def error_of(values):
    from kurumaisu._core import LaserError

    return LaserError(
        scale=values[0], datum_offset=values[1], sigma=values[2:], resolution=0.001, range_min=0.06, range_max=5.6
    )


def test_beams_ahead_are_met_where_they_meet_the_wall():
    place = ahead(1)[2]
    assert place.true.min() == pytest.approx(1.0, abs=1e-4)
    assert place.true.max() == pytest.approx(1 / np.cos(OPTIONS.wall.ahead), rel=1e-3)
    assert place.readings.shape == (50, 29)  # 5 degrees either way
    assert place.mean == pytest.approx(1.0646, abs=0.0005)


def test_equation_4_comes_back_and_its_intervals_hold_it():
    """40 walls: binomial 99.9 % bounds, for mu and for sigma; coefficients of one wall are not independent."""
    few = replace(OPTIONS.bootstrap, resamples=150)
    held = []
    for seed in range(40):
        law = laser_law.fit(ahead(seed), 0.001, 0.0, few)
        held.append([c.low <= true <= c.high for c, true in zip(law.coefficients, FOUR, strict=True)])
    low, high = binom.ppf([0.0005, 0.9995], 40, 0.90) / 40
    for share in np.mean(held, axis=0):
        assert low <= share <= high


def test_a_tape_widens_the_interval_of_mu_and_not_of_sigma():
    places = ahead(3)
    exact, taped = (laser_law.fit(places, 0.001, sd, OPTIONS.bootstrap) for sd in (0.0, 0.001))
    assert taped.scale.half > 3 * exact.scale.half
    # of a line through five points: sd / sqrt(sum of squares), at 90 %
    r = np.array(DISTANCES)
    assert taped.scale.half == pytest.approx(1.645 * 0.001 / np.sqrt(((r - r.mean()) ** 2).sum()), rel=0.15)
    assert taped.sigma[0].half < 1.2 * exact.sigma[0].half


def test_steps_of_a_millimetre_are_not_taken_for_noise():
    """At sd 2 mm they add 2 %: visible over many walls."""
    found = [
        laser_law.fit(ahead(s), res, 0.0, replace(OPTIONS.bootstrap, resamples=3)).deviation(np.array(1.0))
        for s in range(12)
        for res in (0.001, 0.0)
    ]
    true = FOUR[2] + FOUR[3] + FOUR[4]
    assert np.mean(found[::2]) == pytest.approx(true, rel=0.006)
    assert np.mean(found[1::2]) == pytest.approx(np.hypot(true, 0.001 / np.sqrt(12)), rel=0.006)


def test_a_laser_with_a_cycle_in_its_error_is_no_line():
    places = ahead(4)
    bent = [
        replace(p, mean=p.mean + 0.005 * np.sin(7 * p.distance), readings=p.readings + 0.005 * np.sin(7 * p.distance))
        for p in places
    ]
    law, good = (laser_law.fit(some, 0.001, 0.0, OPTIONS.bootstrap) for some in (bent, places))
    assert law.bend > 20 * law.bend_by_noise
    assert good.bend < 3 * good.bend_by_noise


@pytest.mark.parametrize(
    ("how", "agrees"), [({}, True), ({"shift": 0.0004}, False), ({"sd": 1.12}, False), ({"sd": 0.9}, False)]
)
def test_agreement_is_with_mean_and_variance(how, agrees):
    told = [laser_law.agreement(p, error_of(FOUR), 0.001, OPTIONS.wall) for p in ahead(6, **how)]
    assert all(one.agrees for one in told) == agrees


def test_agreement_is_seldom_denied_to_the_right_law():
    wrong = sum(
        not laser_law.agreement(p, error_of(FOUR), 0.001, OPTIONS.wall).agrees
        for seed in range(40)
        for p in ahead(seed)
    )
    assert wrong <= binom.ppf(0.999, 200, 0.0027 + 0.001)


def test_the_offset_along_the_beam_makes_a_flat_wall_bulge():
    """Pooled over an oblique wall, x scatters by far more than the noise: 59 mm (1 - cos a)."""
    near = ahead(7)[0]
    bearings = STEP * np.arange(-HALF, HALF + 1)
    met = bearings[np.abs(0.2 * np.tan(bearings)) < 0.5]
    x = (FOUR[0] * 0.2 / np.cos(met) + FOUR[1]) * np.cos(met)
    assert near.flat_sd == pytest.approx(np.sqrt(x.var() + 0.0023**2), rel=0.1)
    assert near.flat_sd > 1.9 * near.sd


def test_the_wall_ends_where_it_ends():
    rng = np.random.default_rng(8)
    (place,) = places_of(recorded([scans(1.0, rng, half_width=0.3)]), [1.0], LASER, OPTIONS.wall)
    assert np.abs(on_wall(place, OPTIONS.wall)[:, 1]).max() < 0.33


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"turned": 0.06}, "place_0: the wall is turned by 3.3 degrees"),
        ({"count": 10}, "place_0: 10 scans at 1 m, 20 are needed"),
        ({"gate": 0.9}, "no readings straight ahead at 1 m: they lie beyond the sensor's limits"),
        ({"half_width": 0.05}, "at 1 m 12 of 29 beams ahead lack readings"),
    ],
)
def test_a_wall_that_says_nothing_is_refused(how, words):
    rng = np.random.default_rng(9)
    with pytest.raises(Error, match=words):
        [ahead_of(p, OPTIONS.wall) for p in places_of(recorded([scans(1.0, rng, **how)]), [1.0], LASER, OPTIONS.wall)]


def test_distances_and_runs_must_match():
    rng = np.random.default_rng(9)
    with pytest.raises(Error, match="wall: 2 distances, 1 runs with scans: place_0"):
        places_of(recorded([scans(1.0, rng)]), [1.0, 2.0], LASER, OPTIONS.wall)
    with pytest.raises(Error, match="3 distances, 4 are needed"):
        laser_law.fit(ahead(1)[:3], 0.001, 0.0, OPTIONS.bootstrap)


def test_a_sigma_below_zero_is_not_written(tmp_path):
    law = laser_law.fit(ahead(1), 0.001, 0.0, replace(OPTIONS.bootstrap, resamples=3))
    down = replace(law, sigma=(law.sigma[0], replace(law.sigma[1], value=-0.01), law.sigma[2]))
    with pytest.raises(Error, match="sigma is not above 0 at"):
        law_file.write_laser(MODEL, down, [], tmp_path / "laser.yaml")
    assert not (tmp_path / "laser.yaml").exists()


def test_the_written_model_differs_in_the_law_alone(tmp_path):
    law = laser_law.fit(ahead(1), 0.001, 0.0, replace(OPTIONS.bootstrap, resamples=3))
    law_file.write_laser(MODEL, law, ["from a test"], tmp_path / "laser.yaml")
    new, old = (yaml.safe_load(path.read_text()) for path in (tmp_path / "laser.yaml", MODEL))
    assert new["laser"]["error"].pop("scale") == pytest.approx(law.scale.value, abs=1e-6)
    assert new["laser"]["error"].pop("sigma") == pytest.approx([c.value for c in law.sigma], abs=1e-6)
    assert new["laser"]["error"].pop("datum_offset") == pytest.approx(law.datum_offset.value, abs=1e-6)
    for key in ("scale", "sigma", "datum_offset"):
        old["laser"]["error"].pop(key)
    assert new == old


def test_the_bench_is_the_models_laser_with_the_sensors_gate(tmp_path):
    wall_experiment.write_model(MODEL, OPTIONS.wall, tmp_path / "bench.yaml")
    bench = load_model(tmp_path / "bench.yaml")
    assert (bench.laser.range_max, bench.laser.mount.x, bench.chassis.length) == (5.6, 0.0, 0.06)
    assert bench.laser.error.mean(1.0) == LASER.error.mean(1.0)
    wall_experiment.write_script(OPTIONS.wall, tmp_path / "wall.yaml")
    script = load_script(tmp_path / "wall.yaml")
    assert [round(1.3 - place.pose[0], 9) for place in script.places] == list(DISTANCES)


def test_paper_wall_on_the_simulator_agrees_with_equation_4_twice_the_same(tmp_path, capsys):
    for out in ("a", "b"):
        assert main(["wall", "--out", str(tmp_path / out), "--seed", "2"]) == 0
    told = capsys.readouterr().out
    assert "datum_offset" in told
    names = sorted(path.name for path in (tmp_path / "a").iterdir())
    assert names == [
        "bench.yaml", "equation_4.csv", "equation_4.txt", "figure_7.csv", "figure_7.svg",
        "figures_8_9.csv", "figures_8_9.svg", "laser.yaml",
    ]  # fmt: skip
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    rows = np.genfromtxt(tmp_path / "a/figures_8_9.csv", delimiter=",", names=True)
    assert (np.abs(rows["off_in_standard_errors"]) < 4).all()
    assert (rows["p_of_variance"] > 1e-4).all()
    assert list(rows["distance"]) == list(DISTANCES)


def test_figure_12_fails_where_the_wall_is_not_that_of_equation_4(tmp_path, capsys):
    """Scans of a recording whose noise is another one."""
    from kurumaisu.critic.experiment.rehearse import write

    wall_experiment.write_model(MODEL, OPTIONS.wall, tmp_path / "bench.yaml")
    rng = np.random.default_rng(3)
    results = []
    for name, sd in (("right", 1.0), ("wrong", 1.3)):
        write(tmp_path / name, recorded([scans(d, rng, sd=sd) for d in DISTANCES]))
        results.append(figure_12([tmp_path / name], tmp_path / "bench.yaml", tmp_path / f"out_{name}", None))
    assert results == [0, 1]
    assert "it does not agree with (4)" in capsys.readouterr().out
