# SPDX-License-Identifier: BSD-3-Clause
"""The voltage laws there and back, and what a simulated minute of the chair costs."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import yaml

from kurumaisu import effects
from kurumaisu._core import AxisInverse, AxisLaw, Branch
from kurumaisu.bench.table import Table
from kurumaisu.params import EffectSetting, Model, load_model, shipped
from kurumaisu.sim.plant import Plant
from kurumaisu.types import FloatArray

_LIMIT = 1.0  # [ms] of CPU for a minute at 50 Hz: a fit of the critic needs a thousand of them
_RATE, _MINUTE = 50.0, 60.0  # [Hz], [s]
_SAMPLES = 100_001  # of a round trip's grid of rates
_TOP = 1.5  # [m/s, rad/s] more than the chair can do
_ROUNDING = 1e-12  # [m/s, rad/s]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print both tables. Return 1 if a round trip is inexact or a minute costs more than it may."""
    parser = argparse.ArgumentParser(prog="scripts/bench base", description=__doc__)
    parser.add_argument("--repeats", type=int, default=100, help="of everything that is timed; the median counts")
    options = parser.parse_args(arguments)
    worst = _round_trips(options.repeats)
    dearest = _minutes(options.repeats)
    good = worst < _ROUNDING and dearest <= _LIMIT
    table = Table("What must be kept", "what", "seen", "limit")
    table.row("rate -> volts -> rate, sign known: largest error [m/s, rad/s]", f"{worst:.1e}", f"{_ROUNDING:.0e}")
    table.row("a simulated minute with one effect, the dearest: CPU [ms]", f"{dearest:.2f}", f"{_LIMIT:g}")
    return 0 if good else 1


def _round_trips(repeats: int) -> float:
    """Print the errors of rate -> volts -> rate, and return the largest of those with the sign known."""
    title = f"Rate -> volts -> rate, {_SAMPLES} rates from -{_TOP:g} to {_TOP:g} m/s or rad/s: largest error"
    table = Table(title, "law", "sign known", "sign unknown", "ambiguous [%]", "CPU [ns/rate]", page=False)
    rates = np.linspace(-_TOP, _TOP, _SAMPLES)
    signs, unknown = np.sign(rates), np.full_like(rates, np.nan)
    errors = []
    for name, law in _laws().items():
        volts = law.volts(rates)
        errors.append(_error(law, rates, signs))
        cost = _cpu(AxisInverse(law).rates, (volts, signs), repeats)
        ambiguous = 100 * float(np.mean(law.ambiguous(volts)))
        table.row(name, errors[-1], _error(law, rates, unknown), ambiguous, 1e9 * cost / _SAMPLES)
    return max(errors)


def _laws() -> dict[str, AxisLaw]:
    """Return every shipped law, also those not in use."""
    laws = yaml.safe_load(shipped("launch/md100.yaml").read_text(encoding="utf-8"))["voltage_laws"]
    return {
        f"{name}, {axis}": AxisLaw(Branch(**sides["positive"]), Branch(**sides["negative"]))
        for name, axes in laws.items()
        for axis, sides in axes.items()
    }


def _error(law: AxisLaw, rates: FloatArray, signs: FloatArray) -> float:
    return float(np.max(np.abs(AxisInverse(law).rates(law.volts(rates), signs) - rates)))


def _minutes(repeats: int) -> float:
    """Print the cost of a minute without effects, with each and with all; return the largest with one at most."""
    title = f"Plant, {_MINUTE:g} s at {_RATE:g} Hz from voltages in one chunk"
    table = Table(title, "effects", "CPU [ms]", "of limit [%]", page=False)
    model = load_model(shipped("launch/md100.yaml"))
    settings = {effect.id: _setting(effect) for effect in effects.BASE}
    variants = {"none": (), **{name: (setting,) for name, setting in settings.items()}, "all": tuple(settings.values())}
    costs = {}
    for name, chosen in variants.items():
        costs[name] = 1e3 * _minute(replace(model, effects=chosen), repeats)
        table.row(name, costs[name], 100 * costs[name] / _LIMIT)
    return max(cost for name, cost in costs.items() if name != "all")


def _setting(effect: type[effects.Mechanism]) -> EffectSetting:
    """Return the effect at half its typical size."""
    return EffectSetting(effect.id, {p.name: p.null + 0.5 * p.scale for p in effect.parameters})


def _minute(model: Model, repeats: int) -> float:
    """Return the CPU time [s] of a minute; building the plant counts, as a fit builds one for each try."""
    rng = np.random.default_rng(1)
    count = int(_MINUTE * _RATE)
    held = np.repeat(rng.uniform(-0.8, 0.8, (2, count // 50)), 50, axis=1)  # a new command every second
    v, w = held
    volts = effects.Volts(model.translation.volts(v), model.steering.volts(w), np.sign(v), np.sign(w))

    def simulate() -> None:
        Plant(model, 1 / _RATE, rng).from_voltages(volts)

    return _cpu(simulate, (), repeats)


def _cpu(function: Callable[..., object], arguments: tuple[FloatArray, ...], repeats: int) -> float:
    """Return the median CPU time [s] of a call, after one that does not count."""
    function(*arguments)
    times = []
    for _ in range(repeats):
        start = time.process_time()
        function(*arguments)
        times.append(time.process_time() - start)
    return float(np.median(times))
