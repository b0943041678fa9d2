# SPDX-License-Identifier: BSD-3-Clause
"""Simple critics to compare with: an afternoon's work each. All take rates by differences of poses as i.i.d."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from kurumaisu.bench.hidden.generator import laws
from kurumaisu.critic.values.recording import Recording, Run
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import FloatArray

_LEVEL = 0.01  # of false alarms that a test allows itself, over all its columns


@dataclass(frozen=True)
class Rows:
    """Residual rates of v, u, w stacked and weighted, (3 n,), and columns by id, (3 n, k)."""

    y: FloatArray
    columns: dict[str, FloatArray]


def always_none(recording: Recording) -> frozenset[str]:
    """Name nothing, whatever the data."""
    return frozenset()


def iid_bic(recording: Recording) -> frozenset[str]:
    """Add the id that lowers the BIC of a regression most, until none does: sparse identification of the residual."""
    rows = _rows(recording)
    n, chosen = len(rows.y), list[str]()
    best = n * np.log(_rest(rows, chosen) / n)
    while len(chosen) < 5:
        scores = {
            name: n * np.log(_rest(rows, [*chosen, name]) / n) + np.log(n) * _width(rows, [*chosen, name])
            for name in rows.columns
            if name not in chosen
        }
        name = min(scores, key=lambda name: scores[name])
        if scores[name] >= best:
            break
        best, chosen = scores[name], [*chosen, name]
    return frozenset(chosen)


def marginal_correlation(recording: Recording) -> frozenset[str]:
    """Name the id whose column correlates most with the residual, if that is significant."""
    rows = _rows(recording)
    total = float(rows.y @ rows.y)
    z = {name: np.sqrt(max(1 - _rest(rows, [name]) / total, 0.0) * len(rows.y)) for name in rows.columns}
    name = max(z, key=lambda name: z[name])
    return frozenset([name] if z[name] > norm.isf(_LEVEL / 2 / len(z)) else [])


def fit_everything(recording: Recording) -> frozenset[str]:
    """Fit all ids at once and name those that are significant."""
    rows = _rows(recording)
    names = [name for name in rows.columns for _ in range(rows.columns[name].shape[1])]
    x = np.column_stack(list(rows.columns.values()))
    inverse = np.linalg.pinv(x.T @ x, rcond=1e-10, hermitian=True)
    fit = inverse @ (x.T @ rows.y)
    variance = float(((rows.y - x @ fit) ** 2).sum()) / (len(rows.y) - x.shape[1])
    t = np.abs(fit) / np.sqrt(variance * np.maximum(np.diag(inverse), 1e-30))
    limit = norm.isf(_LEVEL / 2 / len(names))
    return frozenset(name for name, value in zip(names, t, strict=True) if value > limit)


BASELINES: dict[str, Callable[[Recording], frozenset[str]]] = {
    "always none": always_none,
    "i.i.d. BIC": iid_bic,
    "marginal correlation": marginal_correlation,
    "fit everything": fit_everything,
}


def _rest(rows: Rows, names: list[str]) -> float:
    if not names:
        return float(rows.y @ rows.y)
    x = np.column_stack([rows.columns[name] for name in names])
    fit = np.linalg.lstsq(x, rows.y, rcond=None)[0]
    return float(((rows.y - x @ fit) ** 2).sum())


def _width(rows: Rows, names: list[str]) -> int:
    return sum(rows.columns[name].shape[1] for name in names)


def _rows(recording: Recording) -> Rows:
    """Return residuals and columns of all runs, each channel in units of its own spread."""
    parts = [_run(run) for run in recording.runs if run.pose is not None and run.command is not None]
    y = np.concatenate([part[0] for part in parts])
    spread = SIGMA_PER_MAD * np.median(np.abs(y), axis=0) + 1e-9
    columns = {name: np.concatenate([part[1][name] for part in parts]) / spread[:, None] for name in parts[0][1]}
    return Rows((y / spread).ravel(), {name: c.reshape(-1, c.shape[2]) for name, c in columns.items()})


def _run(run: Run) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return residual rates (n, 3) of a run, and columns by id (n, 3, k)."""
    assert run.pose is not None
    assert run.command is not None
    t, poses = run.pose.t, run.pose.values
    dt = np.diff(t)
    d = np.diff(poses, axis=0)
    middle = (poses[:-1, 2] + poses[1:, 2]) / 2
    c, s = np.cos(middle), np.sin(middle)
    rates = np.stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0], d[:, 2]], axis=1) / dt[:, None]
    v, w = (_mean(run.command.t, run.command.column(name), t) for name in ("v", "w"))
    return rates - np.stack([v, 0 * v, w], axis=1), _columns(v, w, t[:-1] + dt / 2, dt, middle)


def _mean(times: FloatArray, values: FloatArray, edges: FloatArray) -> FloatArray:
    knots = np.append(times, max(edges[-1], times[-1]) + 1.0)
    sums = np.concatenate([[0.0], np.cumsum(values * np.diff(knots))])
    return np.asarray(np.diff(np.interp(edges, knots, sums)) / np.diff(edges))


def _columns(v: FloatArray, w: FloatArray, t: FloatArray, dt: FloatArray, heading: FloatArray) -> dict[str, FloatArray]:
    """Return what a unit of each id does to the rates, to first order."""
    zero = np.zeros_like(v)
    rise_v, rise_w = np.gradient(v) / dt, np.gradient(w) / dt
    moving = ((v != 0) | (w != 0)).astype(float)
    per_volt_v = 1 / laws.branch(np.sign(v), laws.TRANSLATION)[0]
    per_volt_w = 1 / laws.branch(np.sign(w), laws.STEERING)[0]
    way = np.sign(w - np.concatenate([[0.0], w[:-1]]))
    index = np.maximum.accumulate(np.where(way != 0, np.arange(len(w)), 0))

    def column(*channels: FloatArray) -> FloatArray:
        return np.stack(channels, axis=1)[:, :, None]

    return {
        "base.gain_v": column(v, zero, zero),
        "base.gain_w": column(zero, zero, w),
        "base.left_right_gain": column(zero, zero, np.abs(w)),
        "base.veer": column(zero, zero, v),
        "base.dead_zone_v": column(-np.sign(v) * np.abs(per_volt_v), zero, zero),
        "base.dead_zone_w": column(zero, zero, -np.sign(w) * np.abs(per_volt_w)),
        "base.dac_zero_f": column((v != 0) * per_volt_v, zero, zero),
        "base.dac_zero_s": column(zero, zero, (w != 0) * per_volt_w),
        "base.reverse_gain": column(np.minimum(v, 0.0), zero, zero),
        "base.curvature_v": column(-v * np.abs(v), zero, zero),
        "base.curvature_w": column(zero, zero, -w * np.abs(w)),
        "base.lag_v": column(-rise_v, zero, zero),
        "base.lag_w": column(zero, zero, -rise_w),
        "base.delay": column(-rise_v, zero, -rise_w),
        "base.battery_sag": column(-t * v, zero, -t * w),
        "base.understeer": column(zero, zero, -(v**2) * w),
        "base.lateral_slip": column(zero, -v * w, zero),
        "base.slope": np.concatenate(
            [column(-moving * np.cos(heading), zero, zero), column(-moving * np.sin(heading), zero, zero)], axis=2
        ),
        "base.backlash": column(zero, zero, -moving * way[index]),
        "base.cross_w_to_v": column(w, zero, zero),
        "base.cross_v_to_w": column(zero, zero, laws.volts(v, laws.TRANSLATION) * per_volt_w),
        "base.marker_x": column(zero, w, zero),
        "base.clock_scale": column(-t * rise_v - v, zero, -t * rise_w - w),
        "base.payload": column(-v - 2 * rise_v, zero, -w - 2 * rise_w),
    }
