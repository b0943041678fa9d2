# SPDX-License-Identifier: BSD-3-Clause
"""No command that base_node lets pass, as shipped, steps further than the guard, as shipped, allows."""

import numpy as np
import pytest
import yaml

from kurumaisu.params import shipped

BASE, GUARD, MD100 = (
    yaml.safe_load(shipped(f"launch/{name}.yaml").read_text()) for name in ("base_node", "guard", "md100")
)


def volts(law, rate):
    """Equations (1) and (2) from the file alone."""
    up, down = law["positive"], law["negative"]
    above = up["slope"] * rate + up["intercept"]
    return np.where(rate > 0, above, np.where(rate < 0, down["slope"] * rate + down["intercept"], 0.0))


@pytest.mark.parametrize("law", MD100["voltage_laws"])
@pytest.mark.parametrize("limits", BASE["limits"])
@pytest.mark.parametrize(("axis", "rate"), [("translation", "v"), ("steering", "w")])
def test_the_guard_bears_the_steepest_ramp(law, limits, axis, rate):
    own = BASE["limits"][limits]
    most = max(own[f"{rate}_acceleration"], own[f"{rate}_deceleration"])
    rates = np.linspace(-1.5, 1.5, 3001)
    change = max(
        float(
            np.max(
                np.abs(
                    volts(MD100["voltage_laws"][law][axis], rates + step)
                    - volts(MD100["voltage_laws"][law][axis], rates)
                )
            )
        )
        for step in np.linspace(0.0, most / BASE["rate"], 101)
    )
    assert change < GUARD["limits"][axis]["step"]
