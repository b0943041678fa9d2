# SPDX-License-Identifier: BSD-3-Clause
"""The numbers that scans would have with effects on their scatter, by the very effects that the simulator runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.ranges.scans.beams import BeamHits, Shots, model_effects_with, read
from kurumaisu.critic.ranges.signals.effect_columns import EffectColumns
from kurumaisu.critic.scatter.likelihood import StatisticKinds
from kurumaisu.critic.scatter.statistics import Statistics
from kurumaisu.effects import Mechanism
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray


class ScatterSimulator:
    """Statistics of the shots with effects on how readings scatter."""

    def __init__(
        self,
        shots: Shots,
        marks: EffectColumns,
        statistics: Statistics,
        missed: FloatArray,
        met: BeamHits | None = None,
    ) -> None:
        """Take shots and their marks; missed (k, b, n) [m]: what equations of the mean may have wrong, 1 sd.

        met: what beams meet, None: what they are expected to.
        """
        self._shots, self._marks, self._met = shots, marks, marks.seen if met is None else met
        self._statistics = statistics
        self._missed = missed

    def kinds(self) -> StatisticKinds:
        """Return of which kinds the statistics are."""
        return self._statistics.kinds()

    def null(self, effect: type[Mechanism]) -> dict[str, float]:
        """Return an effect's parameters in the model as it is."""
        return self._marks.null(effect)

    def nulls(self, seeds: Sequence[int]) -> FloatArray:
        """Return the statistics of simulations without effects, about means that are not quite right, (n, m)."""
        draws = (np.random.default_rng([seed, 8]).standard_normal(self._missed.shape[2]) for seed in seeds)
        return np.array(
            [self._simulated((), seed, self._missed @ draw) for seed, draw in zip(seeds, draws, strict=True)]
        )

    def __call__(self, settings: Sequence[EffectSetting], seed: int) -> FloatArray:
        """Return the statistics of a simulation."""
        return self._simulated(settings, seed, np.zeros(self._missed.shape[:2]))

    def touched(self, setting: EffectSetting) -> tuple[float, float]:
        """Return which shares of the readings an effect takes away, and makes others."""
        (without, _), (left, _) = self.scans((), 0), self.scans((setting,), 0)
        there, still = np.isfinite(without), np.isfinite(left)
        count = max(np.count_nonzero(there), 1)
        return np.count_nonzero(there & ~still) / count, np.count_nonzero(there & still & (without != left)) / count

    def _simulated(self, settings: Sequence[EffectSetting], seed: int, off: FloatArray) -> FloatArray:
        """Return the statistics of readings that are off (k, b) [m] from where they are expected."""
        readings, error = self.scans(settings, seed)
        return self._statistics.of(readings, error + off)

    def scans(self, settings: Sequence[EffectSetting], seed: int) -> tuple[FloatArray, FloatArray]:
        """Return the readings (k, b) [m] of a simulation, and how far they are off their mean; NaN where none is."""
        shots, seen, base = self._shots, self._met, self._marks.base
        rng = np.random.default_rng([seed, 7])
        chain = effects.build_laser(model_effects_with(shots, settings), np.random.default_rng(seed))
        error = shots.laser.error
        raw = read(shots, seen, chain, rng.standard_normal(base.shape), self._statistics.pose_errors(rng))
        readings = error.reading(error.range(raw), np.zeros_like(raw))
        with np.errstate(invalid="ignore"):
            return readings, np.where(np.isfinite(readings), readings - base, np.nan)
