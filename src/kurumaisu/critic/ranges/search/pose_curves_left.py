# SPDX-License-Identifier: BSD-3-Clause
"""Whether the laser is elsewhere than the reference says, with all that was found in place.

Beside a loud delay a curve of the heading over the yaw rate draws what the delay's line misses; so such curves are in
the running only where something is left for them at the end.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kurumaisu.critic.ranges.search.block_evidence import BEYOND, without_span
from kurumaisu.critic.ranges.search.normal_equations import NormalEquations
from kurumaisu.critic.ranges.search.parameter_fit import ParameterFit
from kurumaisu.critic.ranges.signals.coefficient_blocks import pose_curves
from kurumaisu.critic.unknown.curves import curve_evidence
from kurumaisu.critic.values.prior import UNKNOWN_ODDS


def pose_curves_left(fit: ParameterFit, normal: NormalEquations) -> bool:
    """Return whether a curve of the laser's pose explains what fitted effects leave, beside their parameters.

    normal: with noise that was estimated whatever curves act.
    """
    there, beams = fit.assembly, fit.normal.beam_noise
    noise = replace(normal, beam_noise=replace(beams, valid=beams.valid & normal.beam_noise.valid))
    made = list(pose_curves(there.shots, there.marks, there.poses))
    if not made:
        return False
    gram = there.products(noise, np.concatenate([fit.slopes, *(one for _, one in made)], axis=2), fit.left)
    rest, start = np.arange(fit.slopes.shape[2]), fit.slopes.shape[2]
    share = float(np.log(UNKNOWN_ODDS / len(made)))
    for block, columns in made:
        own = np.arange(start, start + columns.shape[2])
        start = own[-1] + 1
        if curve_evidence(*without_span(gram, own, rest), block.priors).nats + share > BEYOND:
            return True
    return False
