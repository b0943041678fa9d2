# SPDX-License-Identifier: BSD-3-Clause
"""The laser's and the world's ids of the contract: forms, typical sizes, and what a catalogue would call them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.hidden.generator.motion import Fault, Form, Sizes
from kurumaisu.bench.hidden.laser import forms as lf
from kurumaisu.bench.hidden.laser import outliers as lo

Extra = Callable[[np.random.Generator], Sizes]
Names = Callable[[Sizes], Sizes]


@dataclass(frozen=True)
class HiddenLaser:
    """An id of the contract, as base_catalogue.Hidden.

    by: 'mean' where a size is scaled to a z of the mean readings, else 'typical': sizes as they occur, since a
    hundred thousand readings show changes of their spread that matter to nobody; moving: shows only while driving.
    names: of form plain; other_names: of form other, where it has other parameters. Another equation's number is the
    truth of a catalogue's parameter only if both say the same about the readings, at some range or angle at least: an
    interval of a gain cannot hold the width of a footprint.
    """

    plain: Form
    other: Form
    typical: float
    signed: bool
    names: Names
    extra: Extra = lambda _: {}
    by: str = "mean"
    moving: bool = False
    around: tuple[float, float] = (0.6, 2.5)  # of the typical size, what occurs
    other_names: Names | None = None

    def draw(self, rng: np.random.Generator) -> Sizes:
        """Return sizes: typical ones for z to scale, or ones that occur."""
        size = self.typical
        if self.by != "mean":
            size *= float(np.exp(rng.uniform(*np.log(self.around))))
        return {"size": size * (float(rng.choice([-1.0, 1.0])) if self.signed else 1.0), **self.extra(rng)}

    def called(self, sizes: Sizes, form: str) -> Sizes:
        """Return what a catalogue would call the sizes, of those that it has a word for."""
        return (self.other_names if form == "other" and self.other_names else self.names)(sizes)

    def fault(self, sizes: Sizes, form: str) -> Fault:
        """Return the fault of these sizes; form: plain or other."""
        return Fault(self.other if form == "other" else self.plain, sizes)


def _as(name: str) -> Names:
    return lambda sizes: {name: sizes["size"]}


def _between(name: str, low: float, high: float) -> Extra:
    return lambda rng: {name: float(rng.uniform(low, high))}


def _nothing(_: Sizes) -> Sizes:
    return {}


def _of_both_sides(sizes: Sizes) -> Sizes:
    """Return the share of the beams beside a jump: only those before it are mixed here."""
    return {"probability": 0.5 * sizes["size"]}


def _seed(rng: np.random.Generator) -> Sizes:
    return {"seed": float(rng.integers(2**31))}


def _of(stage: str, act: Callable[..., object], other: Callable[..., object] | None = None) -> tuple[Form, Form]:
    return Form(stage, act), Form(stage, other or act)


def _tilt_names(s: Sizes) -> Sizes:
    """Return pitch and roll, the roll not negative: ranges to walls are the same with both turned round."""
    size = s["size"] * (1.0 if np.sin(s["bearing"]) >= 0 else -1.0)
    return {"pitch": size * float(np.cos(s["bearing"])), "roll": size * float(np.sin(s["bearing"]))}


_cyclic = _of("bias", lf.cyclic, lf.triangle)
LASER: dict[str, HiddenLaser] = {
    "laser.offset": HiddenLaser(*_of("bias", lf.offset), 0.01, True, _as("offset")),
    "laser.scale": HiddenLaser(*_of("bias", lf.scale), 0.005, True, _as("scale")),
    "laser.quadratic": HiddenLaser(*_of("bias", lf.quadratic, lf.power), 0.002, True, _as("quadratic")),
    "laser.warmup": HiddenLaser(
        *_of("bias", lf.warmup, lf.warmup2),
        0.01,
        True,
        lambda s: {"amplitude": s["size"], "tau": s["tau"]},
        _between("tau", 250.0, 900.0),
    ),
    "laser.temperature": HiddenLaser(*_of("bias", lf.by_temperature), 0.0005, True, _as("coefficient")),
    "laser.cyclic": HiddenLaser(
        *_cyclic,
        0.003,
        False,
        lambda s: {"amplitude": s["size"], "wavelength": s["wavelength"]},
        lambda rng: {"wavelength": float(rng.uniform(0.7, 2.0)), "phase": float(rng.uniform(-np.pi, np.pi))},
    ),
    "laser.incidence_bias": HiddenLaser(*_of("bias", lf.incidence_bias, lf.footprint_bias), 0.003, True, _as("k")),
    "laser.incidence_noise": HiddenLaser(
        *_of("sd", lf.incidence_noise, lf.footprint_noise),
        0.6,
        False,
        _as("gain"),
        by="typical",
        other_names=_nothing,  # the size is then a footprint's width, whose noise grows with the range, too
    ),
    "laser.reflectance": HiddenLaser(
        *_of("bias", lf.reflectance), 0.02, True, lambda s: {"bias": s["size"]}, lambda _: {"noise": 0.0}
    ),
    "laser.mixed_pixels": HiddenLaser(
        *_of("outlier", lo.mixed_pixels, lo.weighted_pixels), 0.35, False, _of_both_sides, _seed, by="typical"
    ),
    "laser.beam_bias": HiddenLaser(
        *_of("bias", lf.mirror, lf.beam_offsets),
        0.003,
        False,
        lambda s: {"amplitude": s["size"]},
        lambda rng: {"phase": float(rng.uniform(-np.pi, np.pi)), **_seed(rng)},
        other_names=_as("sd"),  # of offsets that follow no mirror
    ),
    "laser.common_mode": HiddenLaser(
        *_of("unit", lf.common_mode),
        0.0006,
        False,
        lambda s: {"sd": s["size"], "rho": s["rho"]},
        lambda rng: {"rho": float(rng.uniform(0.0, 0.95)), **_seed(rng)},
        by="typical",
    ),
    "laser.beam_correlation": HiddenLaser(
        *_of("unit", lf.beam_correlation, lf.smeared), 0.3, False, _as("rho"), by="typical"
    ),
    "laser.heavy_tails": HiddenLaser(
        *_of("unit", lf.student, lf.contaminated),
        0.15,
        False,
        _as("inverse_nu"),
        _seed,
        by="typical",
        other_names=_nothing,  # the size is then a share of wild readings: no t has their tails
    ),
    "laser.dropout": HiddenLaser(
        *_of("outlier", lo.dropout),
        0.04,
        False,
        _as("probability"),
        lambda rng: {"far": float(rng.choice([0, 1])), "oblique": float(rng.choice([0, 1])), **_seed(rng)},
        by="typical",
    ),
    "laser.quantisation": HiddenLaser(
        *_of("grid", lo.quantisation, lo.floored), 0.006, False, _as("step"), by="typical"
    ),
    "laser.range_noise": HiddenLaser(
        *_of("sd", lf.range_noise, lf.noise_per_metre), 0.4, False, _as("share"), by="typical"
    ),
    "laser.mount_x": HiddenLaser(*_of("aim", lf.mount), 0.02, True, _as("x"), lambda _: {"axis": 0.0}),
    "laser.mount_y": HiddenLaser(*_of("aim", lf.mount), 0.02, True, _as("y"), lambda _: {"axis": 1.0}),
    "laser.mount_yaw": HiddenLaser(*_of("aim", lf.mount), 0.01, True, _as("yaw"), lambda _: {"axis": 2.0}),
    "laser.tilt": HiddenLaser(*_of("aim", lf.tilt), 0.04, False, _tilt_names, _between("bearing", -np.pi, np.pi)),
    "laser.latency": HiddenLaser(*_of("aim", lf.latency), 0.02, True, _as("delay"), moving=True),
    "laser.clock_skew": HiddenLaser(*_of("aim", lf.clock_skew), 0.0005, True, _as("skew"), moving=True),
    "laser.sweep": HiddenLaser(*_of("aim", lf.sweep), 0.2, True, _as("stretch"), moving=True),
    "laser.crosstalk": HiddenLaser(
        *_of("outlier", lo.crosstalk),
        0.15,
        False,
        _as("probability"),
        lambda rng: {"width": float(rng.uniform(0.2, 0.6)), "drift": float(rng.uniform(-1, 1)), **_seed(rng)},
        by="typical",
    ),
    "laser.saturation": HiddenLaser(
        *_of("outlier", lo.saturation), 0.36, False, _as("inverse_far"), by="typical", around=(0.8, 1.2)
    ),
    "world.map_error": HiddenLaser(*_of("aim", lf.map_jitter, lf.map_shift), 0.005, False, _as("sd"), _seed),
}
