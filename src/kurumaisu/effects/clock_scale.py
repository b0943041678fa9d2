# SPDX-License-Identifier: BSD-3-Clause
"""base.clock_scale: the reference's clock runs faster or slower than that of the commands."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Follows, Parameter, Rate, Reference, ReferenceEffect


class ClockScale(ReferenceEffect):
    """The reference's times stretched from the start on, and its rates, which are per its seconds."""

    id = "base.clock_scale"
    parameters = (
        Parameter("scale", "1", null=0.0, scale=1.0e-3, lower=-0.2, upper=0.2),
        Parameter("through", "1", null=0.0, scale=1.0, lower=0.0, upper=1.0),
    )
    forms = ({"through": 0.0}, {"through": 1.0})
    sentence = "the clocks of the reference and of the commands run at different speeds"
    formula = "t · (1 + scale), rates / (1 + scale); t since the start, or with through = 1 since the first run"
    source = "assumed: computers without a common clock; 0.01-0.5 %"
    shows_in = Rate.V
    follows = Follows.V_CHANGE
    of_times = True

    def apply(self, reference: Reference) -> Reference:
        """Stretch the times."""
        stretch = 1 + self.values["scale"]
        since = self.since if self.values["through"] >= 0.5 else max(self.since, reference.start)
        return replace(
            reference,
            times=np.asarray(since + (reference.times - since) * stretch),
            rates=reference.rates / stretch,
        )
