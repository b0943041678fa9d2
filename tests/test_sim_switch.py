# SPDX-License-Identifier: BSD-3-Clause
"""Effects switched on, changed and off in the middle of a drive, without ROS."""

from dataclasses import replace

import numpy as np
import pytest

from kurumaisu import effects
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, load_model, shipped
from kurumaisu.sim.chair.simulator import ChairSimulator, Command
from kurumaisu.sim.robots import state
from kurumaisu.sim.sensors.settings import load_sensors
from kurumaisu.sim.settings import load_dynamics
from kurumaisu.world import load_world

MODEL = load_model(shipped("launch/md100.yaml"))
DYNAMICS = load_dynamics(shipped("launch/physical.yaml"))
TYPICAL = {
    effect.id: EffectSetting(effect.id, {p.name: p.null + p.scale for p in effect.parameters}) for effect in effects.ALL
}
NULL = {effect.id: EffectSetting(effect.id, {p.name: p.null for p in effect.parameters}) for effect in effects.ALL}
BASE = [effect.id for effect in effects.BASE]


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """A chair that heads north-east, walls around it, a box that it does not reach."""
    file = tmp_path_factory.mktemp("world") / "room.world"
    walls = [(6, 0, 1, 12), (-6, 0, 1, 12), (0, 6, 12, 1), (0, -6, 12, 1)]
    text = "".join(f"model ( pose [{x} {y} 0 0] size [{a} {b} 1] )\n" for x, y, a, b in walls)
    text += "model ( pose [-4 -4 0 0] size [1 1 1] mass 5 )\n" + 'model ( name "post" pose [-4 4 0 0] size [1 1 1] )\n'
    file.write_text(text + "position ( pose [0 -2 0 45] )")
    return load_world(file)


def start(world, *ids):
    it = ChairSimulator(replace(MODEL, effects=tuple(TYPICAL[name] for name in ids)), world, DYNAMICS)
    it.reset(4)
    return it


def command(v, w):
    volts = float(MODEL.translation.volts(v)), float(MODEL.steering.volts(w))
    return Command(*volts, float(np.sign(v)), float(np.sign(w)))


AHEAD, BEND, BACK = command(0.4, 0.0), command(0.4, 0.3), command(-0.3, 0.2)


def drive(it, told, steps):
    """Return what was seen in steps, as rows of pose and rates, and the scans."""
    seen = [it.step(told) for _ in range(steps)]
    rows = np.array([[*o.pose, *o.rates, *o.reference.poses, float(o.reference.times)] for o in seen])
    return rows, [o.scan.ranges for o in seen if o.scan is not None]


def same(a, b):
    np.testing.assert_array_equal(a[0], b[0])
    for one, other in zip(a[1], b[1], strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("name", TYPICAL)
def test_switched_on_in_a_drive_leaves_the_chair_where_it_is_and_off_again_nothing_stays(world, name):
    it, plain = start(world), start(world)
    for one in (it, plain):
        drive(one, BEND, 30)
    before = drive(plain, BEND, 1)[0][0]
    it.switch((TYPICAL[name],))
    after = drive(it, BEND, 40)[0]
    way = np.hypot(*(after[0, :2] - before[:2]))  # in a step of 10 ms; 0.4 m/s and what an effect may add at once
    assert way < 0.01 * (1.0 if name == "base.sign" else 0.1), "the pose jumped"
    assert np.abs(np.diff(after[:, :2], axis=0)).max() < 0.02
    it.switch(())
    rates = drive(it, BEND, 25)[0][-1, 3:6]
    np.testing.assert_allclose(rates, [0.4, 0.0, 0.3], atol=1e-9)


@pytest.mark.parametrize("name", TYPICAL)
def test_at_its_bounds_the_simulation_goes_on(world, name):
    it = start(world)
    drive(it, BEND, 30)
    for bound in ("lower", "upper"):
        values = {p.name: getattr(p, bound) for p in effects.by_id(name).parameters}
        it.switch((EffectSetting(name, values),))
        rows, scans = drive(it, BEND, 45)
        assert np.isfinite(rows).all()
        assert len(scans) >= (3 if name != "laser.latency" else 2)  # the first one waits for beams that come later
        it.save()
    it.switch(())
    assert len(drive(it, BEND, 40)[1]) >= 3


def settled(name):
    """Whether an effect that remembers makes nothing of a steady drive."""
    chain = effects.build((TYPICAL[name],), effects.Context(MODEL.translation, MODEL.steering, None)).rates
    return bool(chain) and name in ("base.delay", "base.lag_v", "base.lag_w", "base.accel_limit")


@pytest.mark.parametrize("name", [name for name in BASE if settled(name)])
def test_a_steady_drive_stays_steady_under_what_follows_late(world, name):
    it = start(world)
    drive(it, BEND, 30)
    it.switch((TYPICAL[name],))
    steady = drive(it, BEND, 60)[0]
    np.testing.assert_allclose(steady[:, 3:6], np.tile([0.4, 0.0, 0.3], (60, 1)), atol=1e-9)
    braked = drive(it, command(0.0, 0.0), 3)[0]
    assert np.abs(braked[:, 3:6]).max() > 0.1, "it acts"


def test_a_lag_that_is_changed_goes_on_from_its_level(world):
    it = start(world)
    drive(it, AHEAD, 30)
    it.switch((EffectSetting("base.lag_v", {"tau": 0.0}),))
    drive(it, AHEAD, 10)
    it.switch((EffectSetting("base.lag_v", {"tau": 0.2}),))
    falling = drive(it, command(0.0, 0.0), 20)[0][:, 3]
    it.switch((EffectSetting("base.lag_v", {"tau": 0.6}),))
    slower = drive(it, command(0.0, 0.0), 30)[0][:, 3]
    edges = np.concatenate([np.exp(-np.arange(21) / 20), np.exp(-1) * np.exp(-np.arange(1, 31) / 60)])
    tau = np.repeat([0.2, 0.6], [20, 30])
    expected = 0.4 * tau * -np.diff(edges) / 0.01
    np.testing.assert_allclose(np.concatenate([falling, slower]), expected, rtol=1e-9)


def test_switches_between_two_steps_add_up(world):
    once, bit_by_bit = start(world), start(world)
    names = ["base.lag_v", "base.gain_v", "base.delay", "base.lag_w", "base.accel_limit", "laser.offset"]
    for it in (once, bit_by_bit):
        drive(it, BEND, 30)
    for count in range(1, len(names) + 1):
        bit_by_bit.switch(tuple(TYPICAL[name] for name in names[:count]))
    once.switch(tuple(TYPICAL[name] for name in names))
    same(drive(bit_by_bit, BACK, 30), drive(once, BACK, 30))
    assert bit_by_bit.state_hash() == once.state_hash()


def test_a_delay_that_is_lengthened_and_shortened(world):
    it = start(world)
    drive(it, AHEAD, 20)
    it.switch((EffectSetting("base.delay", {"delay": 0.05}),))
    assert (drive(it, BACK, 8)[0][:, 3].round(9) == [0.4] * 5 + [-0.3] * 3).all()
    it.switch((EffectSetting("base.delay", {"delay": 0.1}),))
    drive(it, AHEAD, 2)
    it.switch((EffectSetting("base.delay", {"delay": 0.02}),))
    assert (drive(it, BACK, 4)[0][:, 3].round(9) == [0.4] * 2 + [-0.3] * 2).all()


@pytest.mark.parametrize("name", TYPICAL)
def test_switched_on_before_the_first_step_is_as_from_the_file(world, name):
    live, file = start(world), start(world, name)
    live.switch((TYPICAL[name],))
    aimed = issubclass(effects.by_id(name), effects.BeamEffect)  # the first scan's beams: they stay
    (rows, scans), (expected, others) = drive(live, BEND, 45), drive(file, BEND, 45)
    same((rows, scans[aimed:]), (expected, others[aimed:]))


def test_a_reset_keeps_what_acts_and_is_as_from_the_file(world):
    live, file = start(world), start(world, *TYPICAL)
    drive(live, BEND, 35)
    live.switch(tuple(TYPICAL.values()))
    drive(live, BACK, 20)
    for one in (live, file):
        one.reset(9)
    assert live.state_hash() == file.state_hash()
    same(drive(live, BEND, 45), drive(file, BEND, 45))


def test_changed_effects_are_saved_and_others_are_refused(world):
    it, other = start(world), start(world)
    drive(it, BEND, 20)
    it.switch((TYPICAL["base.lag_w"], TYPICAL["laser.warmup"], TYPICAL["world.map_error"]))
    drive(it, BACK, 15)
    saved = it.save()
    after = drive(it, BEND, 30)
    with pytest.raises(Error, match="belongs to another world, chassis, list of effects"):
        other.load(saved)
    other.switch((TYPICAL["base.lag_w"], TYPICAL["laser.warmup"], TYPICAL["world.map_error"]))
    other.load(saved)
    same(drive(other, BEND, 30), after)


def test_time_begins_when_an_effect_is_switched_on(world):
    it = start(world)
    drive(it, AHEAD, 200)
    it.switch(
        (
            EffectSetting("base.battery_sag", {"sag": 0.1, "through": 0.0}),
            EffectSetting("base.clock_scale", {"scale": 0.1, "through": 0.0}),
        )
    )
    rows = drive(it, AHEAD, 100)[0]
    times = 0.01 * np.arange(100)
    np.testing.assert_allclose(rows[:, 3], 0.4 * (1 - 0.1 * (times + 0.005)), rtol=1e-9)
    np.testing.assert_allclose(rows[:, 9], 2.0 + 1.1 * (times + 0.01), rtol=1e-9)


def test_walls_move_and_the_rest_stays(world):
    law = type(MODEL.laser.error)(
        scale=1.0, datum_offset=0.0, sigma=[0.0] * 3, resolution=0.0, range_min=0.0, range_max=1e6
    )
    it = ChairSimulator(replace(MODEL, laser=replace(MODEL.laser, error=law)), world, DYNAMICS)
    it.set_pose("chair", [0.0, 0.0, 0.0, 0.0])
    stand = command(0.0, 0.0)
    ahead = MODEL.laser.beams // 2
    near = drive(it, stand, 10)[1][-1][ahead]
    it.switch((EffectSetting("world.map_error", {"scale": 0.1, "sd": 0.0}),))
    rows, scans = drive(it, stand, 20)
    assert scans[-1][ahead] == pytest.approx(near + 0.55, abs=1e-3)  # the wall at 5.5 m
    np.testing.assert_array_equal(rows[:, :3], 0.0)
    it.switch(())
    assert drive(it, stand, 20)[1][-1][ahead] == pytest.approx(near, abs=1e-9)
    it.set_pose("post", [4.0, 0.0, 0.0, 0.0])  # a wall that somebody has moved before
    near = drive(it, stand, 20)[1][-1][ahead]
    it.switch((EffectSetting("world.map_error", {"scale": 0.1, "sd": 0.0}),))
    assert drive(it, stand, 20)[1][-1][ahead] == pytest.approx(near + 0.35, abs=1e-3)
    it.switch(())
    assert drive(it, stand, 20)[1][-1][ahead] == pytest.approx(near, abs=1e-9)


def test_further_sensors_go_on_when_walls_move(world):
    """Noise, biases and rhythm of an IMU, a battery, sonars, ... are those of a chair whose walls stay."""
    sensors = load_sensors(shipped("launch/sensors.yaml"))
    moved, plain = (ChairSimulator(MODEL, world, DYNAMICS, sensors) for _ in range(2))
    for it in (moved, plain):
        it.reset(2)
        drive(it, BEND, 33)
    moved.switch((EffectSetting("world.map_error", {"scale": 0.05, "sd": 0.0}),))
    moved.switch(())
    for _ in range(60):
        one, other = moved.step(BEND), plain.step(BEND)
        assert state.digest(repr(one.readings)) == state.digest(repr(other.readings))
    assert moved.state_hash() == plain.state_hash()


def test_walls_in_the_chair_are_refused_and_nothing_has_changed(world):
    it, other = start(world, "base.gain_v"), start(world, "base.gain_v")
    for one in (it, other):
        one.set_pose("chair", [4.6, 0.0, 0.0, 0.0])
    with pytest.raises(Error, match="a wall would be inside the chair: drive away"):
        it.switch((TYPICAL["base.lag_v"], EffectSetting("world.map_error", {"scale": -0.2, "sd": 0.0})))
    assert it.state_hash() == other.state_hash()
    same(drive(it, BACK, 30), drive(other, BACK, 30))


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        (EffectSetting("base.gain_v", {"gain": 9.0}), "base.gain_v: gain must be -0.9 to 4 1: 9"),
        (EffectSetting("base.nothing", {}), "'base.nothing' is not in the catalogue"),
        (EffectSetting("laser.offset", {}), "laser.offset: needs the parameters offset"),
    ],
)
def test_bad_settings_are_refused_and_nothing_has_changed(world, setting, message):
    it = start(world, "base.lag_v")
    drive(it, AHEAD, 5)
    before = it.state_hash()
    with pytest.raises(Error, match=message):
        it.switch((TYPICAL["laser.scale"], setting))
    assert it.state_hash() == before


def test_curves_switch_as_others_do(world):
    curve = {"knot_0": 0.0, "knot_1": 1.0, "value_0": 0.1, "value_1": 0.1, "now": 0.5}
    it = start(world)
    drive(it, AHEAD, 30)
    it.switch((EffectSetting("smooth.v.load", curve),))
    assert drive(it, AHEAD, 2)[0][-1, 3] == pytest.approx(0.5)
    it.switch((EffectSetting("smooth.v.load", curve | {"value_0": 0.2}),))
    assert drive(it, AHEAD, 2)[0][-1, 3] == pytest.approx(0.55)
