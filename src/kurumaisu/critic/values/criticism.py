# SPDX-License-Identifier: BSD-3-Clause
"""Everything that the critic has to say: of a recording, of its scans, and what it predicts of a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from kurumaisu.critic.values.story import Alternative, Comparison, Misfit, NoiseParameter, Story
from kurumaisu.critic.values.verdict import Cause, NextExperiment, Unknown, Verdict
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

Settings = tuple[EffectSetting, ...]
Progress = Callable[[str], None]
UNRESOLVED = "unresolved"  # the covariate of what surely is wrong, where the data do not say what it follows
UNRESOLVED_P = 0.5  # posterior that is told of it: that any cause that could be told is it
UNKNOWN_CHANNEL = "laser.bias"  # that of what is outside the catalogue, of the mean of readings
UNKNOWN_SCATTER = "laser.scatter"  # and of how they scatter
# Of x, y and heading of where scans put the laser, against the reference, with the unit of a thousandth.
UNKNOWN_POSE = (("reference.x", "mm"), ("reference.y", "mm"), ("reference.heading", "mrad"))


@dataclass(frozen=True)
class Criticism:
    """Everything that the critic has to say. settings: what extends the model; predictions: what was asked for."""

    verdict: Verdict
    story: Story
    model: Model
    settings: tuple[EffectSetting, ...]
    predictions: tuple[Prediction, ...] = ()


@dataclass(frozen=True)
class Prediction:
    """Of one run: times t0, t1 [s]; means and sds (n,), nan where nothing is predicted; of channels, or of beams."""

    run: str
    t0: float
    t1: float
    means: FloatArray
    sds: FloatArray

    @property
    def is_scan(self) -> bool:
        """Tell whether these are ranges."""
        return self.t0 == self.t1


@dataclass(frozen=True)
class Pictures:
    """What a finding adds to the report."""

    misfits: tuple[Misfit, ...] = ()
    rivals: tuple[Alternative, ...] = ()
    noise: tuple[NoiseParameter, ...] = ()
    comparisons: tuple[Comparison, ...] = ()


@dataclass(frozen=True)
class StandIn:
    """A curve that fits nearly as well as the one that is told: what would be told, its setting, and that one's id."""

    unknown: Unknown
    setting: EffectSetting
    of: str


@dataclass(frozen=True)
class LaserFinding:
    """What the scans say.

    causes: named and material; confounded: sets of which one acts; unknown: what is in no catalogue; settings: what
    extends the model; details, pictures: for the report; small: certain, but they do not matter; refused: why there
    is no laser criticism, None where there is; next_experiment: what supplies what the scans lack; wrong: what must be
    mended before anything is said, None where nothing must; nats: log evidence of a curve of the scatter, which no
    error of the map makes; stand_ins: of that curve.
    """

    causes: tuple[Cause, ...] = ()
    confounded: tuple[tuple[str, ...], ...] = ()
    unknown: tuple[Unknown, ...] = ()
    settings: tuple[EffectSetting, ...] = ()
    details: tuple[str, ...] = ()
    pictures: Pictures = field(default_factory=Pictures)
    small: tuple[str, ...] = ()
    refused: str | None = None
    next_experiment: NextExperiment | None = None
    wrong: str | None = None
    nats: float = 0.0
    stand_ins: tuple[StandIn, ...] = ()
