# SPDX-License-Identifier: BSD-3-Clause
"""laser.temperature: ranges follow the room's temperature."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import LAGS, Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter
from kurumaisu.types import FloatArray


class Temperature(ReadingEffect):
    """An offset in proportion to the temperature; where none is known, to one that goes up and down as by a heater.

    A laser takes its time to follow what a thermometer beside it says; where only the present is known, it has none.
    """

    id = "laser.temperature"
    stage = LaserStage.BIAS
    parameters = (
        Parameter("coefficient", "m/K", null=0.0, scale=5.0e-4, lower=-0.01, upper=0.01),
        Parameter("swing", "K", null=5.0, scale=5.0, lower=0.0, upper=50.0),
        Parameter("reference", "deg C", null=20.0, scale=2.0, lower=10.0, upper=30.0),
        Parameter("period", "s", null=600.0, scale=600.0, lower=1.0, upper=1.0e5),
        Parameter("lag", "s", null=0.0, scale=120.0, lower=0.0, upper=float(LAGS[-1])),
    )
    sentence = "ranges change with the temperature"
    formula = (
        "µ + coefficient · (T − reference), T behind what is recorded by a first-order lag; "
        "T − reference = swing · sin(2π t / period) where T is unknown"
    )
    source = "assumed; 0.1-1 mm/K"
    empirical = True

    @classmethod
    def usual(cls) -> dict[str, float]:
        """Return what a setting may leave out: a laser follows at once."""
        return {"lag": 0.0}

    def apply(self, echoes: Echoes) -> Echoes:
        """Shift the mean by the temperature of now."""
        if "temperature" in echoes.known:
            warmer = self._own(echoes) - self.values["reference"]
        else:
            time = echoes.stamp - self.since
            warmer = self.values["swing"] * np.sin(2 * np.pi * time / self.values["period"])
        return replace(echoes, mean=echoes.mean + self.values["coefficient"] * warmer)

    def _own(self, echoes: Echoes) -> float | FloatArray:
        """Return the laser's temperature [deg C] at the stamps, between the lags at which the past is known."""
        past = echoes.past.get("temperature")
        if self.values["lag"] == 0.0 or past is None:
            return echoes.known["temperature"]
        place = float(np.interp(self.values["lag"], LAGS, np.arange(len(LAGS))))
        low = min(int(place), len(LAGS) - 2)
        return np.asarray(past[:, [low]] + (place - low) * (past[:, [low + 1]] - past[:, [low]]))
