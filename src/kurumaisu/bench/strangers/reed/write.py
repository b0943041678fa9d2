# SPDX-License-Identifier: BSD-3-Clause
"""Tables of a recording, with the habits of real references."""

from __future__ import annotations

from pathlib import Path as File

import numpy as np

from kurumaisu.bench.strangers.reed.core import DT, STEERING, TRANSLATION, Array, Drive, Noise, volts

Tables = dict[str, tuple[list[str], Array]]


def stamps_of(rng: np.random.Generator, seconds: float, rate: float, extra: Array) -> Array:
    """Stamps of a reference on the grid: uneven, with gaps; extra ones are kept."""
    t = np.arange(0.4, seconds - 0.4, 1 / rate)
    t = t + rng.normal(size=len(t)) * 0.1 / rate * float(rng.random() < 0.6)
    keep = np.ones(len(t), dtype=bool)
    for _ in range(int(rng.integers(0, 4))):
        begin = rng.uniform(5, seconds - 5)
        keep &= ~((t > begin) & (t < begin + rng.uniform(0.3, 1.5)))
    if rng.random() < 0.3:
        keep &= rng.random(len(t)) > 0.05
    return np.asarray(np.unique(np.round(np.concatenate([t[keep], extra]) / DT).astype(int)) * DT)


def measure(rng: np.random.Generator, rows: Array, stamps: Array, noise: Noise) -> Array:
    """Errors of a reference: white ones, and a slow drift."""
    err = rng.normal(size=rows.shape) * np.array([noise.pos, noise.pos, noise.head])
    for k in range(2):
        err[:, k] += noise.drift * np.sin(2 * np.pi * stamps / rng.uniform(80, 200) + rng.uniform(0, 6))
    return np.asarray(rows + err)


def spoil(rng: np.random.Generator, table: Array, spared: Array) -> Array:
    """Rows that are far off, that stutter, that come twice; spared stamps are left alone."""
    out, free = table.copy(), np.flatnonzero(~np.isin(table[:, 0], spared))
    for k in rng.choice(free, size=int(rng.integers(0, 1 + len(free) // 250)), replace=False):
        out[k, 1:3] += rng.normal(size=2) * rng.uniform(0.1, 1.5)
    for k in rng.choice(free[1:], size=int(rng.integers(0, 3)), replace=False):
        out[k, 1:] = out[k - 1, 1:]
    if rng.random() < 0.4:
        twice = np.sort(rng.choice(free, size=max(1, len(free) // 300), replace=False))
        out = np.insert(out, twice, out[twice], axis=0)
    return out


def command_table(drive: Drive, electric: bool) -> Tables:
    """Commands, or the voltages that stand for them."""
    at = drive.ticks
    t, v, w = at * DT, drive.v[at], drive.w[at]
    if not electric:
        return {"command": (["t", "v", "w"], np.stack([t, v, w], axis=1))}
    pair = [np.round(volts(v, TRANSLATION), 6), np.round(volts(w, STEERING[drive.law]), 6)]
    return {"voltage": (["t", "v_f", "v_s", "v", "w"], np.stack([t, *pair, v, w], axis=1))}


def covariate_table(rng: np.random.Generator, drive: Drive, names: list[str]) -> Tables:
    """Columns once a second."""
    at = np.arange(0, len(drive.v), int(1 / DT))
    columns = [np.round(drive.columns[name][at] + rng.normal(size=len(at)) * 1e-3, 4) for name in names]
    return {"covariate": (["t", *names], np.stack([at * DT, *columns], axis=1))}


def scan_table(stamps: Array, readings: Array) -> Tables:
    """Scans, a column per beam."""
    header = ["t", *[f"r{k}" for k in range(readings.shape[1])]]
    return {"scan": (header, np.concatenate([stamps[:, None], readings], axis=1))}


def _cell(value: float, digits: int) -> str:
    """A number as text."""
    return f"{value:.{digits}f}" if np.isfinite(value) else ("nan" if np.isnan(value) else "inf")


def save(folder: File, tables: Tables, epoch: float) -> None:
    """Write the tables of a drive; times become Unix times."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (header, rows) in tables.items():
        digits = 3 if name == "scan" else 6
        times = 2 if name == "query" else 1
        lines = [",".join(header)]
        for row in rows.tolist():
            lines.append(",".join([_cell(x + epoch, 6) for x in row[:times]] + [_cell(x, digits) for x in row[times:]]))
        (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
