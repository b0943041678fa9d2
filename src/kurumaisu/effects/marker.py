# SPDX-License-Identifier: BSD-3-Clause
"""base.marker_x and base.marker_y: what the reference tracks is not at base_link."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Follows, Parameter, Rate, Reference, ReferenceEffect
from kurumaisu.geometry import compose


def _shift(reference: Reference, x: float, y: float) -> Reference:
    """Return pose and rates of the point x, y [m] of base_link's frame."""
    w = reference.rates[..., 2]
    lever = np.stack([-w * y, w * x, np.zeros_like(w)], axis=-1)
    return replace(reference, poses=compose(reference.poses, np.array([x, y, 0.0])), rates=reference.rates + lever)


class MarkerX(ReferenceEffect):
    """The marker is in front of base_link."""

    id = "base.marker_x"
    parameters = (Parameter("x", "m", null=0.0, scale=0.03, lower=-2.0, upper=2.0),)
    sentence = "the reference measures a point in front of or behind base_link"
    formula = "pose ⊕ (x, 0, 0): u + x · w"
    source = "geometry; 10-50 mm"
    shows_in = Rate.V
    follows = Follows.W

    def apply(self, reference: Reference) -> Reference:
        """Shift forward."""
        return _shift(reference, self.values["x"], 0.0)


class MarkerY(ReferenceEffect):
    """The marker is to the left of base_link."""

    id = "base.marker_y"
    parameters = (Parameter("y", "m", null=0.0, scale=0.03, lower=-2.0, upper=2.0),)
    sentence = "the reference measures a point beside base_link"
    formula = "pose ⊕ (0, y, 0): v − y · w"
    source = "geometry; 10-50 mm"
    shows_in = Rate.V
    follows = Follows.W

    def apply(self, reference: Reference) -> Reference:
        """Shift to the left."""
        return _shift(reference, 0.0, self.values["y"])
