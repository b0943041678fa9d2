# SPDX-License-Identifier: BSD-3-Clause
"""base.slope: the floor is not level, so speed depends on the direction driven."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage

_CREEPS = 0.02, 0.04  # [m/s], [rad/s] up to which the motors and their gears hold a chair more and more


class Slope(Effect):
    """Forward speed less what the climb costs; a chair at rest is held by its brakes.

    One that comes to rest slowly is held before it does: it would roll down for as long as its last turn dies away.
    driving: 1 if it is held on the spot, too, where only its turn drives the wheels.
    """

    id = "base.slope"
    stage = Stage.FLOOR
    parameters = (
        Parameter("climb_x", "m/s", null=0.0, scale=0.02, lower=-0.5, upper=0.5),
        Parameter("climb_y", "m/s", null=0.0, scale=0.02, lower=-0.5, upper=0.5),
        Parameter("driving", "1", null=0.0, scale=1.0, lower=0.0, upper=1.0),
    )
    forms = ({"driving": 0.0}, {"driving": 1.0})
    sentence = "the chair is slower in one direction than in the opposite one, as on a slope"
    formula = (
        "v − g · (climb_x · cos(θ) + climb_y · sin(θ)); θ: heading in the map; "
        "g = tanh(√((v / 0.02 m/s)² + (1 − driving) · (w / 0.04 rad/s)²))"
    )
    source = "a wheelchair's model with gravity on inclines, 2016; 10-40 mm/s"
    shows_in = Rate.V
    follows = Follows.V

    _heading = 0.0  # [rad] before the next chunk, where nobody knows it

    def apply(self, motion: Motion) -> Motion:
        """Slow v by the heading in the middle of each step."""
        before = self._heading if motion.heading is None else motion.heading
        after = before + np.cumsum(motion.w) * motion.dt
        self._heading = float(after[-1])
        # A sum of turns drifts away from where a chair on a real floor heads: better what was measured.
        heading = motion.known.get("heading", after - motion.w * motion.dt / 2)
        loss = self.values["climb_x"] * np.cos(heading) + self.values["climb_y"] * np.sin(heading)
        turns = np.sqrt(1 - self.values["driving"]) * motion.w / _CREEPS[1]
        rolls = np.tanh(np.hypot(motion.v / _CREEPS[0], turns))
        return replace(motion, v=motion.v - rolls * loss)
