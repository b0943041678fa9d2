# SPDX-License-Identifier: BSD-3-Clause
"""The base ids of the contract: forms to hide them in, sizes to start from, and what a catalogue would call them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.hidden.base import events as ev
from kurumaisu.bench.hidden.base import rates as ra
from kurumaisu.bench.hidden.generator.drives import TOP_V, TOP_W
from kurumaisu.bench.hidden.generator.motion import Fault, Form, Sizes


@dataclass(frozen=True)
class Hidden:
    """An id of the contract. plain: the usual equation; other: another of the same cause, or the same.

    typical: size in its unit; signed: of either sign; most: largest size; extra: draws what else there is;
    names: parameters of the usual equation, from the sizes; scaled: z can be chosen by the size.
    """

    plain: Form
    other: Form
    typical: float
    signed: bool
    most: float
    names: Callable[[Sizes], Sizes]
    extra: Callable[[np.random.Generator], Sizes] = lambda _: {}
    scaled: bool = True

    def draw(self, rng: np.random.Generator) -> Sizes:
        """Return typical sizes with what is random in them; z is set later by scaling `size`."""
        flip = float(rng.choice([-1.0, 1.0])) if self.signed else 1.0
        return {"size": flip * self.typical, **self.extra(rng)}

    def fault(self, sizes: Sizes, form: str) -> Fault:
        """Return the fault of these sizes; form: plain or other."""
        return Fault(self.other if form == "other" else self.plain, sizes)


def _as(name: str) -> Callable[[Sizes], Sizes]:
    return lambda sizes: {name: sizes["size"]}


def _of(stage: str, act: Callable[..., object], other: Callable[..., object] | None = None) -> tuple[Form, Form]:
    return Form(stage, act), Form(stage, other or act)


def _saturation_names(s: Sizes) -> Sizes:
    names = {"inverse_v": 1 / (s["top_v"] * (1 - s["size"])), "inverse_w": 1 / (s["top_w"] * (1 - s["size"]))}
    return {name: value for name, value in names.items() if s["axis"] == 2 or name[-1] == "vw"[int(s["axis"])]}


def _slope_names(s: Sizes) -> Sizes:
    return {"climb_x": s["size"] * float(np.cos(s["bearing"])), "climb_y": s["size"] * float(np.sin(s["bearing"]))}


BASE: dict[str, Hidden] = {
    "base.gain_v": Hidden(*_of("events", ev.gain_v), 0.05, True, 0.6, _as("gain")),
    "base.gain_w": Hidden(*_of("events", ev.gain_w), 0.05, True, 0.6, _as("gain")),
    "base.left_right_gain": Hidden(*_of("events", ev.left_right_gain), 0.05, True, 0.6, _as("asymmetry")),
    "base.veer": Hidden(*_of("events", ev.veer, ev.unequal_wheels), 0.03, True, 0.6, _as("curvature")),
    "base.dead_zone_v": Hidden(*_of("events", ev.dead_zone_v, ev.soft_zone_v), 0.03, False, 0.4, _as("width")),
    "base.dead_zone_w": Hidden(*_of("events", ev.dead_zone_w, ev.soft_zone_w), 0.03, False, 0.3, _as("width")),
    "base.dac_zero_f": Hidden(*_of("volts", ev.dac_zero_f), 0.02, True, 0.3, _as("offset")),
    "base.dac_zero_s": Hidden(*_of("volts", ev.dac_zero_s), 0.02, True, 0.3, _as("offset")),
    "base.dac_quantisation": Hidden(
        *_of("volts", ev.dac_quantisation, ev.dac_truncation),
        0.02,
        False,
        0.06,
        _as("step"),
        lambda rng: {"cut": float(rng.integers(2))},
    ),
    "base.reverse_gain": Hidden(*_of("events", ev.reverse_gain), 0.08, True, 0.6, _as("gain")),
    "base.curvature_v": Hidden(*_of("events", ev.curvature_v, ev.expo_v), 0.1, True, 0.8, _as("curvature")),
    "base.curvature_w": Hidden(*_of("events", ev.curvature_w, ev.expo_w), 0.1, True, 0.8, _as("curvature")),
    "base.lag_v": Hidden(*_of("rates", ra.lag_v, ra.lag2_v), 0.1, False, 2.0, _as("tau")),
    "base.lag_w": Hidden(*_of("rates", ra.lag_w, ra.lag2_w), 0.1, False, 2.0, _as("tau")),
    "base.delay": Hidden(*_of("events", ev.delay), 0.05, False, 0.9, _as("delay")),
    "base.accel_limit": Hidden(
        *_of("rates", ra.accel_limit, ra.soft_accel_limit),
        0.5,
        False,
        15.0,
        lambda s: {"slowness_v": s["size"], "slowness_w": s["size"] * s["ratio"]},
        lambda rng: {"ratio": float(rng.uniform(0.4, 1.2))},
    ),
    "base.saturation": Hidden(
        *_of("events", ev.saturation, ev.soft_saturation),
        0.3,
        False,
        0.9,
        _saturation_names,
        lambda rng: {"axis": float(rng.integers(3)), "top_v": TOP_V, "top_w": TOP_W},
    ),
    "base.battery_sag": Hidden(*_of("floor", ra.battery_sag, ra.battery_decay), 0.001, False, 0.01, _as("sag")),
    "base.understeer": Hidden(*_of("floor", ra.understeer, ra.characteristic_speed), 0.2, True, 1.5, _as("k")),
    "base.lateral_slip": Hidden(*_of("floor", ra.lateral_slip), 0.03, False, 0.5, _as("c")),
    "base.caster_reversal": Hidden(
        *_of("floor", ra.caster_reversal, ra.caster_swing),
        0.15,
        True,
        2.0,
        lambda s: {"kick": s["size"], "length": s["length"]},
        lambda rng: {"length": float(rng.uniform(0.15, 0.4))},
    ),
    # after all that turns the chair: it follows the heading
    "base.slope": Hidden(
        *_of("floor", ra.slope),
        0.02,
        False,
        0.2,
        _slope_names,
        lambda rng: {"bearing": float(rng.uniform(-np.pi, np.pi))},
    ),
    "base.backlash": Hidden(*_of("events", ev.backlash, ev.presliding), 0.03, False, 0.5, _as("play")),
    "base.cross_w_to_v": Hidden(*_of("events", ev.cross_w_to_v), 0.02, True, 0.5, _as("lever")),
    "base.cross_v_to_w": Hidden(*_of("events", ev.cross_v_to_w), 0.02, True, 0.3, _as("share")),
    "base.marker_x": Hidden(*_of("reference", ra.marker_x), 0.02, True, 1.0, _as("x")),
    "base.marker_y": Hidden(*_of("reference", ra.marker_y), 0.02, True, 1.0, _as("y")),
    "base.clock_scale": Hidden(*_of("reference", ra.clock_scale), 0.001, True, 0.1, _as("scale")),
    "base.payload": Hidden(
        *_of("rates", ra.payload, ra.payload2),
        0.05,
        False,
        0.5,
        lambda s: {"droop": s["size"], "tau": s["ratio"] * s["size"]},
        lambda rng: {"ratio": float(rng.uniform(1.5, 3.0))},
    ),
    "base.process_noise": Hidden(*_of("spread", ra.rate_noise), 1.0, False, 4.0, lambda _: {}),
    "base.sign": Hidden(
        *_of("events", ev.sign), 1.0, False, 1.0, lambda _: {}, lambda rng: {"kind": float(rng.integers(4))}, False
    ),
    "base.steering_law": Hidden(*_of("volts", ev.steering_law), 1.0, False, 1.0, lambda _: {"flip": 1.0}, scaled=False),
}
