# SPDX-License-Identifier: BSD-3-Clause
"""laser.clock_skew: the laser's clock, which stamps its scans, runs fast or slow."""

from dataclasses import replace

from kurumaisu.effects.laser.base import BeamEffect, Beams
from kurumaisu.effects.mechanism import Parameter


class ClockSkew(BeamEffect):
    """Stamps that grow by (1 + skew) per second since a run's start; through: 1 where nothing sets them right then."""

    id = "laser.clock_skew"
    parameters = (
        Parameter("skew", "1", null=0.0, scale=1.0e-4, lower=-0.05, upper=0.05),
        Parameter("through", "1", null=0.0, scale=1.0, lower=0.0, upper=1.0),
    )
    forms = ({"through": 0.0}, {"through": 1.0})
    sentence = "the laser's clock runs fast or slow, so that its stamps drift"
    formula = "beams fired at t / (1 + skew); t since the start, or with through = 1 since the first run"
    source = "urg_stamped; 10-500 ppm, one real unit 0.125 %"

    def apply(self, beams: Beams) -> Beams:
        """Stretch the times."""
        since = self.since if self.values["through"] >= 0.5 else max(self.since, beams.start)
        return replace(beams, times=since + (beams.times - since) / (1 + self.values["skew"]))
