# SPDX-License-Identifier: BSD-3-Clause
"""Whether scans as a whole are off together, by all of them: some ninety say too little of half a millimetre."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.laser.noise import CommonMode, ScanNoise
from kurumaisu.critic.laser.spread import Scatter
from kurumaisu.critic.naming import NAMED, RIVAL
from kurumaisu.critic.prior import log_prior
from kurumaisu.critic.recording import Recording
from kurumaisu.params import EffectSetting

WHOLE = "laser.common_mode"  # what ScanNoise has beside the reference's errors


def with_whole_scans(
    scatter: Sequence[Scatter], seen: CommonMode, noise: ScanNoise, recording: Recording
) -> list[Scatter]:
    """Return effects on the scatter with a common mode of the scans where the likelihood of all scans calls for one.

    Its sizes are taken from there even where the scatter has shown it: there, only some of the scans were looked at.
    """
    count = len(effects.LASER)
    nats = seen.nats + log_prior(1, count) - log_prior(0, count)
    known = next((each for each in scatter if each.setting.id == WHOLE), None)
    p = 1.0 / (1.0 + float(np.exp(-nats)))
    if p < NAMED or (known is None and any(each.rivals.get(WHOLE, 0.0) >= RIVAL for each in scatter)):
        return list(scatter)  # what stands in its place was weighed against it already
    rho = float(np.exp(-_period(recording) / noise.common_tau))
    p_sd, p_rho = (p for p in effects.by_id(WHOLE).parameters if p.name in ("sd", "rho"))
    values = {"sd": min(noise.common_sd, p_sd.upper), "rho": min(max(rho, p_rho.lower), p_rho.upper)}
    sds = {"sd": noise.common_sd * seen.log_sd, "rho": rho * -np.log(rho) * seen.log_tau}
    rest = [each for each in scatter if each is not known]
    return [*rest, Scatter(EffectSetting(WHOLE, values), p, max(nats, known.nats if known else nats), sds, {})]


def _period(recording: Recording) -> float:
    """Return the usual time [s] from one scan of a recording to the next, whatever of them is looked at."""
    steps = [np.diff(run.scan.t) for run in recording.runs if run.name in recording.train and run.scan is not None]
    return float(np.median(np.concatenate(steps)))
