# SPDX-License-Identifier: BSD-3-Clause
"""laser.latency: a scan's stamp is late by a constant."""

from dataclasses import replace

from kurumaisu.effects.laser.base import BeamEffect, Beams
from kurumaisu.effects.mechanism import Parameter


class Latency(BeamEffect):
    """Beams fired before the time on the stamp; after it where the delay is negative."""

    id = "laser.latency"
    parameters = (Parameter("delay", "s", null=0.0, scale=0.02, lower=-0.2, upper=1.0),)
    sentence = "scans are stamped later or earlier than they are taken"
    formula = "beams fired at t − delay"
    source = "urg_node logs −21 ms; 5-100 ms"

    def apply(self, beams: Beams) -> Beams:
        """Shift the times."""
        return replace(beams, times=beams.times - self.values["delay"])
