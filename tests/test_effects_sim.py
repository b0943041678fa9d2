# SPDX-License-Identifier: BSD-3-Clause
"""Effects on the reference, and effects on the base in the simulator, switched on in a file."""

from pathlib import Path

import numpy as np
import pytest

from kurumaisu import effects
from kurumaisu.params import load_model, shipped
from kurumaisu.sim.chair.simulator import ChairSimulator, Command
from kurumaisu.sim.settings import load_dynamics, with_effects
from kurumaisu.world import load_world

MODEL = load_model(shipped("launch/md100.yaml"))
CONTEXT = effects.Context(MODEL.translation, MODEL.steering, np.random.default_rng(0))
TRUTH = effects.Reference(np.array(10.0), np.array([1.0, 2.0, np.pi / 2]), np.array([0.5, 0.0, 0.4]))


def see(name, values, truth=TRUTH):
    return effects.by_id(name)(values, CONTEXT).apply(truth)


def test_reference_effects():
    ahead, beside = see("base.marker_x", {"x": 0.1}), see("base.marker_y", {"y": 0.1})
    np.testing.assert_allclose(ahead.poses, [1.0, 2.1, np.pi / 2])
    np.testing.assert_allclose(ahead.rates, [0.5, 0.04, 0.4])
    np.testing.assert_allclose(beside.poses, [0.9, 2.0, np.pi / 2])
    np.testing.assert_allclose(beside.rates, [0.46, 0.0, 0.4])
    late = see("base.clock_scale", {"scale": 0.01, "through": 0.0})
    assert late.times == pytest.approx(10.1)
    np.testing.assert_allclose(late.rates, TRUTH.rates / 1.01)
    afterwards = effects.Reference(TRUTH.times, TRUTH.poses, TRUTH.rates, start=4.0)
    assert see("base.clock_scale", {"scale": 0.01, "through": 0.0}, afterwards).times == pytest.approx(10.06)
    assert see("base.clock_scale", {"scale": 0.01, "through": 1.0}, afterwards).times == pytest.approx(10.1)


REFERENCE = [effect for effect in effects.BASE if issubclass(effect, effects.ReferenceEffect)]


@pytest.mark.parametrize("effect", REFERENCE, ids=lambda effect: effect.id)
def test_reference_effects_are_absent_at_their_null_and_have_no_state(effect):
    rng = np.random.default_rng(7)
    many = effects.Reference(np.arange(5.0), rng.standard_normal((5, 3)), rng.standard_normal((5, 3)))
    nulls = {parameter.name: parameter.null for parameter in effect.parameters}
    acting = {**nulls, effect.parameters[0].name: effect.parameters[0].scale}
    same, changed = see(effect.id, nulls, many), see(effect.id, acting, many)
    one = effects.Reference(many.times[3], many.poses[3], many.rates[3])
    changed_one = see(effect.id, acting, one)
    for field in ("times", "poses", "rates"):
        np.testing.assert_allclose(getattr(same, field), getattr(many, field), atol=1e-15)
        np.testing.assert_allclose(getattr(changed_one, field), getattr(changed, field)[3])
    assert not np.allclose(changed.rates, many.rates)


def run(folder: Path, listed: str, command: Command, seconds: float):
    world, file = folder / "free.world", folder / "effects.yaml"
    world.write_text("model ( pose [500 0 0 0] )\nposition ( pose [0 0 0 90] )")
    file.write_text(f"effects: [{listed}]")
    dynamics = load_dynamics(shipped("launch/physical.yaml"))
    simulator = ChairSimulator(with_effects(MODEL, file), load_world(world), dynamics)
    simulator.reset(1)
    for _ in range(round(seconds / simulator.step_time)):
        observation = simulator.step(command)
    return observation


def command(v: float, w: float) -> Command:
    return Command(
        float(MODEL.translation.volts(v)), float(MODEL.steering.volts(w)), float(np.sign(v)), float(np.sign(w))
    )


def test_a_slope_in_the_simulator(tmp_path):
    """The chair starts northwards."""
    last = run(tmp_path, "{id: base.slope, parameters: {climb_x: 0.1, climb_y: 0.2}}", command(0.5, 0.0), 2.0)
    np.testing.assert_allclose(last.pose, [0.0, 0.6, np.pi / 2], atol=1e-9)


def test_slip_in_the_simulator_is_the_arc_of_a_turned_speed(tmp_path):
    last = run(tmp_path, "{id: base.lateral_slip, parameters: {c: 0.2}}", command(0.5, 0.4), 3.0)
    turn, u = 1.2, -0.2 * 0.5 * 0.4
    ahead, left = np.sin(turn) / 0.4, (1 - np.cos(turn)) / 0.4
    body = np.array([0.5 * ahead - u * left, 0.5 * left + u * ahead])
    np.testing.assert_allclose(last.pose, [-body[1], body[0], np.pi / 2 + turn], atol=1e-9)
    np.testing.assert_allclose(last.rates, [0.5, u, 0.4], atol=1e-12)


def test_a_marker_is_seen_and_does_not_move_the_chair(tmp_path):
    marker = "{id: base.marker_x, parameters: {x: 0.1}}"
    clock = "{id: base.clock_scale, parameters: {scale: 0.01, through: 0.0}}"
    last = run(tmp_path, f"{marker}, {clock}", command(0.5, 0.0), 2.0)
    np.testing.assert_allclose(last.pose, [0.0, 1.0, np.pi / 2], atol=1e-9)
    np.testing.assert_allclose(last.reference.poses, [0.0, 1.1, np.pi / 2], atol=1e-9)
    assert last.reference.times == pytest.approx(2.02)
    assert last.time == pytest.approx(2.0)


def test_the_other_steering_law_in_the_simulator(tmp_path):
    """A small turn to the right by the published law is one to the left by the other."""
    last = run(tmp_path, "{id: base.steering_law, parameters: {flip: 1.0, meant: 0.0}}", command(0.0, -0.1), 1.0)
    assert last.rates[2] == pytest.approx((0.469278 * 0.1 - 0.169476 + 0.104181) / -0.499211, abs=1e-9)
