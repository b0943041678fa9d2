# SPDX-License-Identifier: BSD-3-Clause
"""What was measured where the recording asks for it, and what either model can say of that."""

import numpy as np

from kurumaisu.bench.strangers.moor.laser import FAR, Cast, Fan, Lenses, Optics, expect, look, optics_of
from kurumaisu.bench.strangers.moor.motion import DT, Causes, Drive, Motion, simulate
from kurumaisu.bench.strangers.moor.whiten import Noise
from kurumaisu.bench.strangers.moor.world import Array, Room

Answer = tuple[str, str, float, float, str, tuple[float, ...]]


def onward(drive: Drive, causes: Causes, real: Motion, stamp: float, pose: Array) -> Motion:
    """The motion without noise from where the reference saw the chair at a stamp."""
    clock = (
        simulate(drive, causes, noise=0.0).clock if any(law.name == "base.clock_scale" for law, _ in causes) else 0.0
    )
    begin = pose.copy()
    for _ in range(3 if causes else 2):
        m = simulate(drive, causes, 0.0, (int(stamp / (1 + clock) / DT), real, (begin[0], begin[1], begin[2])))
        begin = begin + pose - m.reference(np.array([stamp]))[0]
    return m


def relative(a: Array, b: Array) -> Array:
    """The motion from one pose to the other, in the frame of the first; turns are counted."""
    d, c, s = b - a, np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack([c * d[..., 0] + s * d[..., 1], c * d[..., 1] - s * d[..., 0], d[..., 2]], axis=-1)


def spread(m: Motion, t0: float, t1: float, noise: Noise, rng: np.random.Generator) -> Array:
    """Standard deviations of a motion, by drawing noise of rates and of both poses."""
    rows = slice(int(t0 / DT), int(t1 / DT))
    n, many = max(rows.stop - rows.start, 1), 400
    a = np.exp(-DT / noise.tau)
    e = rng.normal(0, 1, (2, n, many))
    for i in range(1, n):
        e[:, i] = a * e[:, i - 1] + np.sqrt(1 - a * a) * e[:, i]
    grow = (m.grow * m.drive.free)[rows, None]
    turn = np.cumsum(grow * noise.sd_w * e[1], axis=0) * DT
    h = (m.heading[rows] - m.heading[rows.start])[:, None] + turn
    v, u = m.v[rows, None] + grow * noise.sd_v * e[0], m.u[rows, None]
    x, y = ((v * np.cos(h) - u * np.sin(h)).sum(0) * DT, (v * np.sin(h) + u * np.cos(h)).sum(0) * DT)
    end = np.stack([x, y, h[-1]], axis=1)
    size = np.array([noise.position, noise.position, noise.heading])
    ways = relative(rng.normal(0, 1, (many, 3)) * size, end + rng.normal(0, 1, (many, 3)) * size)
    return np.asarray(ways.std(axis=0))


def motions(
    run: str,
    drive: Drive,
    causes: Causes,
    real: Motion,
    stamps: Array,
    poses: Array,
    rows: list[tuple[int, int]],
    noise: Noise,
) -> list[Answer]:
    """Answers to queries of motion, given by the rows of the reference at either end."""
    rng = np.random.default_rng(drive.luck)
    out: list[Answer] = []
    ahead: dict[int, list[Motion]] = {}
    for i, j in rows:
        t0, t1 = float(stamps[i]), float(stamps[j])
        value = relative(poses[i], poses[j])
        says = []
        if i not in ahead:
            ahead[i] = [onward(drive, some, real, t0, poses[i]) for some in ([], causes)]
        for m in ahead[i]:
            ends = m.reference(np.array([t0, t1]))
            says.append((relative(ends[0], ends[1]), spread(m, t0, t1, noise, rng)))
        for k, channel in enumerate(("dx", "dy", "dtheta")):
            (b, bs), (o, os) = says
            out.append((run, channel, t0, t1, "", (value[k], b[k], bs[k], o[k], os[k])))
    return out


def ranges(
    run: str, drive: Drive, base: Causes, lenses: Lenses, fan: Fan, room: Room, stamp: float, pose: Array,
    readings: Array, noise: Noise,
) -> list[Answer]:  # fmt: skip
    """Answers to a query of a scan, by drawing poses about the one that the reference gave."""
    rng = np.random.default_rng([drive.luck, int(stamp * 1000)])
    says = []
    for causes, some in (([], []), (base, lenses)):
        o: Optics = optics_of(some)
        m = simulate(drive, causes, noise=0.0)
        late = abs(o.delay + o.skew * stamp + o.drift * stamp**2)
        size = np.array(
            [np.hypot(noise.position, late * noise.sd_v)] * 2 + [np.hypot(noise.heading, late * noise.sd_w)]
        )
        drawn = pose + rng.normal(0, 1, (120, 3)) * size

        def at(t: Array, m: Motion = m, drawn: Array = drawn) -> tuple[Array, Array, Array]:
            """Each drawn pose, carried on through the scan."""
            p, q = m.reference(np.array([stamp]))[0], m.reference(t[0])
            way = relative(p[None], q)
            c, s = np.cos(drawn[:, 2:]), np.sin(drawn[:, 2:])
            return drawn[:, :1] + c * way[:, 0] - s * way[:, 1], drawn[:, 1:2] + s * way[:, 0] + c * way[:, 1], (
                drawn[:, 2:] + way[:, 2]
            )  # fmt: skip

        c = look(m, at, np.full(120, stamp), fan, room, o, drive.luck // 10)
        says.append(summary(c, some))
    out: list[Answer] = []
    (b, bs), (w, ws) = says
    for k in np.flatnonzero(np.isfinite(readings) & np.isfinite(b) & np.isfinite(w)):
        out.append((run, "range", stamp, stamp, str(k), (readings[k], b[k], bs[k], w[k], ws[k])))
    return out


def summary(c: Cast, lenses: Lenses) -> tuple[Array, Array]:
    """Mean and standard deviation of readings over the drawn poses; nan where nothing is expected."""
    mean, sd = expect(c, lenses)
    with np.errstate(invalid="ignore"):
        more = mean.var(axis=0) + (sd**2).mean(axis=0) + 1e-6 / 12
        middle = np.where(np.isfinite(mean).all(axis=0) & (mean.mean(axis=0) < FAR - 0.02), mean.mean(axis=0), np.nan)
    # few draws miss a rare one of the pose's errors, by which a beam beside an edge meets what its neighbour meets
    near = np.where(np.isfinite(mean), mean, 6.0).mean(axis=0)
    jump = np.diff(near)
    beside = np.maximum(np.concatenate([[0.0], jump**2]), np.concatenate([jump**2, [0.0]]))
    more = more + 0.01 * np.where(beside > 0.01, beside, 0.0)
    for lens, size in lenses:
        trick = lens.act(c, size) if lens.kind == "special" else {}
        assert isinstance(trick, dict)
        more = more + float(trick.get("sd", 0.0)) ** 2 + float(trick.get("step", 0.0)) ** 2 / 12
        more = more + float(trick.get("outliers", 0.0)) * float(trick.get("reach", 0.0)) ** 2
        if "nu" in trick:
            nu = float(trick["nu"])
            more = more + (sd**2).mean(axis=0) * 2 / (nu - 2)
        if trick.get("floor"):
            middle = middle - float(trick["step"]) / 2
    return middle, np.sqrt(more)
