# SPDX-License-Identifier: BSD-3-Clause
"""Times that are not in seconds: told from how often a part was sampled, how long it lasts and how far it got."""

from __future__ import annotations

import numpy as np

from kurumaisu.critic.values.recording import Run, Series

_UNITS = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}
_SLOW = 5.0  # [s] between two rows of what is measured again and again: slower than any reference or laser in use
_NEAR = 0.35  # relative distance of two spans that are the same drive
_MOVED = 0.05  # [m] driven at least, where way asked for and way driven are compared


def problems(run: Run) -> list[str]:
    """Return what is wrong with the units of the times, in words; empty when they can be seconds."""
    parts = {name: getattr(run, name) for name in ("command", "voltage", "pose", "odom", "scan")}
    there = {name: part for name, part in parts.items() if part is not None and len(part.t) > 10}
    told = [_too_slow(run, name, part) for name, part in there.items()]
    found = [line for line in told if line is not None]
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
