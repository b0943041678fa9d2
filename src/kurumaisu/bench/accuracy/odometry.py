# SPDX-License-Identifier: BSD-3-Clause
"""Whether base_node's odometry knows how wrong it is: its covariance against many drives of the simulator's chair."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import yaml
from scipy.stats import chi2

from kurumaisu._core import dead_reckoning
from kurumaisu.bench.table import Table
from kurumaisu.params import EffectSetting, load_model, shipped
from kurumaisu.sim.plant import Plant, path
from kurumaisu.types import FloatArray

STEP, TICK = 0.01, 0.02  # [s] of the simulator and of base_node
# v [m/s], w [rad/s], seconds: a wait, in which the simulator's noise comes to its usual size; then straight, a bend,
# a stop, a turn on the spot, backwards in a bend
_PHASES = (
    (0.0, 0.0, 20.0),
    (0.6, 0.0, 8.0),
    (0.5, 0.4, 10.0),
    (0.0, 0.0, 2.0),
    (0.0, 0.7, 5.0),
    (-0.3, -0.3, 8.0),
)
_NAMES = ("sd_v", "sd_w", "tau", "growth")  # of base.process_noise
# the catalogue's, a slow one, a quick one that grows with the rates
NOISES = ((0.01, 0.02, 0.3, 0.0), (0.03, 0.01, 6.0, 0.0), (0.02, 0.03, 0.05, 2.0))
_NO_GROWTH = (0.0,) * 5
_GROWTH = (
    "forward_per_distance",
    "forward_per_turn",
    "lateral_per_distance",
    "heading_per_distance",
    "heading_per_turn",
)

Estimate = tuple[FloatArray, FloatArray]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the mean squared error by each covariance. Return 1 if that of the measured noise is out of bounds."""
    parser = argparse.ArgumentParser(prog="scripts/bench odometry", description=__doc__)
    parser.add_argument("--drives", type=int, default=1000, help="of each noise")
    options = parser.parse_args(arguments)
    low, high = bounds(options.drives)
    title = f"Normalised squared error of the pose, {options.drives} drives of 33 s; right: {low:.2f} to {high:.2f}"
    table = Table(title, "noise: sd_v sd_w tau growth", "measured", "taken for white", "assumed growth")
    good = True
    for rates in NOISES:
        truth = ends(rates, options.drives)
        errors = [float(np.mean(nees(truth, *estimate))) for estimate in (measured(rates), white(rates), assumed())]
        table.row(" ".join(f"{rate:g}" for rate in rates), *errors)
        good &= low < errors[0] < high
    return int(not good)


def ends(rates: Sequence[float], drives: int) -> FloatArray:
    """Return where the simulator's chair is after each of many drives with this noise, (drives, 3) [m, m, rad]."""
    noise = EffectSetting("base.process_noise", dict(zip(_NAMES, rates, strict=True)))
    model = replace(load_model(shipped("launch/md100.yaml")), effects=(noise,))
    v, w = _held(STEP)
    seeds = range(drives)
    return np.array(
        [path(Plant(model, STEP, np.random.default_rng(n)).from_rates(v, w), np.zeros(3))[-1] for n in seeds]
    )


def nees(truth: FloatArray, pose: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the squared error in units of the covariance, (drives,); 3 on average where that is right."""
    error = truth - pose
    return np.asarray(np.einsum("ni,ij,nj->n", error, np.linalg.inv(covariance), error))


def bounds(drives: int, share: float = 0.998) -> tuple[float, float]:
    """Return between which numbers the mean error of so many drives lies in that share of cases, if all is right."""
    low, high = chi2.ppf([(1 - share) / 2, (1 + share) / 2], 3 * drives) / drives
    return float(low), float(high)


def measured(rates: Sequence[float]) -> Estimate:
    """Return pose (3,) and covariance (3, 3) at the end, by base_node with the noise in its model file."""
    return _end(_NO_GROWTH, rates)


def white(rates: Sequence[float]) -> Estimate:
    """Return the same if the noise of each tick had nothing to do with that of the one before: tau forgotten."""
    sd_v, sd_w, _, growth = rates
    return _end(_NO_GROWTH, (sd_v, sd_w, TICK / 2, growth))


def assumed() -> Estimate:
    """Return the same by the growth that base_node.yaml assumes where nothing was measured."""
    noise = yaml.safe_load(shipped("launch/base_node.yaml").read_text(encoding="utf-8"))["odometry"]["noise"]
    return _end([noise[name] for name in _GROWTH], (0.0, 0.0, 1.0, 0.0))


def _end(growth: Sequence[float], rates: Sequence[float]) -> Estimate:
    poses, covariances = dead_reckoning(*_held(TICK), TICK, growth, rates)
    return poses[-1], covariances[-1]


def _held(step: float) -> tuple[FloatArray, FloatArray]:
    counts = [round(seconds / step) for _, _, seconds in _PHASES]
    v, w = (np.repeat([phase[i] for phase in _PHASES], counts) for i in (0, 1))
    return v, w
