# SPDX-License-Identifier: BSD-3-Clause
"""Figures 3 to 6: rates against voltages, with the lines that were found and those of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kurumaisu._core import AxisLaw
from kurumaisu.paper import drawing
from kurumaisu.paper.chair.correlation import Correlations
from kurumaisu.paper.chair.law import AxisFit, BranchFit
from kurumaisu.paper.chair.samples import Samples
from kurumaisu.types import FloatArray

_PANELS = (  # number, rate, volts, labels
    (3, "v", "v_f", "v [m/s]", "V_f [V]"),
    (4, "v", "v_s", "v [m/s]", "V_s [V]"),
    (5, "w", "v_f", "w [rad/s]", "V_f [V]"),
    (6, "w", "v_s", "w [rad/s]", "V_s [V]"),
)


def draw(
    path: Path, samples: Samples, fits: Sequence[AxisFit], nominal: Sequence[AxisLaw], found: Correlations
) -> None:
    """Write the four scatter plots as SVG; nominal: the laws of the model, translation and steering."""
    steady = samples.of(samples.steady)
    told = (found.v_with_f, found.v_with_s, found.w_with_f, found.w_with_s)
    with drawing.figure(path, 2, 2, (7.2, 5.8)) as axes:
        for axis, (number, rate, volts, x, y), r in zip(axes.flat, _PANELS, told, strict=True):
            axis.axhline(0, color=drawing.FAINT, linewidth=0.8)
            axis.axvline(0, color=drawing.FAINT, linewidth=0.8)
            axis.plot(getattr(steady, rate), getattr(steady, volts), "o", color=drawing.MEASURED, alpha=0.6)
            axis.set(xlabel=x, ylabel=y, title=f"Figure {number}: correlation {r:+.4f}")
        for axis, fit, law in zip((axes[0][0], axes[1][1]), fits, nominal, strict=True):
            _lines(axis, fit, law)
            axis.legend()


def _lines(axis: Any, fit: AxisFit, law: AxisLaw) -> None:
    for number, (side, branch) in enumerate(fit.branches().items()):
        ends = _ends(branch, 1.0 if side == "positive" else -1.0)
        own = getattr(law, side)
        label = "the model's" if number == 0 else None
        # above the other, which it may well lie upon
        axis.plot(
            ends, own.slope * ends + own.intercept, "--", color=drawing.PAPER, linewidth=1.0, label=label, zorder=4
        )
        if branch.slope is not None and branch.intercept is not None and not branch.refused:
            line = branch.slope.value * ends + branch.intercept.value
            axis.plot(ends, line, color=drawing.LINE, linewidth=1.4, label="found" if number == 0 else None)


def _ends(branch: BranchFit, sign: float) -> FloatArray:
    """Return the rates between which a branch is drawn: from rest to the highest that was seen."""
    return np.array([0.0, sign * (branch.highest if np.isfinite(branch.highest) else 0.5)])


def data(path: Path, samples: Samples) -> None:
    """Write all samples as CSV, the unsteady ones, too."""
    drawing.table(
        path,
        {
            "t": samples.t,
            "v": samples.v,
            "w": samples.w,
            "v_f": samples.v_f,
            "v_s": samples.v_s,
            "steady": samples.steady.astype(int).tolist(),
            "block": samples.block.tolist(),
        },
    )


def coefficients(path: Path, fits: Sequence[AxisFit], nominal: Sequence[AxisLaw]) -> None:
    """Write what was found beside what the model has, a row for each coefficient."""
    rows: list[tuple[object, ...]] = []
    for fit, law in zip(fits, nominal, strict=True):
        for side, branch in fit.branches().items():
            own = getattr(law, side)
            for name in ("slope", "intercept"):
                one = getattr(branch, name)
                values = (one.value, one.low, one.high) if one is not None else (np.nan,) * 3
                plain = np.nan if branch.paper is None else float(getattr(branch.paper, name))
                rows.append((fit.name, side, name, *values, plain, getattr(own, name), branch.samples, branch.refused))
    names = ("axis", "side", "coefficient", "found", "low", "high", "least_squares", "model", "samples", "refused")
    drawing.table(path, dict(zip(names, zip(*rows, strict=True), strict=True)))
