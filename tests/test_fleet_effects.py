# SPDX-License-Identifier: BSD-3-Clause
"""Effects on the robots of a world file and on their rangers, against closed forms."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from sim_worlds import LASER, OPTIONS, ROOM, drive, euler, robot, simulator

from kurumaisu import effects
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, shipped
from kurumaisu.settings import Section
from kurumaisu.sim import Options, Simulator, load_options
from kurumaisu.sim.options import RobotEffects

NULLS = {effect.id: {p.name: p.null for p in effect.parameters} for effect in effects.ALL}
ONE = 'name "one" drive "omni"'
NOISY = LASER.replace("fov 180", "fov 180 noise [0.0001 0.01 0.5]")


def on(who: str, **listed: dict[str, float]) -> RobotEffects:
    """Effects by id, a point written as __."""
    chosen = ((name.replace("__", "."), values) for name, values in listed.items())
    return RobotEffects(who, tuple(EffectSetting(name, {**NULLS[name], **values}) for name, values in chosen))


def build(folder: Path, text: str, *entries: RobotEffects, **options: Any) -> Simulator:
    return simulator(folder, text, effects=entries, **options)


def test_a_veering_robot_turns_and_its_odometry_does_not_know(tmp_path: Path) -> None:
    text = robot('name "one" localization "odom" odom_error [0 0 0 0]')
    sim = build(tmp_path, text, on("one", base__veer={"curvature": 0.5, "apart": 0.0}))
    last = drive(sim, (0.6, 0, 0.1), 40)[-1]
    np.testing.assert_allclose(last.poses[0, :2], euler(np.zeros(3), np.array([0.6, 0, 0.4]), 0.1, 40), atol=1e-9)
    np.testing.assert_allclose(last.odometry[0, :2], euler(np.zeros(3), np.array([0.6, 0, 0.1]), 0.1, 40, True))
    assert last.velocities.tolist() == [[0.6, 0, 0.1]]
    assert last.reference is None


def test_a_delay_and_a_lag_are_those_of_their_formulas(tmp_path: Path) -> None:
    sim = build(tmp_path, robot(ONE), on("*", base__delay={"delay": 0.25}, base__lag_v={"tau": 0.4}))
    way = np.array([o.poses[0, 0] for o in drive(sim, (0.8, 0.2, 0), 30)])
    t = 0.1 * np.arange(1, 31) - 0.25
    # the delay is interpolated between samples, so that half a step is half a command
    late = [0.8 * (u - 0.4 * (1 - math.exp(-u / 0.4))) for u in np.maximum([t - 0.05, t + 0.05], 0).ravel()]
    np.testing.assert_allclose(way, np.reshape(late, (2, 30)).mean(axis=0), atol=1e-9)
    assert sim.observe().poses[0, 1] == pytest.approx(0.2 * 3.0)  # leftward as commanded


def test_a_slope_depends_on_the_heading_in_the_map(tmp_path: Path) -> None:
    text = robot(ONE, "0 0 0 0") + robot('name "two"', "0 3 0 180")
    sim = build(tmp_path, text, on("*", base__slope={"climb_x": 0.1}))
    last = drive(sim, (0.5, 0, 0), 20)[-1]
    np.testing.assert_allclose(last.poses[:, 0], [0.8, -1.2], atol=1e-12)
    assert drive(sim, (0, 0, 0), 5)[-1].poses[0, 0] == last.poses[0, 0]  # brakes hold


def test_lateral_slip_goes_outwards_and_adds_to_what_is_commanded(tmp_path: Path) -> None:
    sim = build(tmp_path, robot(ONE), on("one", base__lateral_slip={"c": 0.05}))
    last = drive(sim, (0.8, 0.1, 0.5), 30)[-1]
    np.testing.assert_allclose(last.poses[0, :2], euler(np.zeros(3), np.array([0.8, 0.1 - 0.02, 0.5]), 0.1, 30))


def test_effects_on_voltages_see_one_volt_per_metre_and_second(tmp_path: Path) -> None:
    sim = build(tmp_path, robot(), on("*", base__dac_zero_f={"offset": 0.05}))
    assert drive(sim, (0.5, 0, 0), 10)[-1].poses[0, 0] == pytest.approx(0.55)


def test_physical_semantics_have_the_effects_too(tmp_path: Path) -> None:
    text = robot("mass 20") + robot('name "two" mass 20', "0 3 0 0")
    sim = build(tmp_path, text, on("two", base__gain_v={"gain": -0.5}), semantics="physical")
    last = drive(sim, (0.6, 0, 0), 10)[-1]
    np.testing.assert_allclose(last.poses[:, 0], [0.6, 0.3], atol=1e-6)


def test_a_reference_measures_its_marker_at_its_time(tmp_path: Path) -> None:
    listed = on("one", base__marker_x={"x": 0.2}, base__clock_scale={"scale": 0.1})
    sim = build(tmp_path, robot(ONE) + robot("", "0 3 0 0"), listed)
    last = drive(sim, (0.5, 0, 0.4), 10)[-1]
    reference, truth = last.reference, last.poses
    assert reference is not None
    x, y, _, heading = truth[0]
    marker = [x + 0.2 * math.cos(heading), y + 0.2 * math.sin(heading), heading]
    np.testing.assert_allclose(reference.poses[0], marker, atol=1e-12)
    np.testing.assert_array_equal(reference.poses[1], truth[1, [0, 1, 3]])
    np.testing.assert_allclose(reference.times, [1.1, 1.0])
    assert reference.rates[0, 1] == pytest.approx((0.2 * 0.4 + last_side(0.5, 0.4)) / 1.1)
    np.testing.assert_allclose(reference.rates[1], [0.5 * 1, last_side(0.5, 0.4), 0.4], atol=1e-12)


def last_side(v: float, w: float) -> float:
    """Leftward speed as seen from the old pose: Stage drives before it turns."""
    return 0.0 * v * w


def ahead(sim: Simulator, command: Any = (0, 0, 0), steps: int = 1) -> float:
    return float(drive(sim, command, steps)[-1].scans[0].ranges[90])


def test_ranges_have_offset_and_scale(tmp_path: Path) -> None:
    sim = build(tmp_path, ROOM + robot(LASER), on("*", laser__offset={"offset": 0.1}, laser__scale={"scale": -0.02}))
    assert ahead(sim) == pytest.approx(5 * 0.98 + 0.1, abs=1e-12)
    scan = sim.observe().scans[0]
    assert np.isinf(scan.ranges[0])
    assert (scan.returns[0], scan.returns[90]) == (0, 7)


def test_what_reads_beyond_the_range_is_no_return_and_the_other_way_round(tmp_path: Path) -> None:
    short = LASER.replace("[0 20]", "[0 4.95]")
    assert np.isinf(ahead(build(tmp_path, ROOM + robot(short))))
    assert ahead(build(tmp_path, ROOM + robot(short), on("*", laser__scale={"scale": -0.02}))) == pytest.approx(4.9)
    near = ROOM + robot(short, "0.1 0 0 0")
    assert np.isinf(ahead(build(tmp_path, near, on("*", laser__scale={"scale": 0.02}))))


def test_the_mount_is_elsewhere(tmp_path: Path) -> None:
    text = ROOM + robot(LASER)
    sim = build(tmp_path, text, on("*", laser__mount_x={"x": 0.1}, laser__mount_yaw={"yaw": 0.2}))
    ranges = drive(sim, (0, 0, 0), 1)[-1].scans[0].ranges
    bearings = sim.rangers[0].bearings + 0.2
    hits = np.abs(bearings) < 0.7
    np.testing.assert_allclose(ranges[hits], 4.9 / np.cos(bearings[hits]), atol=1e-9)


def test_a_late_stamp_is_of_an_earlier_place(tmp_path: Path) -> None:
    text = ROOM + robot(LASER, "-2 0 0 0")
    sim = build(tmp_path, text, on("*", laser__latency={"delay": 0.25}), timing="consistent")
    ranges = [o.scans[0].ranges[90] for o in drive(sim, (0.6, 0, 0), 8)]
    np.testing.assert_allclose(ranges, 7 - 0.6 * np.maximum(0.1 * np.arange(1, 9) - 0.25, 0), atol=1e-9)
    sim.set_pose(sim.robots[0], [0, 0, 0, 0])  # nothing lies between here and there
    assert ahead(sim) == pytest.approx(5)
    early = build(tmp_path, text, on("*", laser__latency={"delay": -0.05}), timing="consistent")
    assert ahead(early, (0.6, 0, 0), 3) == pytest.approx(7 - 0.6 * 0.35)


def test_a_sweep_that_takes_no_time_is_undone(tmp_path: Path) -> None:
    text, sweep = ROOM + robot(LASER), {"scan_sweep": 0.08, "timing": "consistent"}
    sim = build(tmp_path, text, on("*", laser__sweep={"stretch": -1.0}), **sweep)
    seen = drive(sim, (0, 0, 1.0), 4)[-1]
    directions = sim.rangers[0].bearings + 0.4 - 0.08
    front = np.cos(directions) > 0.75
    np.testing.assert_allclose(seen.scans[0].ranges[front], (5 / np.cos(directions))[front], atol=1e-9)


def test_oblique_walls_are_read_longer_and_a_tilted_laser_too(tmp_path: Path) -> None:
    sim = build(tmp_path, ROOM + robot(LASER), on("*", laser__incidence_bias={"k": 0.01}))
    ranges, bearings = drive(sim, (0, 0, 0), 1)[-1].scans[0].ranges, sim.rangers[0].bearings
    hits = np.abs(bearings) < 0.7
    np.testing.assert_allclose(ranges[hits], (5.01 / np.cos(bearings) - 0.01)[hits], atol=1e-6)
    down = build(tmp_path, ROOM + robot(LASER), on("*", laser__tilt={"pitch": 0.1}))
    assert ahead(down) == pytest.approx(0.4 / math.sin(0.1))  # the floor, from 0.4 m
    up = build(tmp_path, ROOM + robot(LASER), on("*", laser__tilt={"pitch": -0.1}))
    assert ahead(up) == pytest.approx(5 / math.cos(0.1))


def test_noise_is_scaled_and_has_its_variance(tmp_path: Path) -> None:
    noisy = LASER.replace("fov 180", "fov 60 noise [0.0001 0 0]")
    sim = build(tmp_path, ROOM + robot(noisy), on("*", laser__range_noise={"share": 1.0}))
    errors = np.array([o.scans[0].ranges for o in drive(sim, (0, 0, 0), 40)]) - 5 / np.cos(sim.rangers[0].bearings)
    n = errors.size
    assert (errors**2).sum() / (4 * 0.0001) == pytest.approx(n, abs=5 * math.sqrt(2 * n))


def test_noise_follows_what_the_robot_does(tmp_path: Path) -> None:
    """Twice as much from 0.4 m/s on, of the same draws."""
    noisy = ROOM + robot(LASER.replace("fov 180", "fov 60 noise [0.0001 0 0]"), "-4 0 0 0")
    curve = EffectSetting("smooth.scatter.v", {"knot_0": 0.0, "knot_1": 0.4, "value_0": 0.0, "value_1": math.log(2)})
    plain, shaken = (
        build(tmp_path, noisy, *entries, timing="consistent") for entries in ((), (RobotEffects("*", (curve,)),))
    )
    for command, factor in (((0, 0, 0), 1), ((0.4, 0, 0), 2), ((-0.4, 0, 0), 1)):
        one, other = (np.array([o.scans[0].ranges for o in drive(sim, command, 5)]) for sim in (plain, shaken))
        still = build(tmp_path, noisy.replace("noise [0.0001 0 0]", ""), timing="consistent")
        still.set_pose(still.robots[0], [*plain.observe().poses[0, :2], 0, 0])
        truth = still.step(np.zeros((1, 3))).scans[0].ranges
        np.testing.assert_allclose(other[-1] - truth, factor * (one[-1] - truth), atol=1e-6)


def test_a_laser_without_noise_gets_some(tmp_path: Path) -> None:
    sim = build(tmp_path, ROOM + robot(LASER), on("*", laser__range_noise={"slope": 0.01}))
    truth = 5 / np.cos(sim.rangers[0].bearings)
    errors = np.array([o.scans[0].ranges for o in drive(sim, (0, 0, 0), 40)])[:, 45:136] - truth[45:136]
    errors /= truth[45:136] - 2
    n = errors.size
    assert (errors**2).sum() / 0.01**2 == pytest.approx(n, abs=5 * math.sqrt(2 * n))


GHOST = "ranger_return -1 obstacle_return 0"  # so that robots meet and see walls only
CROWD = ROOM + "".join(
    robot(
        f'name "r{i}" {GHOST} localization "odom" update_interval {100 + 100 * (i % 2)} {NOISY}',
        f"0 {2 * i} 0 {40 * i}",
    )
    for i in range(3)
)
MANY = (
    on("r1", base__process_noise={"sd_v": 0.05, "sd_w": 0.1}, base__delay={"delay": 0.23}, base__lag_w={"tau": 0.2}),
    on("r1", laser__dropout={"probability": 0.1}, laser__beam_bias={"sd": 0.02}, laser__latency={"delay": 0.15}),
    on("r2", base__marker_x={"x": 0.1}, laser__common_mode={"sd": 0.01}, base__backlash={"play": 0.05}),
)


def wander(sim: Simulator, steps: int, seed: int = 1) -> list[Any]:
    commands = np.random.default_rng(seed).uniform(-1.0, 1.0, (steps, 9, 3))
    return [sim.step(row[: len(sim.robots)]) for row in commands]


def test_robots_without_effects_are_the_same_to_the_last_bit(tmp_path: Path) -> None:
    with_them, without = build(tmp_path, CROWD, *MANY), build(tmp_path, CROWD)
    for one, two in zip(wander(with_them, 30), wander(without, 30), strict=True):
        np.testing.assert_array_equal(one.poses[0], two.poses[0])
        np.testing.assert_array_equal(one.scans[0].ranges, two.scans[0].ranges)
        np.testing.assert_array_equal(one.odometry, two.odometry)
    assert (one.poses[1] != two.poses[1]).any()
    assert np.isnan(one.scans[1].ranges).any()


def test_null_effects_change_nothing(tmp_path: Path) -> None:
    silent = tuple(effect for effect in (*effects.BASE, *effects.LASER) if not effect.id.startswith("laser.tilt"))
    everything = RobotEffects("*", tuple(EffectSetting(effect.id, NULLS[effect.id]) for effect in silent))
    for one, two in zip(
        wander(build(tmp_path, CROWD, everything), 15), wander(build(tmp_path, CROWD), 15), strict=True
    ):
        np.testing.assert_allclose(one.poses, two.poses, atol=1e-9)
        np.testing.assert_allclose(one.scans.ranges, two.scans.ranges, atol=1e-6)


def test_one_seed_one_run_and_threads_do_not_matter(tmp_path: Path) -> None:
    hashes = []
    for threads, seed in ((1, 4), (2, 4), (2, 5)):
        sim = build(tmp_path, CROWD, *MANY, threads=threads)
        sim.reset(3)
        wander(sim, 5)
        sim.reset(seed)
        wander(sim, 20)
        hashes.append(sim.state_hash())
    assert hashes[0] == hashes[1] != hashes[2]


def test_a_robots_noise_is_its_own(tmp_path: Path) -> None:
    alone, together = build(tmp_path, CROWD, *MANY[:2]), build(tmp_path, CROWD, *MANY)
    for one, two in zip(wander(alone, 20), wander(together, 20), strict=True):
        np.testing.assert_array_equal(one.poses[1], two.poses[1])
        np.testing.assert_array_equal(one.scans[1].ranges, two.scans[1].ranges)


def test_what_effects_remember_is_saved(tmp_path: Path) -> None:
    sim = build(tmp_path, CROWD, *MANY)
    wander(sim, 13)
    saved = sim.save()
    wander(sim, 20, seed=2)
    after = sim.state_hash()
    for other in (sim, build(tmp_path, CROWD, *MANY)):
        other.load(saved)
        wander(other, 20, seed=2)
        assert other.state_hash() == after


def test_who_comes_or_goes_does_not_disturb_the_others_effects(tmp_path: Path) -> None:
    alone, visited = build(tmp_path, CROWD, *MANY), build(tmp_path, CROWD, *MANY)
    for sim in (alone, visited):
        wander(sim, 7)
    visited.spawn("model ( size [1 1 1] )", [100, 0, 0, 0])
    visited.spawn(robot('name "r1"' + LASER), [100, 9, 0, 0])
    for one, two in zip(wander(alone, 15), wander(visited, 15), strict=True):
        np.testing.assert_array_equal(one.poses, two.poses[:3])
    assert (visited.observe().poses[3, :2] != [100, 9]).all()
    visited.delete("r2")
    assert len(visited.step(np.zeros((3, 3))).poses) == 3


@pytest.mark.parametrize(("entry", "message"), [
    ({"robot": "*"}, r"x: effects\[0\].effects: is missing"),
    ({"robot": "*", "effects": [{"id": "base.wings", "parameters": {}}]}, r"effects\[0\].*'base.wings' is not in the"),
    ({"robot": "*", "effects": [{"id": "base.veer", "parameters": {}}]}, r"effects\[0\].*base.veer: needs .*curvature"),
    ({"robot": "*", "effects": [{"id": "world.map_error", "parameters": {"scale": 0.0, "sd": 0.1}}]}, "not on a robot"),
    ({"robot": "*", "effects": [], "who": 1}, "who: is not a known key"),
])  # fmt: skip
def test_bad_entries_are_named(entry: dict[str, Any], message: str) -> None:
    shipped_values = yaml.safe_load(shipped("launch/simulator.yaml").read_text())
    from kurumaisu.sim.options import read_options

    with pytest.raises(Error, match=message):
        read_options(Section({**shipped_values, "effects": [entry]}, "x"))


def test_robots_that_are_not_there_are_named(tmp_path: Path) -> None:
    with pytest.raises(Error, match="effects: robot: the world has no position of this name: nobody"):
        build(tmp_path, CROWD, on("nobody", base__veer={"curvature": 0.1, "apart": 0.0}))
    with pytest.raises(Error, match=r"effects: 'base\.veer' is given twice"):
        build(
            tmp_path,
            CROWD,
            on("*", base__veer={"curvature": 0.1, "apart": 0.0}),
            on("r1", base__veer={"curvature": 0.1, "apart": 0.0}),
        )


def test_the_shipped_options_have_no_effects() -> None:
    options: Options = load_options(shipped("launch/simulator.yaml"))
    assert options.effects == ()
    assert options.semantics == "world"
    assert OPTIONS.semantics == "stage"
