# SPDX-License-Identifier: BSD-3-Clause
"""Equations (1) and (2) from samples: two lines that meet at the origin, each with intervals, or a reason why not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from kurumaisu._core import AxisLaw, Branch
from kurumaisu.paper.chair import coloured_noise, lines
from kurumaisu.paper.chair.samples import Samples
from kurumaisu.paper.options import Bootstrap, PaperOptions
from kurumaisu.types import BoolArray, FloatArray, IntArray

SIDES = {"positive": 1.0, "negative": -1.0}
_ROUNDS = 2  # of telling motion from rest
_MOVES = 0.5  # of the level of rest: the line tells motion from rest better than a sample does
_FAR = 2.5  # standard deviations to which residuals are cut before their colour is looked at


@dataclass(frozen=True)
class Axis:
    """Translation or steering: names, unit of the rate, and its samples."""

    name: str
    rate: FloatArray
    volts: FloatArray
    side: FloatArray
    sd: FloatArray
    unit: str

    def rest_level(self, options: PaperOptions) -> float:
        """Return the rate below which a sample may be one at rest: what samples at neutral, and the reference, scatter.

        At neutral the chair stands, equations (1) and (2).
        """
        near = np.abs(self.volts) < 3 * options.drive.voltage_sd
        # by (2) as printed a slow turn has next to no voltage either: by what was meant, where somebody says so
        neutral = near & (np.isnan(self.side) | (self.side == 0))
        scatter = float(np.median(np.abs(self.rate[neutral]))) / lines.NORMAL_MAD if neutral.any() else 0.0
        return options.drive.rest * max(scatter, float(np.median(self.sd)))


def axes_of(samples: Samples) -> tuple[Axis, Axis]:
    """Return translation and steering."""
    return (
        Axis("translation", samples.v, samples.v_f, samples.side_v, samples.sd_v, "m/s"),
        Axis("steering", samples.w, samples.v_s, samples.side_w, samples.sd_w, "rad/s"),
    )


@dataclass(frozen=True)
class Coefficient:
    """An estimate with its interval."""

    value: float
    low: float
    high: float

    @property
    def half(self) -> float:
        """Half the interval's width."""
        return 0.5 * (self.high - self.low)


@dataclass(frozen=True)
class BranchFit:
    """One side of a law: volts = slope * rate + intercept.

    paper: least squares as in the paper; refused: why the samples do not determine it, or ''; curvature: of the
    branch, in standard errors; scatter: sd of a sample's rate about the line; lowest, highest: rates that were seen.
    """

    samples: int
    blocks: int
    lowest: float
    highest: float
    paper: Branch | None
    slope: Coefficient | None
    intercept: Coefficient | None
    scatter: float
    curvature: float
    refused: str


@dataclass(frozen=True)
class AxisFit:
    """Both sides of a law. overlap: whether both would answer to a voltage, as equation (2) as printed."""

    name: str
    unit: str
    positive: BranchFit
    negative: BranchFit

    def branches(self) -> dict[str, BranchFit]:
        """Return both by their names in the model file."""
        return {"positive": self.positive, "negative": self.negative}

    @property
    def refused(self) -> list[str]:
        """Return why a side is not determined."""
        return [f"{self.name}.{side}: {fit.refused}" for side, fit in self.branches().items() if fit.refused]

    def law(self) -> AxisLaw:
        """Return the law, which must be determined. Raise ValueError for slopes of different signs."""
        found = []
        for fit in self.branches().values():
            assert fit.slope is not None
            assert fit.intercept is not None
            found.append(Branch(fit.slope.value, fit.intercept.value))
        return AxisLaw(*found)

    @property
    def overlap(self) -> bool:
        """True where both sides answer to a voltage: base_node takes such a law only if it is called `published`."""
        return overlaps(self.law())


def overlaps(law: AxisLaw) -> bool:
    """Return whether the branches of a law leave no dead zone about 0 V."""
    sign = np.sign(law.positive.slope)
    return bool(sign * law.positive.intercept < 0 or sign * law.negative.intercept > 0)


def fit_axis(axis: Axis, samples: Samples, options: PaperOptions) -> AxisFit:
    """Return the law of an axis; each side is fitted, or refused, for itself."""
    rng = np.random.default_rng(options.bootstrap.seed)
    sides = [_on_side(axis, samples, side, options) for side in SIDES.values()]
    wider = _widening(axis, samples, sides, options)
    fits = [_fit_branch(axis, samples, *side, options, rng) for side in zip(sides, wider, strict=True)]
    return AxisFit(axis.name, axis.unit, *fits)


def _widening(axis: Axis, samples: Samples, sides: Sequence[BoolArray], options: PaperOptions) -> list[FloatArray]:
    """Return for each side by how much noise that outlasts a block widens slope and intercept, as variances (2,)."""
    lined = [on if _spread(axis, on, options) else np.zeros_like(on) for on in sides]
    used = np.logical_or(*lined)
    design, rate, influence = np.zeros((len(used), 4)), np.zeros(len(used)), np.zeros((4, len(used)))
    for n, on in enumerate(lined):
        if not on.any():
            continue
        line = _line(axis, on, options)
        off = axis.rate[on] - (axis.volts[on] - line.intercept) / line.slope
        far = _FAR * float(np.median(np.abs(off))) / lines.NORMAL_MAD
        rate[on] = np.clip(off, -far, far)
        design[on, 2 * n], design[on, 2 * n + 1] = 1.0, axis.volts[on]
        influence[2 * n : 2 * n + 2, on] = _influence(axis.volts[on], line)
    if not used.any():
        return [np.ones(2), np.ones(2)]
    found = coloured_noise.Residuals(samples.t[used], samples.run[used], samples.block[used], rate[used], design[used])
    wider = coloured_noise.widening(found, influence[:, used])
    return [wider[:2], wider[2:]]


def _influence(volts: FloatArray, line: lines.Lines) -> FloatArray:
    """Return what an error of each rate does to slope and intercept, but for a factor (2, n): of rate = a volts + b."""
    about = volts - volts.mean()
    of_a = about / (about @ about)
    of_b = 1 / len(volts) - volts.mean() * of_a
    return np.stack([of_a, of_b + line.intercept * of_a])  # intercept = -b / a, and b = -intercept / slope


def _on_side(axis: Axis, samples: Samples, side: float, options: PaperOptions) -> BoolArray:
    """Return which samples are steady and move to a side.

    By what the reference saw: on a chair whose dead zone is wider than its model's, a command is no motion. But not
    sample by sample: of slow ones those that noise slows down further would be left out, and the line be biased. So
    the clear ones make a line, and the line says from which voltage on the chair moves.
    """
    level = axis.rest_level(options)
    unknown = np.isnan(axis.side)
    able = samples.steady & (unknown | (axis.side == side)) & (axis.volts != 0)
    on = able & (side * axis.rate > level)
    able &= ~unknown | (side * axis.rate > 0)
    for _ in range(_ROUNDS):
        if len(np.unique(samples.block[on])) < options.drive.least_blocks or not _spread(axis, on, options):
            break
        line = _line(axis, on, options)
        on = able & (side * (axis.volts - line.intercept) / line.slope > level * _MOVES)
    return np.asarray(on)


def _spread(axis: Axis, on: BoolArray, options: PaperOptions) -> bool:
    """Return whether there are voltages enough for a line."""
    return bool(on.any()) and bool(np.ptp(axis.volts[on]) >= options.drive.steady)


def _line(axis: Axis, on: BoolArray, options: PaperOptions) -> lines.Lines:
    return lines.robust(axis.rate[on], axis.volts[on], np.ones(int(on.sum())), options.drive.voltage_sd)


def _fit_branch(
    axis: Axis, samples: Samples, on: BoolArray, wider: FloatArray, options: PaperOptions, rng: np.random.Generator
) -> BranchFit:
    rate, volts, block = axis.rate[on], axis.volts[on], samples.block[on]
    blocks = len(np.unique(block))
    if blocks < options.drive.least_blocks:
        plural = "" if blocks == 1 else "es"
        why = f"{blocks} stretch{plural} of steady motion to this side, {options.drive.least_blocks} are needed"
        return _none(rate, blocks, why)
    if np.ptp(volts) < options.drive.steady:
        span = f"{volts.min():.3f} to {volts.max():.3f} V"
        return _none(rate, blocks, f"all its voltages are from {span}: slope and intercept cannot be told apart")
    ones = np.ones(len(rate))
    line = _line(axis, on, options)
    drawn = lines.robust(
        rate, volts, lines.block_counts(block, options.bootstrap.resamples, rng), options.drive.voltage_sd
    )
    plain = lines.least_squares(rate, volts, ones)
    slope = interval(float(line.slope), drawn.slope, blocks, float(wider[0]), options.bootstrap)
    intercept = interval(float(line.intercept), drawn.intercept, blocks, float(wider[1]), options.bootstrap)
    return BranchFit(
        samples=len(rate),
        blocks=blocks,
        lowest=float(np.abs(rate).min()),
        highest=float(np.abs(rate).max()),
        paper=Branch(float(plain.slope), float(plain.intercept)),
        slope=slope,
        intercept=intercept,
        scatter=float(np.std((volts - line.at(rate)) / line.slope, ddof=2)),
        curvature=_curvature(rate, volts, block, options.drive.voltage_sd),
        refused=_refusal(slope, intercept, rate, axis.unit, options),
    )


def _none(rate: FloatArray, blocks: int, why: str) -> BranchFit:
    size = np.abs(rate) if len(rate) else np.array([np.nan])
    return BranchFit(len(rate), blocks, float(size.min()), float(size.max()), None, None, None, np.nan, np.nan, why)


def interval(value: float, drawn: FloatArray, blocks: int, wider: float, options: Bootstrap) -> Coefficient:
    """Return an estimate with Student's interval by the bootstrap's sd; wider: factor of the variance by slow noise.

    Few blocks scatter by less than they should about a line fitted to them, by the root of (n - 2) / n, and Student
    knows that their scatter is a guess, too. Percentiles of the bootstrap know neither.
    """
    finite = drawn[np.isfinite(drawn)]
    if len(finite) < 0.9 * len(drawn):
        return Coefficient(value, -np.inf, np.inf)
    sd = float(np.std(finite)) * np.sqrt(wider * blocks / (blocks - 2))
    half = float(student.ppf(0.5 + options.level / 2, blocks - 2)) * sd
    return Coefficient(value, value - half, value + half)


def _refusal(slope: Coefficient, intercept: Coefficient, rate: FloatArray, unit: str, options: PaperOptions) -> str:
    size = np.abs(rate)
    seen = f"rates from {size.min():.2f} to {size.max():.2f} {unit}, {len(rate)} samples"
    if not slope.half <= options.drive.widest_slope * abs(slope.value):
        return f"its slope is known to {100 * slope.half / abs(slope.value):.0f} % only: {seen}"
    if not intercept.half <= options.drive.widest_intercept:
        return f"its intercept is known to {intercept.half:.3f} V only: {seen}"
    return ""


def _curvature(rate: FloatArray, volts: FloatArray, block: IntArray, voltage_sd: float) -> float:
    """Return the t value of a square term, by block means: noise within a block is one.

    Where a simulator has no noise, what the D/A is said to scatter by, voltage_sd [V], remains: rounding is no bend.
    """
    names, index = np.unique(block, return_inverse=True)
    size = np.bincount(index)
    x, y = np.bincount(index, volts) / size, np.bincount(index, rate) / size
    columns = np.column_stack([np.ones(len(x)), x, (x - x.mean()) ** 2])
    if len(names) < 5 or np.linalg.matrix_rank(columns) < 3:
        return 0.0
    root = np.sqrt(size)
    found, *_ = np.linalg.lstsq(columns * root[:, np.newaxis], y * root, rcond=None)
    left = (y - columns @ found) * root
    variance = max(left @ left / (len(x) - 3), (found[1] * voltage_sd) ** 2)
    covariance = np.linalg.inv((columns * size[:, np.newaxis]).T @ columns) * variance
    return float(found[2] / np.sqrt(covariance[2, 2]))
