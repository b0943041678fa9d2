# SPDX-License-Identifier: BSD-3-Clause
"""What lies in the folder of a recording, how measured rows come to look real, and what may be wrong with a file."""

from collections.abc import Callable
from pathlib import Path as File

import numpy as np

from kurumaisu.bench.strangers.loch.driver import Noise
from kurumaisu.bench.strangers.loch.laser import Mask
from kurumaisu.bench.strangers.loch.motion import Array, Drive, Path

Table = dict[str, Array]
Tables = dict[str, Table]


def reference(
    d: Drive, clean: Path, noise: Noise, rng: np.random.Generator, asked: Array, plain: bool
) -> tuple[Array, Array, Mask]:
    """Rows of the reference and which are good: jitter, gaps, stutter, rows that are far off, a slow drift."""
    rate = rng.uniform(10, 22)
    t = np.arange(0.02, d.t[-1] - 0.05, 1 / rate)
    t = t + rng.uniform(-0.15, 0.15, len(t)) / rate
    for at in rng.uniform(10, d.t[-1] - 5, int(rng.integers(0, 3))):
        t = t[(t < at) | (t > at + rng.uniform(0.3, 2.0))]
    if rng.random() < 0.25:
        t = np.concatenate([t[t < d.t[-1] / 2], t[t >= d.t[-1] / 2][::2]])
    t = np.unique(np.round(np.concatenate([t, asked]), 4))
    poses = clean.at(t) + rng.normal(size=(len(t), 3)) * [noise.position, noise.position, noise.heading]
    poses[:, :2] += 0.002 * rng.normal() * np.sin(t[:, None] / 20 + rng.uniform(0, 6, 2))
    good = np.ones(len(t), dtype=bool)
    for k in rng.integers(30, len(t) - 30, 0 if plain else int(rng.integers(0, 7))):
        n = int(rng.integers(1, 4))
        if rng.random() < 0.5:
            poses[k : k + n] = poses[k - 1]
        else:
            poses[k : k + n] += np.append(rng.uniform(0.3, 2.0, 2) * rng.choice([-1, 1], 2), rng.normal(0, 0.5))
        good[k : k + n] = False
    return t, poses, good


def commands(d: Drive, volts: bool) -> Tables:
    """The table of commands, or that of voltages with what they stand for."""
    a = np.array(d.rows)
    table = {"t": a[:, 0], "v": a[:, 1], "w": a[:, 2]}
    if not volts or d.law is None:
        return {"command": table}
    return {"voltage": {**table, "v_f": d.law.translation.volts(a[:, 1]), "v_s": d.law.steering.volts(a[:, 2])}}


def columns(n: int, start: float, rng: np.random.Generator) -> Table:
    """Battery, temperatures, seat, supply: as they come along with any drive."""
    t = np.arange(n) * 0.01
    wave = [np.sin(2 * np.pi * t / rng.uniform(20, 70) + rng.uniform(0, 6)) for _ in range(4)]
    return {
        "battery": 25.6 - 0.0006 * (start + t) + 0.05 * wave[0],
        "supply": 5 + 0.15 * wave[3],
        "temperature": 21 + 3 * wave[1] + 0.004 * (start + t),
        "motor_temperature": 40 + 8 * wave[2] + 3 * wave[0],
        "seat_angle": 0.1 * np.repeat(rng.integers(0, 5, n // 900 + 1), 900)[:n],
    }


def write(folder: File, tables: Tables, zero: float) -> None:
    """Writes a drive; times count from zero on."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, table in tables.items():
        times = [k in ("t", "t0", "t1") for k in table]
        body = np.stack([a + zero * at for a, at in zip(table.values(), times, strict=True)], axis=1)
        np.savetxt(
            folder / f"{name}.csv",
            body,
            delimiter=",",
            header=",".join(table),
            comments="",
            fmt=["%.4f" if at else "%.6g" if name in ("scan", "covariate") else "%.6f" for at in times],
        )


def _hold(a: Array) -> Array:
    """A reference that lost its target for a third of the drive and repeats its last pose."""
    i = np.arange(len(a))[:, None]
    return np.where((i > len(a) // 3) & (i < 2 * len(a) // 3), a[len(a) // 3], a)


WRONGS: list[tuple[str, str, str, str, Callable[[Array], Array]]] = [
    ("any", "positions of the reference are in millimetres", "pose", "x y", lambda a: a * 1000),
    ("any", "positions of the reference are in centimetres", "pose", "x y", lambda a: a * 100),
    ("any", "headings are in degrees", "pose", "theta", np.degrees),
    ("any", "the heading of the reference counts clockwise", "pose", "theta", lambda a: -a),
    ("any", "x and y of the reference are swapped", "pose", "x y", lambda a: a[:, ::-1]),
    ("any", "y of the reference has the wrong sign", "pose", "y", lambda a: -a),
    ("any", "the clock of the reference is 3.5 s ahead of that of the commands", "pose", "t", lambda a: a + 3.5),
    (
        "any",
        "the clock of the reference jumps by 4 s in each drive",
        "pose",
        "t",
        lambda a: a + 4.0 * (a > 0.45 * a[-1]),
    ),
    ("any", "the reference stands still for a third of each drive", "pose", "x y theta", _hold),
    ("any", "the poses of the second drive are a copy of those of the first", "copy", "", np.copy),
    ("velocity", "yaw rates asked for are in degrees per second", "command", "w", np.degrees),
    ("velocity", "speeds asked for are in km/h", "command", "v", lambda a: a * 3.6),
    ("velocity", "speeds asked for are in mm/s", "command", "v", lambda a: a * 1000),
    ("velocity", "yaw rates asked for have the wrong sign", "command", "w", lambda a: -a),
    ("velocity", "v and w of the commands are swapped", "command", "v w", lambda a: a[:, ::-1]),
    ("volts", "voltages are in millivolts", "voltage", "v_f v_s", lambda a: a * 1000),
    ("volts", "the reference voltage of 2.5 V is in the voltages", "voltage", "v_f v_s", lambda a: a + 2.5),
    ("laser", "scans are mirrored: beams count from the other side", "scan", "", lambda a: a[:, ::-1]),
    ("laser", "beams count from the middle of the fan on", "scan", "", lambda a: np.roll(a, a.shape[1] // 2, axis=1)),
    ("laser", "ranges are in millimetres", "scan", "", lambda a: a * 1000),
    ("laser", "the laser's clock is 2.5 s ahead", "scan", "t", lambda a: a + 2.5),
    ("laser", "the map is that of another room", "map", "", np.copy),
]


def spoil(drives: dict[str, Tables], sentence: str) -> None:
    """Does what the sentence says to all drives."""
    for _, _, name, keys, change in (w for w in WRONGS if w[1] == sentence):
        for table in (t[name] for t in drives.values() if name in t):
            which = keys.split() or [k for k in table if k != "t"]
            out = change(np.stack([table[k] for k in which], axis=1))
            table.update({k: out[:, i] for i, k in enumerate(which)})
        if name == "copy":
            drives["run_2"]["pose"] = dict(drives["run_1"]["pose"])
