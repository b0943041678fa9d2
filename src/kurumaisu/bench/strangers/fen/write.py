# SPDX-License-Identifier: BSD-3-Clause
"""Tables of a case as a recorder would write them, answers to queries, and tables that contradict themselves."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from .base import rates
from .drive import increments
from .laser import MEAN, Look, look, times, width
from .model import GATE, STEP, Cause, F, Run, ahead, follow, gains, law, path, steps, wrap
from .plan import Case
from .room import Room
from .unknown import RANGE

Table = tuple[list[str], F]
Tables = dict[str, Table]
Rows = list[tuple[object, ...]]
Known = tuple[Rows, list[tuple[F, F]]]


def _blemished(pose: F, rng: np.random.Generator) -> F:
    """Small faults of a recorder."""
    for _ in range(int(rng.integers(0, 3))):  # gaps
        a = rng.uniform(5, pose[-1, 0] - 5)
        pose = pose[(pose[:, 0] < a) | (pose[:, 0] > a + rng.uniform(0.2, 0.8))]
    if rng.random() < 0.3:  # a row elsewhere
        pose[int(rng.integers(20, len(pose) - 20)), 1:3] += rng.uniform(0.3, 1.0) * rng.choice([-1, 1], 2)
    k = int(rng.integers(20, len(pose) - 20))
    if rng.random() < 0.3:
        pose = np.insert(pose, k, pose[k], axis=0)
    if rng.random() < 0.3:
        pose[[k + 5, k + 6]] = pose[[k + 6, k + 5]]
    return pose


def tables(case: Case, i: int, rng: np.random.Generator, clean: bool) -> Tables:
    """What one drive left behind."""
    r, rows = case.runs[i], case.rows[i].copy()
    out: Tables = {"command": (["t", "v", "w"], np.stack([r.ct, r.cv, r.cw], 1))}
    if case.volts:
        vf, vs = law(r.cv, r.cw)
        out["voltage"] = (["t", "v_f", "v_s", "v", "w"], np.stack([r.ct, vf, vs, r.cv, r.cw], 1))
    if case.seed % 3 == 0:
        rows[:, 2] = wrap(rows[:, 2])
    pose = np.column_stack([r.pt, rows])
    if not clean:
        pose = _blemished(pose, rng)
    out["pose"] = (["t", "x", "y", "theta"], pose)
    if case.seed % 2:
        t = np.unique(np.round(np.arange(0.05, r.pt[-1], rng.choice([0.05, 0.1])), 6))
        s = rates(r, [])
        q = path(r.t, s.v, s.w, s.u, (0.0, 0.0, 0.0))
        out["odom"] = (["t", "x", "y", "theta"], np.column_stack([t, *(np.interp(t, r.t, z) for z in q)]))
    if case.fan is not None:
        z = case.scans[i]
        keep = rng.random(len(z)) > 0.01
        out["scan"] = (["t", *(f"r{b}" for b in range(z.shape[1]))], np.column_stack([r.st, z])[keep])
    if r.columns:
        out["covariate"] = (["t", *r.columns], np.column_stack([r.column_t, *r.columns.values()]))
    return out


def masked(r: Run, rng: np.random.Generator) -> tuple[F, list[tuple[int, int]]]:
    """Which rows of a test drive may be used, and the motions to predict: pairs of rows."""
    seen, asked, t = np.ones(len(r.pt), bool), [], 8.0
    while t < r.pt[-1] - 7:
        i = int(np.searchsorted(r.pt, t))
        end = t + 5.0
        seen[(np.arange(len(r.pt)) > i) & (r.pt < end)] = False
        for d in (0.5, 1.0, 2.0, 4.0):
            j = int(np.searchsorted(r.pt, r.pt[i] + d))
            if i < j < len(r.pt):
                asked.append((i, j))
        t = end + rng.uniform(5, 9)
    return seen.astype(float), asked


def _poses(r: Run, causes: list[Cause], known: F, k: int, t: F) -> tuple[F, F, F]:
    """Poses of beams about a row, carried on by the model; arrays 1 x beams."""
    s = rates(r, causes)
    c = int(np.clip(np.searchsorted(r.mid, r.pt[k]), 0, len(r.mid) - 1))
    v, w = s.v[c] + known[3], s.w[c] + known[4]
    d = t - r.pt[k]
    m = known[2] + w * d / 2
    return known[0] + v * d * np.cos(m), known[1] + v * d * np.sin(m), known[2] + w * d


def _expected(room: Room, case: Case, r: Run, causes: list[Cause], state: tuple[F, F], k: int) -> tuple[F, F]:
    """Mean and deviation of each reading of the scan at a row."""
    assert case.fan is not None
    stamp = r.pt[k : k + 1]
    one = Run(**{**r.__dict__, "st": stamp})
    q: Look = look(room, one, case.fan, causes, _poses(r, causes, state[0], k, times(r, case.fan, causes, stamp)))
    with np.errstate(invalid="ignore"):
        m = q.mean + 0.0
        for c in causes:
            m = m + (MEAN[c.id](q, c.p, c.form) if c.id in MEAN else RANGE[c.id](q, c.p) if c.id in RANGE else 0.0)
        var = width(q, causes) ** 2 + STEP**2 / 12 + np.einsum("sbi,ij,sbj->sb", q.j, state[1][:3, :3], q.j)
    good = np.isfinite(m) & (m > GATE[0]) & (m < GATE[1])
    return np.where(good, m, np.nan)[0], np.where(good, np.sqrt(var), np.nan)[0]


def _motions(case: Case, i: int, seen: F, asked: list[tuple[int, int]], causes: list[Cause]) -> Known:
    """Predictions of motions, and what is known at every row."""
    r = case.runs[i]
    inc, s = increments(r, causes), rates(r, causes)
    c = np.searchsorted(r.mid, r.pt[:-1]).clip(0, len(r.mid) - 1)
    grow = (s.grow_v[c], s.grow_w[c])
    g = gains(r.pt, inc, case.noise, seen, grow)
    _, known = follow(g, inc, case.rows[i], seen)
    q = steps(inc, np.diff(r.pt), case.noise, *grow)[1]
    out: Rows = []
    for a, b in asked:
        mean, sd = ahead(g, inc, q, known, case.rows[i][a], (a, b), case.noise)
        out += [(float(m), float(e)) for m, e in zip(mean, sd, strict=True)]
    return out, list(zip(known, g.p, strict=True))


def answers(case: Case, i: int, rng: np.random.Generator) -> tuple[Rows, list[tuple[float, float]], F, F]:
    """Answers of a test drive, its queries, which rows of the poses may be used, and which scans."""
    from .model import between

    r = case.runs[i]
    seen, asked = masked(r, rng)
    base, known0 = _motions(case, i, seen, asked, [])
    true, known1 = _motions(case, i, seen, asked, case.causes)
    rows: Rows = []
    queries = []
    for n, (a, b) in enumerate(asked):
        value = between(case.rows[i][a], case.rows[i][b])
        t0, t1 = r.start + r.pt[a], r.start + r.pt[b]
        queries.append((t0, t1))
        for j, name in enumerate(("dx", "dy", "dtheta")):
            told = (*base[3 * n + j], *true[3 * n + j])
            rows.append((r.name, name, f"{t0:.6f}", f"{t1:.6f}", "", float(value[j]), *told))
    use = np.ones(len(r.st))
    if case.fan is None or case.room is None:
        return rows, queries, seen, use
    at = np.searchsorted(r.pt, r.st).clip(0, len(r.pt) - 1)
    fit = np.flatnonzero((r.pt[at] == r.st) & (seen[at] > 0) & (r.st > 2))
    from .laser import moved

    real = moved(case.room, case.causes, case.seed)
    for n in rng.permutation(fit)[:10]:
        k = int(at[n])
        use[n] = 0
        t0 = r.start + r.pt[k]
        queries.append((t0, t0))
        e0 = _expected(case.room, case, r, [], known0[k], k)
        e1 = _expected(real, case, r, case.causes, known1[k], k)
        for b, z in enumerate(case.scans[i][n]):
            rows.append((r.name, "range", f"{t0:.6f}", f"{t0:.6f}", b, z, e0[0][b], e0[1][b], e1[0][b], e1[1][b]))
    return rows, queries, seen, use


def save(folder: Path, tabs: Tables, start: float) -> None:
    """Tables as csv; times from the run's start."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (head, a) in tabs.items():
        with (folder / f"{name}.csv").open("w") as f:
            f.write(",".join(head) + "\n")
            digits = ["%.3f" if h.startswith("r") and h[1:].isdigit() else "%.6f" for h in head[1:]]
            for row in a:
                f.write(f"{row[0] + start:.6f}," + ",".join(d % z for d, z in zip(digits, row[1:], strict=True)) + "\n")


def meta(case: Case, robot: bool) -> dict[str, Any]:
    """What meta.yaml says."""
    names = [r.name for r in case.runs]
    out: dict[str, Any] = {
        "train": names[: case.train],
        "test": names[case.train :],
        "truth": {f"{k}_sd": round(float(getattr(case.noise, k)), 6) for k in ("position", "heading")},
    }
    if robot:
        out["robot"] = "md100"
    if case.fan is not None:
        f = case.fan
        out["world"] = "room.world"
        out["laser"] = {"x": f.x, "y": f.y, "yaw": f.yaw, "angle_min": f.angle_min, "angle_increment": f.step}
        out["laser"] |= {"beams": f.beams, "time_increment": f.lag}
    return out


def fresh(out: Path) -> Path:
    """An empty folder for the recording."""
    rec = out / "recording"
    if rec.exists():
        shutil.rmtree(rec)
    rec.mkdir(parents=True)
    return rec


def dump(rec: Path, said: dict[str, Any]) -> None:
    """Write meta.yaml."""
    (rec / "meta.yaml").write_text(yaml.safe_dump(said, sort_keys=False))


Spoil = Callable[[list[Tables], dict[str, Any], np.random.Generator], None]


def _each(name: str, act: Callable[[F, list[str]], F | None]) -> Spoil:
    """Spoil one table of every drive."""

    def spoil(runs: list[Tables], said: dict[str, Any], rng: np.random.Generator) -> None:
        for r in runs:
            if name in r:
                head, a = r[name]
                b = act(a, head)
                r[name] = (head, a if b is None else b)

    return spoil


def _times(name: str, cols: dict[int, float]) -> Spoil:
    def act(a: F, head: list[str]) -> None:
        for k, f in cols.items():
            a[:, k] *= f

    return _each(name, act)


def _swap(name: str, i: int, j: int) -> Spoil:
    def act(a: F, head: list[str]) -> None:
        a[:, [i, j]] = a[:, [j, i]]

    return _each(name, act)


def _late(name: str, d: float) -> Spoil:
    def act(a: F, head: list[str]) -> None:
        a[:, 0] += d

    return _each(name, act)


def _heading(f: Callable[[F], F]) -> Spoil:
    def act(a: F, head: list[str]) -> None:
        a[:, 3] = f(a[:, 3])

    return _each("pose", act)


def _both_commands(act: Callable[[F], None]) -> Spoil:
    """In the commands; voltages that would tell are not recorded."""

    def spoil(runs: list[Tables], said: dict[str, Any], rng: np.random.Generator) -> None:
        for r in runs:
            r.pop("voltage", None)
            r.pop("odom", None)
            act(r["command"][1])

    return spoil


def _mul(k: int, f: float) -> Spoil:
    def act(a: F) -> None:
        a[:, k] *= f

    return _both_commands(act)


def _swap_commands(a: F) -> None:
    a[:, [1, 2]] = a[:, [2, 1]]


def _other_drive(runs: list[Tables], said: dict[str, Any], rng: np.random.Generator) -> None:
    """Poses of the next drive, at these times."""
    poses = [r["pose"][1].copy() for r in runs]
    for i, r in enumerate(runs):
        q = poses[(i + 1) % len(runs)]
        r["pose"] = (r["pose"][0], q)


def _twice(runs: list[Tables], said: dict[str, Any], rng: np.random.Generator) -> None:
    for k in list(runs[0]):
        runs[1][k] = runs[0][k]


def _stands(a: F, head: list[str]) -> None:
    n = len(a)
    a[n // 4 :, 1:] = a[n // 4, 1:]


def _grid(a: F, head: list[str]) -> None:
    a[:, 1:3] = np.round(a[:, 1:3] / 0.8) * 0.8


def _jumps(a: F, head: list[str]) -> None:
    rng = np.random.default_rng(len(a))
    for i in rng.integers(10, len(a), 12):
        a[i:, 1:3] += rng.uniform(0.5, 2, 2) * rng.choice([-1, 1], 2)


def _volts(f: Callable[[F], F]) -> Spoil:
    """In the voltages alone, which then are the only input."""

    def spoil(runs: list[Tables], said: dict[str, Any], rng: np.random.Generator) -> None:
        for r in runs:
            t, v = r["voltage"][0][:3], r["voltage"][1][:, :3].copy()
            v[:, 1:] = f(v[:, 1:])
            r["voltage"] = (t, v)
            r.pop("command")
            r.pop("odom", None)

    return spoil


def _scan(f: Callable[[F], F]) -> Spoil:
    def act(a: F, head: list[str]) -> None:
        a[:, 1:] = f(a[:, 1:])

    return _each("scan", act)


def _shuffle(z: F) -> F:
    return z[:, np.random.default_rng(1).permutation(z.shape[1])]


def _fan_of(key: str, f: float, plus: float) -> Spoil:
    def spoil(runs: list[Tables], said: dict[str, Any], rng: np.random.Generator) -> None:
        said["laser"][key] = round(said["laser"][key] * f + plus, 6)

    return spoil


def _nothing(runs: list[Tables], said: dict[str, Any], rng: np.random.Generator) -> None:
    """The map is what is wrong."""


def _slow(a: F, head: list[str]) -> None:
    a[:, 0] *= 1.08


# sentence: what it does, which parts it needs
WRONGS: dict[str, tuple[Spoil, str]] = {
    "positions of the reference are in mm": (_times("pose", {1: 1000, 2: 1000}), ""),
    "positions of the reference are in cm": (_times("pose", {1: 100, 2: 100}), ""),
    "headings of the reference are in degrees": (_heading(lambda q: np.degrees(wrap(q))), ""),
    "times of the reference are in ms": (_times("pose", {0: 1000}), "stamp"),
    "times of the commands are in us": (_times("command", {0: 1e6}), "stamp"),
    "speeds of the commands are in km/h": (_mul(1, 3.6), ""),
    "yaw rates of the commands are in deg/s": (_mul(2, 57.29578), ""),
    "yaw rates of the commands have the wrong sign": (_mul(2, -1), ""),
    "speeds of the commands have the wrong sign": (_mul(1, -1), ""),
    "speeds of the commands are in mm/s": (_mul(1, 1000), ""),
    "v and w of the commands are swapped": (_both_commands(_swap_commands), ""),
    "x and y of the reference are swapped": (_swap("pose", 1, 2), ""),
    "y of the reference has the wrong sign": (_times("pose", {2: -1}), ""),
    "headings of the reference are clockwise": (_heading(lambda q: -q), ""),
    "headings of the reference are those of a compass": (_heading(lambda q: np.pi / 2 - q), ""),
    "headings of the reference are folded": (_heading(lambda q: np.abs(wrap(q))), ""),
    "poses are of another drive": (_other_drive, ""),
    "the clocks of poses and commands are shifted by 6 s": (_late("pose", -6.0), ""),
    "the clocks of poses and commands are unrelated": (_late("pose", 54321.0), ""),
    "the clock of the poses runs 8 % slow": (_each("pose", _slow), ""),
    "the same drive is given twice": (_twice, ""),
    "the poses stand still while the chair drives": (_each("pose", _stands), ""),
    "positions lie on a grid of 0.8 m": (_each("pose", _grid), ""),
    "the poses jump": (_each("pose", _jumps), ""),
    "voltages are in mV": (_volts(lambda v: v * 1000), "volts"),
    "voltages have the reference of 2.5 V in them": (_volts(lambda v: v + 2.5), "volts"),
    "the channels of the voltages are swapped": (_volts(lambda v: v[:, ::-1]), "volts"),
    "voltages are counts of the D/A": (_volts(lambda v: np.round((v + 5) / 10 * 4095)), "volts"),
    "the fan is mirrored": (_scan(lambda z: z[:, ::-1]), "scan"),
    "ranges are in mm": (_scan(lambda z: z * 1000), "scan"),
    "beams are in another order": (_scan(_shuffle), "scan"),
    "the scans are all alike": (_scan(lambda z: np.broadcast_to(z[0], z.shape)), "scan"),
    "no return is given as a number": (_scan(lambda z: np.where(np.isfinite(z), z, 5.6)), "scan"),
    "the laser looks another way by 90 degrees": (_fan_of("yaw", 1, np.pi / 2), "scan"),
    "the fan of meta.yaml is twice as wide": (_fan_of("angle_increment", 0.5, 0), "scan"),
    "the clocks of scans and poses are shifted by 4 s": (_late("scan", 4.0), "scan"),
    "the map is mirrored": (_nothing, "scan map mirror"),
    "the map is shifted by 0.7 m": (_nothing, "scan map shift"),
    "the map is 1.2 times too large": (_nothing, "scan map scale"),
    "the map is of another room": (_nothing, "scan map other"),
    "the map is turned by 20 degrees": (_nothing, "scan map turn"),
}


def spoiled(room: Room, how: str, other: Room) -> Room:
    """A map that is not the room's."""
    if how == "other":
        return other
    if how == "mirror":
        return Room(room.res, room.x0, room.y0, room.solid[:, ::-1], room.face, room.which[:, ::-1], room.shapes)
    if how == "shift":
        return Room(room.res, room.x0 + 0.7, room.y0 - 0.2, room.solid, room.face, room.which, room.shapes)
    if how == "scale":
        return Room(room.res * 1.2, room.x0 * 1.2, room.y0 * 1.2, room.solid, room.face, room.which, room.shapes)
    from scipy.ndimage import rotate

    which = rotate(room.which.astype(np.int16), 20, reshape=True, order=0, cval=-1)
    dy, dx = (which.shape[0] - room.solid.shape[0]) / 2, (which.shape[1] - room.solid.shape[1]) / 2
    x0, y0 = room.x0 - dx * room.res, room.y0 - dy * room.res
    return Room(room.res, x0, y0, which >= 0, room.face, which, room.shapes)
