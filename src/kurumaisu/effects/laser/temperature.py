# SPDX-License-Identifier: BSD-3-Clause
"""laser.temperature: ranges follow the room's temperature."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter


class Temperature(ReadingEffect):
    """An offset in proportion to the temperature; where none is known, to one that goes up and down as by a heater."""

    id = "laser.temperature"
    stage = LaserStage.BIAS
    parameters = (
        Parameter("coefficient", "m/K", null=0.0, scale=5.0e-4, lower=-0.01, upper=0.01),
        Parameter("swing", "K", null=5.0, scale=5.0, lower=0.0, upper=50.0),
        Parameter("reference", "deg C", null=20.0, scale=2.0, lower=10.0, upper=30.0),
        Parameter("period", "s", null=600.0, scale=600.0, lower=1.0, upper=1.0e5),
    )
    sentence = "ranges change with the temperature"
    formula = "µ + coefficient · (T − reference); T − reference = swing · sin(2π t / period) where T is unknown"
    source = "assumed; 0.1-1 mm/K"
    empirical = True

    def apply(self, echoes: Echoes) -> Echoes:
        """Shift the mean by the temperature of now."""
        if "temperature" in echoes.known:
            warmer = echoes.known["temperature"] - self.values["reference"]
        else:
            time = echoes.stamp - self.since
            warmer = self.values["swing"] * np.sin(2 * np.pi * time / self.values["period"])
        return replace(echoes, mean=echoes.mean + self.values["coefficient"] * warmer)
