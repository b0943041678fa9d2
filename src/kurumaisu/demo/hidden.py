# SPDX-License-Identifier: BSD-3-Clause
"""Draw an effect, hide it in the plant, record drives, ask the critic, reveal."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

from kurumaisu import effects
from kurumaisu.critic.app import cli
from kurumaisu.critic.app.job import Job
from kurumaisu.critic.data.csv_reader import write_csv_run
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.params import EffectSetting, Model, load_model, shipped
from kurumaisu.sim.chair.joystick import joystick
from kurumaisu.sim.chair.simulator import NEUTRAL, ChairSimulator, Command
from kurumaisu.sim.settings import load_dynamics, with_effects
from kurumaisu.whole_files import write_whole
from kurumaisu.world import load_world

# Effects that drives like these tell from all others, each by itself; of others the critic would answer with a set.
SHOWN = (
    *("base.gain_v", "base.gain_w", "base.left_right_gain", "base.veer", "base.dead_zone_v", "base.dead_zone_w"),
    *("base.delay", "base.lag_v", "base.lag_w"),
)
_DRIVES, _SECONDS = 3, 45.0
_POSE_EVERY = 0.1  # [s]
_POSE_SD = (0.005, 0.005, 0.005)  # [m, m, rad], as of a motion-capture system


def run(folder: Path, seed: int) -> None:
    """Do it all and print the critic's answer and the truth. Raise Error for what cannot be read or written."""
    rng = np.random.default_rng(seed)
    secret = draw(rng)
    record(folder / "hidden_drives", secret, rng)
    answer = cli.tell(Job(folder / "hidden_drives", folder, seed=seed))
    size = ", ".join(f"{name} {value:.3g}" for name, value in secret.parameters.items())
    right = [cause.id for cause in answer.causes] == [secret.id]
    print(f"what was hidden (seed {seed}): {secret.id}, {size}: {'found' if right else 'NOT found'}")


def draw(rng: np.random.Generator) -> EffectSetting:
    """Return one of the effects shown, of a size that matters, in any of its forms."""
    effect = effects.by_id(SHOWN[rng.integers(len(SHOWN))])
    values = dict(effect.forms[rng.integers(len(effect.forms))]) if effect.forms else {}
    for parameter in effect.parameters:
        if parameter.name in values:
            continue
        sign = rng.choice([-1, 1]) if parameter.lower < parameter.null else 1
        values[parameter.name] = float(parameter.null + sign * parameter.scale * rng.uniform(1.0, 2.5))
    return EffectSetting(effect.id, values)


def record(folder: Path, secret: EffectSetting, rng: np.random.Generator) -> None:
    """Simulate drives of a chair with the secret effect on an uneven floor, and write them as a recording."""
    model = with_effects(load_model(shipped("launch/md100.yaml")), shipped("launch/uneven_floor.yaml"))
    model = replace(model, effects=(*model.effects, secret))
    dynamics = load_dynamics(shipped("launch/physical.yaml"))
    simulator = ChairSimulator(model, load_world(shipped("worlds/hall.world")), dynamics)
    for i in range(_DRIVES):
        print(f"  driving {i + 1} of {_DRIVES} ...", flush=True)
        write_csv_run(folder / f"drive_{i + 1}", _drive(f"drive_{i + 1}", simulator, model, rng))
    meta = {"truth": {"position_sd": _POSE_SD[0], "heading_sd": _POSE_SD[2]}}
    write_whole({folder / "meta.yaml": yaml.safe_dump(meta)})


def _drive(name: str, simulator: ChairSimulator, model: Model, rng: np.random.Generator) -> Run:
    commands = joystick(_SECONDS, rng)
    commands[:, 0] = simulator.step_time * np.round(commands[:, 0] / simulator.step_time)  # when the D/A changes
    voltages = np.column_stack([model.translation.volts(commands[:, 1]), model.steering.volts(commands[:, 2])])
    observation = simulator.reset(int(rng.integers(2**31)))
    poses: list[list[float]] = []
    row, command = -1, NEUTRAL
    while observation.time < _SECONDS:
        while row + 1 < len(commands) and commands[row + 1, 0] <= observation.time + 1e-9:
            row += 1
            command = Command(*voltages[row], *np.sign(commands[row, 1:]))
        if observation.time >= len(poses) * _POSE_EVERY - 1e-9:
            poses.append([observation.time, *(observation.pose + rng.standard_normal(3) * _POSE_SD)])
        observation = simulator.step(command)
    return Run(
        name,
        command=Series.of_table(commands, "v", "w"),
        voltage=Series.of_table(np.column_stack([commands[:, 0], voltages]), "v_f", "v_s"),
        pose=Series.of_table(np.array(poses), "x", "y", "theta"),
    )
