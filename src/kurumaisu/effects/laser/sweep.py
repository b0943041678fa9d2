# SPDX-License-Identifier: BSD-3-Clause
"""laser.sweep: a scan takes longer or shorter than its message says, so motion distorts it otherwise."""

from dataclasses import replace

from kurumaisu.effects.laser.base import BeamEffect, Beams
from kurumaisu.effects.mechanism import Parameter


class Sweep(BeamEffect):
    """The time from the first beam to each other one stretched; -1: all at once, as in a simple simulator."""

    id = "laser.sweep"
    parameters = (Parameter("stretch", "1", null=0.0, scale=0.1, lower=-1.0, upper=1.0),)
    sentence = "the duration of a scan differs from its message, so motion distorts it differently"
    formula = "beam i fired at t₀ + i · time_increment · (1 + stretch)"
    source = "geometry; −1 for drivers that correct the scan for motion"

    def apply(self, beams: Beams) -> Beams:
        """Stretch the sweep."""
        first = beams.times[0]
        return replace(beams, times=first + (beams.times - first) * (1 + self.values["stretch"]))
