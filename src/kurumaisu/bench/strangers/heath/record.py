# SPDX-License-Identifier: BSD-3-Clause
"""The files of a recording: tables with their defects, queries and their answers."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .chair import DT, LAW_V, LAW_W, Hidden, Run, coloured, drift, drive, model, pose, reference, volts
from .laser import look, read
from .scene import ON_LASER
from .score import H, Noise, advance, kalman

Array = NDArray[Any]
Table = tuple[list[str], Array]
Tables = list[dict[str, Table]]
SHOWN = {
    "extra": (("humidity", "tyre_pressure", "motor_current", "load_cell", "lamp"), 50.0, 10.0),
    "temperature": (("temperature",), 0.0, 1.0),
    "decoy": (("fan_speed", "cpu", "noise_level"), 3.0, 0.5),
}


def measure(run: Run, noise: Noise, causes: list[Hidden], rate: float, rng: np.random.Generator) -> SimpleNamespace:
    """Return the reference's rows: stamps, true and seen poses, and what the causes that sit in it add."""
    uneven = rng.uniform(0, 0.3) * rng.uniform(-1, 1, int(run.length * rate * 1.5) + 5)
    t = (1 + uneven).cumsum() / rate + rng.uniform(0, 0.1)
    if rng.random() < 0.3:
        t = np.concatenate([t, *(a + np.arange(1, 9) * 0.0021 for a in rng.uniform(2, run.length - 2, 3))])
    for a in rng.uniform(4, run.length - 4, int(rng.integers(1, 3)) if rng.random() < 0.4 else 0):
        t = t[(t < a) | (t > a + rng.uniform(0.6, 3))]
    t = np.unique(np.round(t[t < run.length - 0.02], 6))
    true, kept = pose(run, t), reference(run, causes, t)
    k, count = np.round(t / DT).astype(int), int(run.length / DT) + 2
    slow = np.stack([coloured(rng, count, noise.tau_c)[k] for _ in range(3)], -1)
    error = np.sqrt(1 - noise.share) * rng.standard_normal(kept.shape) + np.sqrt(noise.share) * slow
    return SimpleNamespace(t=t, true=true, added=kept - true, seen=np.round(kept + np.sqrt(noise.rows()) * error, 6))


def residuals(run: Run, rows: SimpleNamespace, causes: list[Hidden]) -> Array:
    """Return measured less expected poses (rows, 3, 2), linear in the errors: by the model, and by the true causes."""
    return np.stack(
        [rows.seen - rows.true - drift(run, known, rows.t) - (rows.added if known else 0) for known in ([], causes)], -1
    )


def _ahead(run: Run, known: list[Hidden], tau: float, at: Array, x: Array, t0: float, t1: float) -> Array:
    m, cells = model(run, known, run.path.middle), slice(int(t0 / DT), int(t1 / DT) + 1)
    edges = np.arange(cells.start, cells.stop + 1) * DT
    step, fade = np.diff(np.clip(edges, t0, t1))[: len(m.v[cells])], np.exp(-(edges[:-1] - t0) / tau)[: len(m.v[cells])]
    v, turn, y = m.v[cells] + x[3] * fade, (m.w[cells] + x[4] * fade) * step, m.vy[cells]
    c, s = np.cos(at[2] + np.cumsum(turn) - turn / 2), np.sin(at[2] + np.cumsum(turn) - turn / 2)
    gone = np.array([np.sum((v * c - y * s) * step), np.sum((v * s + y * c) * step), np.sum(turn)])
    return np.asarray(at + gone)


def motions(
    s: SimpleNamespace,
    run: Run,
    rows: SimpleNamespace,
    ends: list[tuple[int, int]],
    looks: list[float],
    causes: list[Hidden],
) -> tuple[list[list[Any]], dict[float, Any]]:
    """Return answers of motion, and for the times of scans to predict both estimates' errors and their covariance."""
    near, out, states = [int(np.searchsorted(rows.t, t, "right")) - 1 for t in looks], [], {}
    _, kept = kalman(run, s.noise, rows.t, residuals(run, rows, causes), {a for a, _ in ends} | set(near))
    white = np.diag(s.noise.rows() * (1 - s.noise.share))
    for a, b in ends:
        t0, t1, (x, p) = rows.t[a], rows.t[b], kept[a]
        c, q = np.cos(rows.seen[a, 2]), np.sin(rows.seen[a, 2])
        turn = np.array([[c, q, 0], [-q, c, 0], [0, 0, 1]])
        sd = np.sqrt(np.diag(turn @ (H @ advance(x, p, run, s.noise, t0, t1)[1] @ H.T + white) @ turn.T))
        parts = [turn @ (rows.seen[b] - rows.seen[a])]
        for k, known in enumerate(([], causes)):
            at = rows.true[a] + drift(run, known, rows.t[a : a + 1])[0] + x[:3, k]
            end = _ahead(run, known, s.noise.tau, at, x[:, k], t0, t1) + x[5:, k] * np.exp(-(t1 - t0) / s.noise.tau_c)
            parts += [turn @ (end + (rows.added[b] if known else 0) - rows.seen[a]), sd]
        out += [[n, t0, t1, "", *(q[i] for q in parts)] for i, n in enumerate(("dx", "dy", "dtheta"))]
    for t, k in zip(looks, near, strict=True):
        x, p = advance(*kept[k], run, s.noise, rows.t[k], t)
        states[t] = ([drift(run, q, np.array([t]))[0] + x[:3, i] for i, q in enumerate(([], causes))], p[:3, :3])
    return out, states


def ranges(s: SimpleNamespace, run: Run, t: float, seen: Array, state: Any, causes: list[Hidden]) -> list[list[Any]]:
    """Return answers for the readings of one scan, over what its pose may be."""
    draws = np.random.default_rng(11).standard_normal((48, 3))
    draws -= draws.mean(axis=0)
    draws = np.linalg.solve(np.linalg.cholesky(draws.T @ draws / 48), draws.T).T
    draws, stats = draws @ np.linalg.cholesky(state[1] + 1e-14 * np.eye(3)).T, [seen]
    for k, known in enumerate(([], causes)):
        g = [look(s.room, s.fan, run, np.array([t]), known, state[0][k] + d) for d in draws]
        mu, sd = np.stack([h.mu[0] for h in g]), np.stack([h.sd[0] for h in g])
        stats += [mu.mean(axis=0), np.sqrt((sd**2).mean(axis=0) + mu.var(axis=0))]
    return [["range", t, t, b, *(q[b] for q in stats)] for b in np.flatnonzero(np.isfinite(seen))]


def odometry(run: Run, rng: np.random.Generator) -> Array:
    """Return where the chair thought it was: its commands, integrated from anywhere."""
    own = replace(run, first=rng.uniform(-3, 3, 3), noise=np.zeros_like(run.noise))
    m, t = drive(own, []), np.arange(0.05, run.length - 0.01, round(1 / rng.uniform(8, 30), 3))
    gone = [np.interp(t, np.arange(len(m.x)) * DT, np.append(0, np.cumsum(q) * DT)) for q in (m.v, m.w)]
    return np.column_stack([t, pose(own, t), *(np.diff(g, prepend=0.0) / np.diff(t, prepend=0.0) for g in gone)])


def spoil(table: Array, name: str, rng: np.random.Generator, safe: Array) -> Array:
    """Put a few rows twice, out of order, without values, or elsewhere; rows stamped as in `safe` stay."""
    few, free = max(1, int(0.004 * len(table))), np.flatnonzero(~np.isin(table[:, 0], safe))
    if name == "pose" and len(free) > 100:
        if rng.random() < 0.4:
            table[rng.choice(free, few, replace=False), 1:] = np.nan
        for k in rng.choice(free[5:-5], int(rng.integers(1, 4)) if rng.random() < 0.4 else 0, replace=False):
            table[k, 1:3] += rng.uniform(0.5, 3) * np.array([np.cos(k), np.sin(k)])
    if rng.random() < 0.35:
        table = table[np.sort(np.concatenate([np.arange(len(table)), rng.choice(len(table), few)]))]
    for k in rng.choice(np.arange(1, len(table) - 1), few if rng.random() < 0.35 else 0):
        table[[k - 1, k]] = table[[k, k - 1]]
    return table


def _choices(s: SimpleNamespace, rng: np.random.Generator) -> SimpleNamespace:
    """Choose which tables there are, when time begins, and the names of the covariates shown."""
    inputs = str(rng.choice(["command", "command", "voltage", "both"]))
    if s.wrong:
        inputs = "voltage" if "voltage" in s.wrong else "command"
    zero = round(float(rng.choice([1.7e9 + rng.uniform(0, 3e7), rng.uniform(0, 500)])), 3)
    odom, wrapped, names = rng.random() < 0.6, rng.random() < 0.5, {k: str(rng.choice(q[0])) for k, q in SHOWN.items()}
    asked = {
        "extra": bool(s.unknown and "extra" in s.unknown["covariates"]),
        "decoy": rng.random() < 0.3,
        "temperature": rng.random() < 0.3 or any(c.id == "laser.temperature" for c in s.causes),
    }
    if s.unknown:
        s.unknown["covariates"] = [names.get(c, c) for c in s.unknown["covariates"]]
    shown = {k: names[k] for k in SHOWN if asked[k]}
    return SimpleNamespace(inputs=inputs, zero=zero, odom=odom, wrapped=wrapped, shown=shown)


def _driven(run: Run, rows: SimpleNamespace, has: SimpleNamespace, rng: np.random.Generator) -> dict[str, Table]:
    """Return the tables of a drive that come from the base, times from its start."""
    tab, theta = {}, rows.seen[:, 2]
    if has.inputs != "voltage":
        tab["command"] = (["t", "v", "w"], np.column_stack([run.stamps, run.commands]))
    if has.inputs != "command":
        both = [volts(run.commands[:, k], law) for k, law in enumerate((LAW_V, LAW_W))]
        tab["voltage"] = (["t", "v_f", "v_s", "v", "w"], np.column_stack([run.stamps, *both, run.commands]))
    if has.wrapped:
        theta = np.mod(theta + np.pi, 2 * np.pi) - np.pi
    tab["pose"] = (["t", "x", "y", "theta"], np.column_stack([rows.t, rows.seen[:, :2], theta]))
    if has.odom:
        tab["odom"] = (["t", "x", "y", "theta", "v", "w"], odometry(run, rng))
    if has.shown:
        t = np.arange(0, run.length + 1, 1.0)
        values = [SHOWN[k][1] + SHOWN[k][2] * run.columns[k](run.start + t) for k in has.shown]
        tab["covariate"] = (["t", *has.shown.values()], np.column_stack([t, *values]))
    return tab


def tables(s: SimpleNamespace, key: list[int]) -> tuple[Tables, list[list[Any]], bool]:
    """Return the tables of each run, the answers to the queries, and whether `truth` is given."""
    rng, out, answers = np.random.default_rng([*key, 99]), [], []
    laser, base = ([c for c in s.causes if (c.stage in ON_LASER) == q] for q in (True, False))
    has = _choices(s, rng)
    for run, times in zip(s.runs, s.times, strict=True):
        rows, start = measure(run, s.noise, base, s.pose_rate, rng), has.zero + run.start
        tab, seen, safe = _driven(run, rows, has, rng), np.zeros((0, 0)), np.zeros(0)
        times = np.round(times[times < run.length - 0.1], 6)
        if s.scans:
            seen = read(look(s.room, s.fan, run, times, laser), laser, rng)
            tab["scan"] = (["t", *(f"r{k}" for k in range(s.fan.beams))], np.column_stack([times, seen]))
        if run.number >= s.count - s.test:
            found, safe = _query(s, run, rows, times, seen, base, laser, tab, rng)
            answers += [[f"run_{run.number + 1}", q[0], start + q[1], start + q[2], *q[3:]] for q in found]
        for name, (heads, table) in tab.items():
            late = start * (np.arange(table.shape[1]) < (2 if name == "query" else 1))
            tab[name] = (heads, (table if name in ("covariate", "query") else spoil(table, name, rng, safe)) + late)
        out.append(tab)
    return out, answers, rng.random() < 0.6


def _query(
    s: SimpleNamespace,
    run: Run,
    rows: SimpleNamespace,
    times: Array,
    seen: Array,
    base: list[Hidden],
    laser: list[Hidden],
    tab: dict[str, Table],
    rng: np.random.Generator,
) -> tuple[list[Any], Array]:
    """Take what is asked of a withheld drive out of its tables; return answers, and stamps to leave alone."""
    begin = np.sort(rng.uniform(4, run.length - 1.0, int(rng.integers(6, 16))))
    ends = [tuple(np.searchsorted(rows.t, [t, t + np.exp(rng.uniform(-0.7, 2.1))])) for t in begin]
    ends = [(int(a), int(b)) for a, b in ends if a < b < len(rows.t)]
    looks = sorted(float(t) for t in rng.choice(times[(times > 3)], 3, replace=False)) if s.scans else []
    found, states = motions(s, run, rows, ends, looks, base)
    for t in looks:
        found += ranges(s, run, t, seen[np.searchsorted(times, t)], states[t], laser)
    tab["query"] = (["t0", "t1"], np.array([(rows.t[a], rows.t[b]) for a, b in ends] + [(t, t) for t in looks]))
    near, keep = np.abs(rows.t[:, None] - np.array(looks or [-9.0])).min(axis=1) < 0.6, np.ones(len(rows.t), bool)
    for a, b in ends if rng.random() < 0.5 else []:
        keep[a + 1 : b + 1] = False
    keep |= near
    keep[[a for a, _ in ends]] = True
    tab["pose"] = (tab["pose"][0], tab["pose"][1][keep])
    if looks:
        tab["scan"] = (tab["scan"][0], tab["scan"][1][~np.isin(times, looks)])
    return found, np.concatenate([rows.t[[i for pair in ends for i in pair]], rows.t[near]])


def write(folder: Path, s: SimpleNamespace, data: Tables, given: bool) -> None:
    """Write OUT/recording."""
    for k, run in enumerate(data):
        place = folder / f"run_{k + 1}"
        place.mkdir(parents=True, exist_ok=True)
        for name, (heads, rows) in run.items():
            fine = ["%.6f"] + ["%.3f" if name == "scan" else "%.6f"] * (len(heads) - 1)
            np.savetxt(place / f"{name}.csv", rows, fmt=fine, delimiter=",", header=",".join(heads), comments="")
    names, cut = [f"run_{k + 1}" for k in range(len(data))], len(data) - s.test
    lines = [f"train: [{', '.join(names[:cut])}]", f"test: [{', '.join(names[cut:])}]"]
    if s.scans:
        s.room.write(folder)
        fan = f"{{x: 0.30, y: 0.0, yaw: 0.0, angle_min: {s.fan.angle_min:.6f}, angle_increment: {s.fan.increment:.7f}"
        more = f", time_increment: {s.fan.between:.9f}" if s.count != 4 else ""
        lines += ["world: room.world", f"laser: {fan}, beams: {s.fan.beams}{more}}}"]
    if given:
        lines.append(f"truth: {{position_sd: {s.noise.position:.5f}, heading_sd: {s.noise.heading:.5f}}}")
    (folder / "meta.yaml").write_text("\n".join(lines) + "\n")
