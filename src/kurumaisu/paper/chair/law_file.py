# SPDX-License-Identifier: BSD-3-Clause
"""Equations (1) and (2) as they were found, as a model file that simulator and chair take: the law `custom`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from kurumaisu._core import AxisLaw, Branch
from kurumaisu.errors import Error
from kurumaisu.names import hint
from kurumaisu.paper.chair.law import AxisFit, BranchFit, Coefficient
from kurumaisu.paper.model_file import ModelFile
from kurumaisu.params import load_model


def settled(model: Path, fits: Sequence[AxisFit], keep: Sequence[str]) -> dict[str, AxisLaw]:
    """Return the laws that the fits, and the model for branches that are kept, come to.

    keep: names as `translation.negative` of branches to take from the model where they were refused.
    Raise Error for a branch that is neither determined nor kept, or is both.
    """
    known = [f"{fit.name}.{side}" for fit in fits for side in fit.branches()]
    for name in keep:
        if name not in known:
            raise Error(f"--keep {name}: {hint(name, known)}")
    there = load_model(model)
    laws = {}
    for fit in fits:
        own: AxisLaw = getattr(there, fit.name)
        branches = []
        for side, branch in fit.branches().items():
            name = f"{fit.name}.{side}"
            if branch.refused and name not in keep:
                raise Error(f"{name}: {branch.refused}; drive again, or take it from {model} with --keep {name}")
            branches.append(getattr(own, side) if name in keep else _found(branch))
        try:
            laws[fit.name] = AxisLaw(*branches)
        except ValueError as error:
            raise Error(f"{fit.name}: {error}") from error
    return laws


def _found(branch: BranchFit) -> Branch:
    assert branch.slope is not None
    assert branch.intercept is not None
    return Branch(branch.slope.value, branch.intercept.value)


def write_law(
    model: Path, fits: Sequence[AxisFit], laws: Mapping[str, AxisLaw], provenance: Sequence[str], out: Path
) -> None:
    """Write the model with the law as `custom`, in use; intervals and where it comes from as comments."""
    file = ModelFile(model)
    rows = []
    for fit in fits:
        rows.append(f"{fit.name}:")
        for side, branch in fit.branches().items():
            rows.append(f"  {side}: {_flow(getattr(laws[fit.name], side))}  # {_interval(branch, fit.unit)}")
    file.replace_block(("voltage_laws", "custom"), rows)
    file.replace(("voltage_law",), "custom")
    file.head(provenance)
    file.write(out)
    load_model(out)  # what was written can be read


def _flow(branch: Branch) -> str:
    return f"{{slope: {branch.slope:.6f}, intercept: {branch.intercept:.6f}}}"


def _interval(branch: BranchFit, unit: str) -> str:
    if branch.refused:
        return f"kept as it was: {branch.refused}"
    assert branch.slope is not None
    assert branch.intercept is not None
    slope, intercept = _range(branch.slope), _range(branch.intercept)
    return f"slope {slope}, intercept {intercept} V; {branch.lowest:.2f} to {branch.highest:.2f} {unit}"


def _range(coefficient: Coefficient) -> str:
    return f"{coefficient.low:.4f} to {coefficient.high:.4f}"
