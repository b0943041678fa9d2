# SPDX-License-Identifier: BSD-3-Clause
"""Questions to the last drive, with what the published model and the true causes answer."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.strangers.delta.camera import markers, true_time
from kurumaisu.bench.strangers.delta.chair import rough, simulate
from kurumaisu.bench.strangers.delta.core import DT, Array, Cause, Drive, Path, Setup
from kurumaisu.bench.strangers.delta.mechanics import Motion
from kurumaisu.bench.strangers.delta.scanner import hits, read

SPANS, DRAWS = (0.5, 1.0, 2.0, 4.0), 300
Row = tuple[str, str, float, float, str, float, float, float, float, float]


def ask(setup: Setup, drive: Drive) -> None:
    """Choose windows and scans of a test drive, before its reference is recorded."""
    rng = setup.rng
    n = int(rng.integers(5, 9))
    edges = np.linspace(8, drive.length - 8, n + 1)
    drive.windows = [float(rng.uniform(a, b - 5.0)) for a, b in pairwise(edges) if b - a > 6]
    if setup.scans:
        free = np.ones(len(drive.scan_t), dtype=bool)
        for w in drive.windows:
            free &= (drive.scan_t < w - 0.5) | (drive.scan_t > w + 4.7)
        if drive.walker[0] >= 0:
            free &= (drive.scan_t < drive.walker[0]) | (drive.scan_t > drive.walker[0] + 12)
        free &= (drive.scan_t > 1.5) & (drive.scan_t < drive.length - 2)
        some = np.flatnonzero(free)
        drive.asked_scans = sorted(rng.choice(some, min(len(some), int(rng.integers(5, 9))), replace=False).tolist())


def chair_pose(setup: Setup, drive: Drive, pose: Array, stamp: Array, causes: Sequence[Cause]) -> Array:
    """Where the chair is, by what the reference shows of it."""
    chair = pose
    for _ in range(4):
        chair = pose - (markers(setup, drive, chair, stamp, causes) - chair)
    return chair


def carried(setup: Setup, drive: Drive, causes: Sequence[Cause], row: int) -> Path:
    """The model's path, where effects of place are those of the reference up to a row, and then of the model."""
    ok = (drive.odd == 0) & (np.arange(len(drive.rows)) <= row)
    t = drive.rows[ok]
    pose = chair_pose(setup, drive, drive.poses[ok], t, causes)
    grid = DT * np.arange(len(drive.true_path().x))
    now = true_time(t, causes)
    x, y, th = (np.interp(grid, now, pose[:, i]) for i in range(3))
    past, k = grid <= now[-1], int(now[-1] / DT)
    for _ in range(3):
        new = simulate(setup, drive, causes, along=Path(x, y, th, x, x))
        turn = pose[-1, 2] - new.th[k]
        c, s, dx, dy = np.cos(turn), np.sin(turn), new.x - new.x[k], new.y - new.y[k]
        ahead = pose[-1, 0] + c * dx - s * dy, pose[-1, 1] + s * dx + c * dy, new.th + turn
        x, y, th = (np.where(past, a, b) for a, b in zip((x, y, th), ahead, strict=True))
    return Path(*ahead, new.v, new.w)


def clouds(setup: Setup, drive: Drive, causes: Sequence[Cause], row: int, times: Array, drift: float) -> Array:
    """Poses at some times after a row, drawn with all noise: (1 + draws, times, 3); the first without noise."""
    noise, rng = setup.noise, setup.rng
    path = carried(setup, drive, causes, row)
    now = float(true_time(drive.rows[row : row + 1], causes)[0])
    start = chair_pose(setup, drive, drive.poses[[row]], drive.rows[[row]], causes)[0]
    lo, hi = min(float(times.min()), now), max(float(times.max()), now)
    first, last = int(lo / DT) - 1, int(hi / DT) + 2
    cell = slice(max(first, 0), min(last, len(path.v)))
    th = path.th[:-1][cell] + path.w[cell] * DT / 2
    dx, dy = np.diff(path.x)[cell] / DT, np.diff(path.y)[cell] / DT
    moving = np.clip((np.abs(path.v[cell]) + np.abs(path.w[cell])) / 0.05, 0, 1)
    for c in causes:
        if c.id == "base.process_noise":
            moving = moving * rough(Motion(th, th, th, 0.0, path.v[cell], path.w[cell]), c)
    a = np.exp(-DT / noise.tau)
    white = rng.normal(0, 1, (2, DRAWS + 1, len(th)))
    white[:, :, 1:] *= np.sqrt(1 - a * a)
    nv, nw = lfilter([1], [1, -a], white, axis=-1) * moving * np.array([noise.sd_v, noise.sd_w])[:, None, None]
    nv[0] = nw[0] = 0
    turned = np.cumsum(nw, -1) * DT
    vx = dx * np.cos(turned) - dy * np.sin(turned) + nv * np.cos(th + turned)
    vy = dx * np.sin(turned) + dy * np.cos(turned) + nv * np.sin(th + turned)
    out = np.empty((DRAWS + 1, len(times), 3))
    grid = DT * np.arange(cell.start, cell.stop + 1)
    e = rng.normal(0, 1, (DRAWS + 1, 3)) * np.array([np.hypot(noise.position, drift)] * 2 + [noise.heading])
    e[0] = 0
    for k in range(DRAWS + 1):
        sums = [np.concatenate([[0.0], np.cumsum(u) * DT]) for u in (vx[k], vy[k], path.w[cell] + nw[k])]
        rel = np.stack([np.interp(times, grid, u) - np.interp(now, grid, u) for u in sums], -1)
        c, s = np.cos(e[k, 2]), np.sin(e[k, 2])
        out[k, :, 0] = start[0] + e[k, 0] + c * rel[:, 0] - s * rel[:, 1]
        out[k, :, 1] = start[1] + e[k, 1] + s * rel[:, 0] + c * rel[:, 1]
        out[k, :, 2] = start[2] + e[k, 2] + rel[:, 2]
    return out


def motion(a: Array, b: Array) -> Array:
    """Motion from pose a to b in the body frame at a."""
    d, c, s = b - a, np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack([c * d[..., 0] + s * d[..., 1], c * d[..., 1] - s * d[..., 0], d[..., 2]], -1)


def answer_motion(setup: Setup, drive: Drive, causes: Sequence[Cause], window: float) -> list[Row]:
    """Four motions of a window."""
    good = np.flatnonzero(drive.odd == 0)
    first = int(good[np.argmin(np.abs(drive.rows[good] - window))])
    later = [int(good[np.argmin(np.abs(drive.rows[good] - drive.rows[first] - span))]) for span in SPANS]
    later = [k for k in dict.fromkeys(later) if k > first]
    stamps, said = drive.rows[later], []
    for known in ([], list(causes)):
        cloud = clouds(setup, drive, known, first, true_time(stamps, known), 0.0)
        seen = markers(setup, drive, cloud, stamps, known)
        seen[1:] += setup.rng.normal(0, 1, seen[1:].shape) * np.array(
            [setup.noise.position] * 2 + [setup.noise.heading]
        )
        moved = motion(drive.poses[first], seen)
        said.append((moved[0], moved[1:].std(0)))
    value = motion(drive.poses[first], drive.poses[later])
    t0 = drive.start + drive.rows[first]
    return [
        (drive.name, name, t0, drive.start + stamps[j], "", value[j, i], *(float(u[j, i]) for s in said for u in s))
        for j in range(len(later))
        for i, name in enumerate(("dx", "dy", "dtheta"))
    ]


def answer_scan(setup: Setup, drive: Drive, causes: Sequence[Cause], index: int) -> list[Row]:
    """All beams of a scan."""
    stamp = drive.scan_t[index : index + 1]
    row = int(np.argmin(np.abs(drive.rows - stamp[0])))
    said = []
    for known in ([], list(causes)):

        def poses(t: Array, known: list[Cause] = known) -> Array:
            """Draws of the pose at the beams' times."""
            return clouds(setup, drive, known, row, t[0], setup.noise.drift)[:, None]

        reading = read(setup, drive, hits(setup, drive, stamp, poses, known), known, setup.rng)[:, 0]
        reading[~np.isfinite(reading)] = np.nan
        with np.errstate(all="ignore"):
            enough = np.isfinite(reading).mean(0) > 0.5
            filled = np.where(enough, reading, 0.0)
            said.append((np.nanmean(filled, 0), np.nanstd(filled, 0), enough))
    t0 = drive.start + stamp[0]
    return [
        (drive.name, "range", t0, t0, str(b), float(value), *(float(u[b]) for s in said for u in s[:2]))
        for b, value in enumerate(drive.scans[index])
        if np.isfinite(value) and said[0][2][b] and said[1][2][b]
    ]
