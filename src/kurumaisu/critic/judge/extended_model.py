# SPDX-License-Identifier: BSD-3-Clause
"""extended.yaml: the model with what the critic found, for the simulator to run as it is."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import yaml

from kurumaisu import effects
from kurumaisu.bounded_files import MOST_TEXT, read_text
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.params import EffectSetting, Model, read_model
from kurumaisu.settings import Section, parsed

_WIDE = {"min": -100.0, "max": 100.0, "resolution": 0.0}  # [V]


def process_noise(problem: Problem) -> EffectSetting:
    """Return the estimated noise of the rates as the effect that the simulator draws it from.

    That effect has one colour: both are taken into its size, as they were on average.
    """
    (random,) = (effect for effect in effects.BASE if effect.random)
    noise = problem.noise
    sd_v, sd_w = np.hypot([noise.sd_v, noise.sd_w], [noise.slow_v, noise.slow_w])
    share = noise.slow_w**2 / (noise.slow_w**2 + noise.sd_w**2)  # of the variance of the yaw rate
    tau = (1 - share) * noise.tau + share * noise.slow_tau  # keeps how far the heading wanders
    values = {"sd_v": float(sd_v), "sd_w": float(sd_w), "tau": tau, "growth": noise.growth}
    return EffectSetting(random.id, {p.name: min(values[p.name], p.upper) for p in random.parameters})


def extended_text(original: Path, model: Model, settings: Sequence[EffectSetting], recording: str) -> str:
    """Return the model file `original` with these effects in place of its own of the same id; it can be loaded.

    model: as criticised; where its voltages are the commands themselves, the file gets that law.
    Raise Error when the file cannot be read, or the text is no model.
    """
    content = parsed(read_text(original, MOST_TEXT), str(original))
    given = {setting.id for setting in settings}
    content["effects"] = [own for own in content["effects"] if own["id"] not in given]
    content["effects"] += [{"id": s.id, "parameters": dict(s.parameters)} for s in settings]
    if model.law_name not in content["voltage_laws"]:
        content["name"] = model.name
        content["voltage_law"] = model.law_name
        content["voltage_laws"][model.law_name] = {
            "translation": _axis(model.translation),
            "steering": _axis(model.steering),
        }
        # The bands are in the volts of the file's own law.
        content["voltages"] |= {"translation": dict(_WIDE), "steering": dict(_WIDE)}
    if not model.robot.voltages:
        content["robot"] = model.robot.said
        content["chassis"]["track"] = model.chassis.track
    text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=110)
    where = f"{original} with what was found"
    read_model(Section(parsed(text, where), where))
    return f"# {original.name} and what the critic found in {' '.join(recording.split())}.\n{text}"


def _axis(law: object) -> dict[str, dict[str, float]]:
    return {
        side: {"slope": getattr(law, side).slope, "intercept": getattr(law, side).intercept}
        for side in ("positive", "negative")
    }
