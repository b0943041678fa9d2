# SPDX-License-Identifier: BSD-3-Clause
"""base.marker_x, base.marker_y and base.marker_yaw: what the reference tracks is not base_link."""

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


class MarkerYaw(ReferenceEffect):
    """The marker is turned to the left of base_link."""

    id = "base.marker_yaw"
    parameters = (Parameter("yaw", "rad", null=0.0, scale=0.02, lower=-1.0, upper=1.0),)
    sentence = "the heading of the reference is not the chair's: what it tracks is turned"
    formula = "pose ⊕ (0, 0, yaw): v · cos yaw + u · sin yaw, u · cos yaw − v · sin yaw"
    source = "geometry; motion capture and scan matching define headings of their own; 0.5-5°"
    shows_in = Rate.V
    follows = Follows.V

    def apply(self, reference: Reference) -> Reference:
        """Turn to the left."""
        yaw = self.values["yaw"]
        v, u, w = np.moveaxis(reference.rates, -1, 0)
        rates = np.stack([v * np.cos(yaw) + u * np.sin(yaw), u * np.cos(yaw) - v * np.sin(yaw), w], axis=-1)
        return replace(reference, poses=compose(reference.poses, np.array([0.0, 0.0, yaw])), rates=rates)
