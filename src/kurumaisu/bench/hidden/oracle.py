# SPDX-License-Identifier: BSD-3-Clause
"""What somebody gains on data held out who knows what is hidden: the ceiling of any critic's gain."""

from __future__ import annotations

import numpy as np

from kurumaisu import geometry
from kurumaisu.bench.hidden.generator.case import Case, Known
from kurumaisu.bench.hidden.generator.noise import Regime
from kurumaisu.critic.base.drive import Drive, prepare
from kurumaisu.critic.noise.base_noise import Noise, whitened
from kurumaisu.critic.values.verdict import Gain
from kurumaisu.params import load_model, shipped
from kurumaisu.types import FloatArray

_SAME = 1e-6  # [s]


def gain_share(case: Case, gain: Gain | None) -> float | None:
    """Return a gain per sample as a share of the oracle's; None where the case does not say what the oracle knows.

    The oracle knows the increments that are to be expected, made by the generator's own code, and the noise. It is
    judged by the same filter, on the same increments, against the same baseline.
    """
    if case.known is None:
        return None
    if gain is None:
        return 0.0
    density = gain.log_density_per_sample
    return float(density.gain / (_density(case, case.known) - density.baseline))


def noise_of(regime: Regime) -> Noise:
    """Return a regime as the critic has it."""
    one = regime.colours[0]
    noise = dict(zip(("sd_v", "sd_lateral", "sd_w"), one.sd, strict=True)) | {"tau": one.tau}
    if len(regime.colours) > 1:
        other = regime.colours[1]
        noise |= dict(zip(("slow_v", "slow_lateral", "slow_w"), other.sd, strict=True)) | {"slow_tau": other.tau}
    white = np.sqrt(1 - regime.lasting)
    lasts = float(np.sqrt(regime.lasting) / white)
    sds = white * regime.position_sd, white * regime.heading_sd
    return Noise(*sds, **noise, lasting=lasts, lasting_tau=regime.lasting_tau)


def errors(drive: Drive, stamps: FloatArray, poses: FloatArray) -> FloatArray:
    """Return what is measured of a drive's increments less what poses (n, 3) at stamps (n,) say, (m, 3)."""
    truth = poses[np.searchsorted(stamps, drive.times - _SAME)]
    left = drive.measured - geometry.between(truth[:-1], truth[1:])
    left[:, 2] = geometry.wrap(left[:, 2])
    return left


def _density(case: Case, known: Known) -> float:
    """Return the oracle's log density per increment [nat]."""
    model, noise = load_model(shipped("launch/md100.yaml")), noise_of(known.regime)
    total, count = 0.0, 0
    for run, poses in zip(case.recording.runs, known.poses, strict=True):
        assert run.pose is not None
        drive = prepare(run, model)
        left = errors(drive, run.pose.t, poses)
        white, log_variances = whitened(drive, left.reshape(-1, 1), noise)
        total -= 0.5 * float(np.sum(white**2) + np.sum(log_variances) + white.size * np.log(2 * np.pi))
        count += len(left)
    return total / count
