# SPDX-License-Identifier: BSD-3-Clause
"""Times that are not in seconds, runs that last too long, and voltages that are not volts or hold the reference.

A chair with another voltage law than the model's turns by other rates: what no unit explains as well.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import GRID, LONGEST, prepare
from kurumaisu.critic.rates import mean_rates
from kurumaisu.critic.rates.mean_rates import STEP, Rates, of_input
from kurumaisu.critic.sanity import input_match
from kurumaisu.critic.sanity.input_match import Line, Match, line, shifted
from kurumaisu.critic.values.digits import moment
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

_MOST = 30.0  # [V] no joystick input of a wheelchair takes more
_LAGS = np.arange(0.0, 1.6, 0.1)  # [s]
_CHANGES = 0.02  # [V] sd of an expected voltage below which it says nothing
_ALIKE = 0.6  # least correlation of the voltage with the one expected
_FOLLOWS = 0.5  # correlation of the rates with those that the voltages ask for, from which no sign is wrong
_NAMES = ("v_f", "v_s")
_ABOUT_ONE = (0.5, 2.0)  # factors between the rates by another law and those driven that leave no unit to blame
_PARTS = ("command", "voltage", "pose", "odom", "scan")
_UNITS = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}
_SLOW = 5.0  # [s] between two rows of what is measured again and again: slower than any reference or laser in use
_NEAR = 0.35  # relative distance of two spans that are the same drive
_MOVED = 0.05  # [m] driven at least, where way asked for and way driven are compared
_SPARSE = 10.0  # [s] for each row, on the mean: nothing is recorded as rarely
_ENDLESS = 1e7  # [s] a quarter of a year


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
        fitted = _line(given.values[:, i], expected)
        found = _wrong(_NAMES[i], voltage.values[:, i], fitted, model.reference_voltage, bool(follows[i] > _FOLLOWS))
        if found is not None:
            told.append(found)
    return told


def _line(given: FloatArray, expected: FloatArray) -> Line:
    """Return the line of the voltage given over the one expected, at the lag at which both are most alike."""
    lines = [line(expected, shifted(given[:, None], round(lag / STEP))[:, 0], _CHANGES) for lag in _LAGS]
    best = max(lines, key=lambda one: abs(one.correlation))
    return best if best.correlation else Line(0.0, np.nan, float(np.nanmedian(given)))


def _wrong(name: str, raw: FloatArray, fitted: Line, reference: float, follows: bool) -> str | None:
    largest = float(np.abs(raw).max())
    known = abs(fitted.correlation) > _ALIKE
    measured = (
        f"{abs(fitted.factor):.4g} per volt expected, {fitted.offset:.4g} at 0 V" if known else f"up to {largest:.4g}"
    )
    if largest > _MOST:
        millivolts = known and abs(np.log(abs(fitted.factor) / 1000)) < 0.4
        whole = bool((raw == np.round(raw)).all())
        if whole and not (millivolts and abs(fitted.offset) < 300):
            return f"{name} looks like D/A counts: whole numbers, {measured}; try (counts - zero) / counts per volt"
        if abs(fitted.offset) < 300 or not known:
            return f"{name} looks like mV, not V: {measured}; try {name} / 1000"
        return (
            f"{name} looks like mV, reference voltage included: {measured}; try ({name} - {fitted.offset:.0f}) / 1000"
        )
    if fitted.correlation < -_ALIKE and not follows:
        alike = f"correlation {fitted.correlation:.2f} with the expected voltage"
        return (
            f"{name} has the wrong sign ({'forward speed' if name == _NAMES[0] else 'yaw rate'}): {alike}; try -{name}"
        )
    middle = fitted.offset if known else float(np.median(raw))
    if abs(middle) > 0.5 * reference and abs(middle) > 0.8:
        return (
            f"{name} seems to include the reference voltage: it is {middle:.3g} V where 0 V is expected (the model's "
            f"reference: {reference:g} V); try {name} - {reference:g}"
        )
    return None


def match(run: Run, name: str, plain: Match, driven: Rates, model: Model) -> Match:
    """Return the match of an input by whichever law of the catalogue explains more, where plain has factors of units.

    Of the laws that a chair has or has not; what has a size is fitted later.
    """
    if all(_ABOUT_ONE[0] < abs(factor) < _ABOUT_ONE[1] for factor in plain.factor if np.isfinite(factor)):
        return plain
    others = [input_match.compare(asked, driven, name) for asked in _rates(run, driven, model)]
    known = [(one, one.factor[one.correlation != 0]) for one in others]  # as far as both channels are driven
    low, high = _ABOUT_ONE
    lawful = [one for one, factors in known if len(factors) and np.all((factors > low) & (factors < high))]
    return max((plain, *lawful), key=lambda one: float(np.abs(one.correlation).sum()))


def _rates(run: Run, driven: Rates, model: Model) -> Iterator[Rates]:
    """Yield the rates of a simulated chair by each of the other laws, as means about the same times."""
    drive = prepare(run, model)
    times = drive.start + GRID * np.arange(len(drive.v))
    for effect in effects.of_base(voltages=model.robot.voltages):
        for choice in effect.choices if issubclass(effect, effects.VoltageEffect) else ():
            motion = replay.motion(drive, model, [EffectSetting(effect.id, dict(choice))])
            yield mean_rates.of_input(times, np.column_stack([motion.v, motion.w]), driven.t)


def untimely(run: Run) -> list[str]:
    """Return what is wrong with the units of the times, in words; empty when they can be seconds."""
    there = {name: part for name, part in run.parts(*_PARTS).items() if len(part.t) > 10}
    told = [_too_slow(run, name, part) for name, part in there.items()]
    found = [words for words in told if words is not None]
    return found or _spans_apart(there)


def _too_slow(run: Run, name: str, part: Series) -> str | None:
    """Tell of a part whose rows are so far apart that a smaller unit is likelier."""
    step = float(np.median(np.diff(part.t)))
    if step < _SLOW or name in ("command", "voltage"):
        return None
    unit = min((unit for unit in _UNITS if step / unit < _SLOW), default=None)
    if unit is None or not _too_far(run, unit):
        return None
    return (
        f"times of {name} look like {_UNITS[unit]}: its rows are {step:.4g} apart, which would be {step / unit:.3g} s; "
        f"try t / {unit:.0f}"
    )


def _too_far(run: Run, unit: float) -> bool:
    """Tell whether the inputs do not ask for a way a hundredth as long when times are in seconds; True if unknown."""
    if run.command is None or run.pose is None:
        return True
    speeds = np.abs(run.command.values[:-1, :2]).sum(axis=1)
    asked = float(speeds @ np.diff(run.command.t))
    steps = np.abs(np.diff(run.pose.values[:, :3], axis=0))
    return asked <= _MOVED or asked > 10 * float(steps.sum()) or _span(run.pose) > unit / 30 * _span(run.command)


def _spans_apart(there: dict[str, Series]) -> list[str]:
    """Tell of parts that last a power of a thousand longer than another."""
    names = list(there)
    for longer in names:
        for shorter in names:
            ratio = _span(there[longer]) / max(_span(there[shorter]), 1e-9)
            for unit, unit_name in _UNITS.items():
                if abs(np.log(ratio / unit)) < _NEAR and _span(there[shorter]) > 1.0:
                    return [
                        f"times of {longer} look like {unit_name}: it lasts {ratio:.4g} times as long as {shorter}; "
                        f"try t / {unit:.0f}"
                    ]
    return []


def _span(part: Series) -> float:
    return float(part.t[-1] - part.t[0])


def endless(run: Run) -> list[str]:
    """Return what is wrong with how long a run lasts, in words; empty when nothing is."""
    ends = [(n, float(part.t[0]), float(part.t[-1]), len(part.t)) for n, part in run.parts(*_PARTS).items()]
    if not ends:
        return []
    first, last = min(ends, key=lambda end: end[1]), max(ends, key=lambda end: end[2])
    span, rows = last[2] - first[1], sum(count for *_, count in ends)
    if span <= LONGEST or (span <= _SPARSE * rows and span <= _ENDLESS):
        return []
    ends_at = f"from t = {moment(first[1])} of {first[0]} to t = {moment(last[2])} of {last[0]}"
    return [f"lasts {span:.6g} s, {ends_at}, and has {rows} rows: some stamps are wrong, or of another clock"]
