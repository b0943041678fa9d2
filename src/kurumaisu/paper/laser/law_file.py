# SPDX-License-Identifier: BSD-3-Clause
"""Equation (4) as it was found, as a model file that simulator, driver and mapping take."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kurumaisu import settings
from kurumaisu.errors import Error
from kurumaisu.paper.chair.law import Coefficient
from kurumaisu.paper.laser.law import NAMES, LaserLaw
from kurumaisu.paper.model_file import ModelFile
from kurumaisu.params import load_model


def printed(model: Path) -> tuple[float, ...]:
    """Return scale, datum_offset and the three of sigma of a model file. Raise Error naming file and key."""
    error = settings.load(model).section("laser").section("error")
    return error.number("scale"), error.number("datum_offset"), *error.numbers("sigma", 3)


def check(law: LaserLaw, model: Path) -> None:
    """Raise Error unless the standard deviation is positive wherever the model's laser reads."""
    laser = load_model(model).laser
    r = np.linspace(laser.range_min, laser.range_max, 200)
    if law.deviation(r).min() <= 0:
        worst = r[int(np.argmin(law.deviation(r)))]
        raise Error(f"sigma is not above 0 at {worst:.2f} m: the distances do not determine a parabola")


def write_laser(model: Path, law: LaserLaw, provenance: Sequence[str], out: Path) -> None:
    """Write the model with this equation (4); intervals and where it comes from as comments at its head."""
    check(law, model)
    file = ModelFile(model)
    file.replace(("laser", "error", "scale"), f"{law.scale.value:.6f}")
    file.replace(("laser", "error", "datum_offset"), f"{law.datum_offset.value:.6f}")
    sigma = ", ".join(f"{c.value:.6f}" for c in law.sigma)
    file.replace(("laser", "error", "sigma"), f"[{sigma}]")
    intervals = [_interval(name, c) for name, c in zip(NAMES, law.coefficients, strict=True)]
    file.head([*provenance, *intervals])
    file.write(out)
    load_model(out)


def _interval(name: str, c: Coefficient) -> str:
    return f"laser.error {name} {c.value:.6f}: {c.low:.6f} to {c.high:.6f}"
