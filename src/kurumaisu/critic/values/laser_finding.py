# SPDX-License-Identifier: BSD-3-Clause
"""What the scans of a recording say against a model."""

from __future__ import annotations

from dataclasses import dataclass

from kurumaisu.critic.values.story import Alternative, Comparison, Misfit, NoiseParameter
from kurumaisu.critic.values.verdict import Cause, NextExperiment, Unknown
from kurumaisu.params import EffectSetting

UNKNOWN_CHANNEL = "laser.bias"  # that of what is outside the catalogue, of the mean of readings
UNKNOWN_SCATTER = "laser.scatter"  # and of how they scatter
# Of x, y and heading of where scans put the laser, against the reference, with the unit of a thousandth.
UNKNOWN_POSE = (("reference.x", "mm"), ("reference.y", "mm"), ("reference.heading", "mrad"))


@dataclass(frozen=True)
class Pictures:
    """What a finding adds to the report."""

    misfits: tuple[Misfit, ...] = ()
    rivals: tuple[Alternative, ...] = ()
    noise: tuple[NoiseParameter, ...] = ()
    comparisons: tuple[Comparison, ...] = ()


NO_PICTURES = Pictures()


@dataclass(frozen=True)
class LaserFinding:
    """What the scans say.

    causes: named and material; confounded: sets of which one acts; unknown: what is in no catalogue; settings: what
    extends the model; details, pictures: for the report; small: certain, but they do not matter; refused: why there
    is no laser criticism, None where there is; next_experiment: what supplies what the scans lack; wrong: what must be
    mended before anything is said, None where nothing must.
    """

    causes: tuple[Cause, ...] = ()
    confounded: tuple[tuple[str, ...], ...] = ()
    unknown: tuple[Unknown, ...] = ()
    settings: tuple[EffectSetting, ...] = ()
    details: tuple[str, ...] = ()
    pictures: Pictures = NO_PICTURES
    small: tuple[str, ...] = ()
    refused: str | None = None
    next_experiment: NextExperiment | None = None
    wrong: str | None = None
