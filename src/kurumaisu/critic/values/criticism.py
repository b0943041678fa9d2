# SPDX-License-Identifier: BSD-3-Clause
"""Everything that the critic has to say."""

from __future__ import annotations

from dataclasses import dataclass

from kurumaisu.critic.values.prediction import Prediction
from kurumaisu.critic.values.story import Story
from kurumaisu.critic.values.verdict import Verdict
from kurumaisu.params import EffectSetting, Model


@dataclass(frozen=True)
class Criticism:
    """Everything that the critic has to say. settings: what extends the model; predictions: what was asked for."""

    verdict: Verdict
    story: Story
    model: Model
    settings: tuple[EffectSetting, ...]
    predictions: tuple[Prediction, ...] = ()
