# SPDX-License-Identifier: BSD-3-Clause
"""Runs that last longer than their rows can tell of: whatever is worked out on a grid of time would fill the memory."""

from __future__ import annotations

from kurumaisu.critic.base.drive import LONGEST
from kurumaisu.critic.values.digits import moment
from kurumaisu.critic.values.recording import Run

_SPARSE = 10.0  # [s] for each row, on the mean: nothing is recorded as rarely
_ENDLESS = 1e7  # [s] a quarter of a year


def problems(run: Run) -> list[str]:
    """Return what is wrong with how long a run lasts, in words; empty when nothing is."""
    parts = [(name, getattr(run, name)) for name in ("command", "voltage", "pose", "odom", "scan")]
    ends = [(name, float(part.t[0]), float(part.t[-1]), len(part.t)) for name, part in parts if part is not None]
    if not ends:
        return []
    first, last = min(ends, key=lambda end: end[1]), max(ends, key=lambda end: end[2])
    span, rows = last[2] - first[1], sum(count for *_, count in ends)
    if span <= LONGEST or (span <= _SPARSE * rows and span <= _ENDLESS):
        return []
    ends_at = f"from t = {moment(first[1])} of {first[0]} to t = {moment(last[2])} of {last[0]}"
    return [f"lasts {span:.6g} s, {ends_at}, and has {rows} rows: some stamps are wrong, or of another clock"]
