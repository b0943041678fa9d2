# SPDX-License-Identifier: BSD-3-Clause
"""What a laser reads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu.bench.strangers.knoll.motions import compose
from kurumaisu.bench.strangers.knoll.room import cast
from kurumaisu.bench.strangers.knoll.signals import wandering
from kurumaisu.bench.strangers.knoll.things import DT, Cause, Drive, Hits, Pose, Rng, Scene
from kurumaisu.types import FloatArray


def beam_times(sc: Scene, causes: Sequence[Cause], stamps: FloatArray) -> FloatArray:
    """Return when each beam of each scan is taken."""
    t = stamps
    for c in causes:
        t = c.scan_time(t) if c.scan_time else t
    k = sc.laser.time_increment * (1 + sum(c.stretch for c in causes))
    return t[:, None] + k * np.arange(sc.laser.beams)


def _hits(sc: Scene, causes: Sequence[Cause], x: Drive, poses: Pose, ta: FloatArray) -> Hits:
    fan, room, scans = sc.laser, sc.room, ta.shape[0]
    m = fan.mount + sum((c.mount for c in causes if c.mount is not None), np.zeros(3))
    lx, ly, lth = (a.ravel() for a in compose(poses, m))
    beam = np.tile(np.arange(fan.beams), scans)
    bearing = fan.angle_min + fan.increment * beam
    segs = room.segs
    for c in causes:
        segs = c.walls(segs, room.ids) if c.walls else segs
    ang = lth + bearing
    r, edge = cast(segs, lx, ly, ang)
    e = segs[edge, 2:] - segs[edge, :2]
    q = np.hypot(e[:, 1], -e[:, 0])
    nx, ny = e[:, 1] / q, -e[:, 0] / q
    d = np.cos(ang) * nx + np.sin(ang) * ny
    d = np.where(np.abs(d) < 0.02, 0.02 * np.where(d < 0, -1, 1), d)
    r = np.where(np.isfinite(r), r, 100.0)
    th = poses[2].ravel()
    jac = np.stack([-nx / d, -ny / d, 0 * d], 1)
    c_, s_ = np.cos(th), np.sin(th)
    jac[:, 2] = jac[:, 0] * (-s_ * m[0] - c_ * m[1]) + jac[:, 1] * (c_ * m[0] - s_ * m[1])
    jac[:, 2] -= r * (-np.sin(ang) * nx + np.cos(ang) * ny) / d
    grid = r.reshape(-1, fan.beams)
    back = np.maximum(np.roll(grid, 1, 1), np.roll(grid, -1, 1))
    back[:, 0] = back[:, -1] = 0
    k = np.clip((ta.ravel() / DT).astype(int), 0, x.n - 1)
    thing = room.ids[edge]
    return Hits(
        *(r, np.abs(d), thing, edge, room.dark[thing], beam, bearing, ang, np.repeat(ta[:, 0], fan.beams)),
        *(np.tile(ta[0] - ta[0, 0], scans), x.day, x.vm[k], x.wm[k], np.where(back > 99, 0, back).ravel()),
        *({name: a[k] for name, a in x.cov.items()}, jac, th),
    )


def shoot(
    sc: Scene, causes: Sequence[Cause], x: Drive, poses: Pose, ta: FloatArray
) -> tuple[FloatArray, FloatArray, Hits]:
    """Return means and sds of readings with beams at ta from true poses there, and what they hit."""
    fan, g = sc.laser, _hits(sc, causes, x, poses, ta)
    mu = fan.scale * g.r + fan.datum
    sd = fan.sigma[0] + fan.sigma[1] * g.r + fan.sigma[2] * g.r**2
    for c in sorted(causes, key=lambda c: c.order):
        mu = c.mean(mu, g) if c.mean else mu
    for c in causes:
        sd = c.sd(sd, g) if c.sd else sd
    return mu, sd, g


def strays(rng: Rng, sc: Scene, r: FloatArray) -> FloatArray:
    """Return scans with a few stray readings, of dust or flies."""
    near = sc.laser.near
    hit = (rng.random(r.shape) < sc.strays) & np.isfinite(r)
    short = rng.uniform(near, np.where(hit, np.maximum(r, near + 0.01), near + 0.01))
    return np.where(hit, np.round(short, 3), r)


def _scattered(rng: Rng, sc: Scene, causes: Sequence[Cause], mu: FloatArray, sd: FloatArray, g: Hits) -> FloatArray:
    e, beams = rng.normal(size=mu.size), sc.laser.beams
    for c in causes:
        e = c.noise(e) if c.noise else e
    r = mu + sd * e
    for c in causes:
        if c.common:
            each = wandering(rng, mu.size // beams, c.common[0], float(-1 / np.log(c.common[1])), 1.0)
            r = r + np.repeat(each, beams)
    for c in causes:
        r = c.corrupt(rng, r, g) if c.corrupt else r
    return r


def read(rng: Rng, sc: Scene, causes: Sequence[Cause], mu: FloatArray, sd: FloatArray, g: Hits) -> FloatArray:
    """Draw the readings of these means and sds, a row for each scan."""
    fan, r = sc.laser, _scattered(rng, sc, causes, mu, sd, g)
    if not any(c.step for c in causes):
        r = np.round(r / fan.resolution) * fan.resolution
    r = np.where(r < fan.near, np.nan, np.where((r > fan.far) | (g.r > 99), np.inf, r))
    for c in causes:
        r = np.where(rng.random(r.size) < c.lost(mu, g), np.nan, r) if c.lost else r
    return r.reshape(-1, fan.beams)
