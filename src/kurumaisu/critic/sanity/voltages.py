# SPDX-License-Identifier: BSD-3-Clause
"""Voltages that are not volts, hold the reference, or are the numbers that the D/A converter was sent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.critic.sanity.input_match import shifted
from kurumaisu.critic.sanity.rates import STEP, Rates, of_input
from kurumaisu.critic.values.recording import Series
from kurumaisu.params import Model
from kurumaisu.types import FloatArray

_MOST = 30.0  # [V] no joystick input of a wheelchair takes more
_LAGS = np.arange(0.0, 1.6, 0.1)  # [s]
_ALIKE = 0.6  # least correlation of the voltage with the one expected
_FOLLOWS = 0.5  # correlation of the rates with those that the voltages ask for, from which no sign is wrong
_NAMES = ("v_f", "v_s")


@dataclass(frozen=True)
class _Line:
    """Voltage given = offset + factor * voltage expected, and the correlation of both."""

    offset: float
    factor: float
    correlation: float


def problems(voltage: Series, driven: Rates, model: Model, follows: FloatArray) -> list[str]:
    """Return what is wrong with unit or zero of the voltages, in words; driven: what the chair made of them.

    follows (2,): correlation of that with what the voltages ask for. Where two rates answer to one voltage, that of a
    rate which lags, or of a mean, may have the other sign.
    """
    given = of_input(voltage.t, voltage.values[:, :2], driven.t)
    laws = model.translation, model.steering
    told = []
    for i, law in enumerate(laws):
        rates = np.nan_to_num(driven.values[:, i])
        expected = np.where(
            np.isfinite(driven.values[:, i]), law.volts(np.where(abs(rates) < 0.02, 0.0, rates)), np.nan
        )
        line = _line(given.values[:, i], expected)
        found = _wrong(_NAMES[i], voltage.values[:, i], line, model.reference_voltage, bool(follows[i] > _FOLLOWS))
        if found is not None:
            told.append(found)
    return told


def _line(given: FloatArray, expected: FloatArray) -> _Line:
    """Return the line at the lag at which both are most alike."""
    best = _Line(float(np.nanmedian(given)), float("nan"), 0.0)
    for lag in _LAGS:
        early = shifted(given[:, None], round(lag / STEP))[:, 0]
        good = np.isfinite(early) & np.isfinite(expected)
        a, b = expected[good], early[good]
        if len(a) < 50 or a.std() < 0.02 or b.std() == 0:
            continue
        alike = float(np.corrcoef(a, b)[0, 1])
        if abs(alike) > abs(best.correlation):
            factor, offset = np.polyfit(a, b, 1)
            best = _Line(float(offset), float(factor), alike)
    return best


def _wrong(name: str, raw: FloatArray, line: _Line, reference: float, follows: bool) -> str | None:
    largest = float(np.abs(raw).max())
    known = abs(line.correlation) > _ALIKE
    measured = (
        f"{abs(line.factor):.4g} per volt expected, {line.offset:.4g} at 0 V" if known else f"up to {largest:.4g}"
    )
    if largest > _MOST:
        millivolts = known and abs(np.log(abs(line.factor) / 1000)) < 0.4
        whole = bool((raw == np.round(raw)).all())
        if whole and not (millivolts and abs(line.offset) < 300):
            return f"{name} looks like D/A counts: whole numbers, {measured}; try (counts - zero) / counts per volt"
        if abs(line.offset) < 300 or not known:
            return f"{name} looks like mV, not V: {measured}; try {name} / 1000"
        return f"{name} looks like mV, reference voltage included: {measured}; try ({name} - {line.offset:.0f}) / 1000"
    if line.correlation < -_ALIKE and not follows:
        alike = f"correlation {line.correlation:.2f} with the expected voltage"
        return (
            f"{name} has the wrong sign ({'forward speed' if name == _NAMES[0] else 'yaw rate'}): {alike}; try -{name}"
        )
    middle = line.offset if known else float(np.median(raw))
    if abs(middle) > 0.5 * reference and abs(middle) > 0.8:
        return (
            f"{name} seems to include the reference voltage: it is {middle:.3g} V where 0 V is expected (the model's "
            f"reference: {reference:g} V); try {name} - {reference:g}"
        )
    return None
