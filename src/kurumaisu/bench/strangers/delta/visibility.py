# SPDX-License-Identifier: BSD-3-Clause
"""How strongly a cause shows in the readings, beside their noise and the error of the pose."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from kurumaisu.bench.strangers.delta.core import Array, Cause, Drive, Setup
from kurumaisu.bench.strangers.delta.law import FAR, RESOLUTION
from kurumaisu.bench.strangers.delta.optics import edges, tails, tangent
from kurumaisu.bench.strangers.delta.room import Hits
from kurumaisu.bench.strangers.delta.scanner import LOST, expected, hits, missing, spread
from kurumaisu.bench.strangers.delta.strength import left_over, shows_in_base, without

LASER_RIVALS = {
    "laser.offset": 0.005,
    "laser.scale": 0.002,
    "laser.mount_x": 0.005,
    "laser.mount_y": 0.005,
    "laser.mount_yaw": 0.005,
    "laser.latency": 0.01,
}
MOST = 300
SCATTER = [
    f"laser.{name}"
    for name in (
        *("range_noise", "incidence_noise", "common_mode", "beam_correlation", "heavy_tails"),
        *("mixed_pixels", "dropout", "saturation", "crosstalk", "quantisation"),
    )
]


def chosen_scans(setup: Setup) -> list[tuple[Drive, Array]]:
    """At most 300 scans of the drives to train, evenly."""
    drives = setup.drives[: setup.train]
    every = max(1, -(-sum(len(d.scan_t) for d in drives) // MOST))
    return [(d, d.scan_t[::every]) for d in drives]


def ends(setup: Setup, drive: Drive, stamps: Array, causes: Sequence[Cause]) -> Hits:
    """Where the beams end, by the true path."""
    return hits(setup, drive, stamps, lambda t: np.stack(drive.true_path().at(t), -1), causes)


def slopes(setup: Setup, h: Hits, th: Array) -> Array:
    """What an error of the pose does to readings: (scans, beams, 3)."""
    nx, ny, mx = np.cos(h.normal) / h.cos, np.sin(h.normal) / h.cos, setup.fan.x
    turn = h.r * (ny * np.cos(h.direction) - nx * np.sin(h.direction))
    turn = turn - mx * np.sin(th) * nx + mx * np.cos(th) * ny
    return np.stack([nx, ny, turn], -1)


def smooth(h: Hits) -> Array:
    """Readings away from edges and corners, where a small error of the pose is a small error of the range."""
    r, kink = np.minimum(h.r, 6.0), np.diff(h.normal, axis=-1) != 0
    rough = (np.abs(np.diff(r, 2, axis=-1)) > 0.03) | kink[..., 1:] | kink[..., :-1]
    wide = np.zeros(r.shape, dtype=bool)
    for k in range(-2, 5):
        wide[..., max(k, 0) : r.shape[-1] - 2 + min(k, 2)] |= rough[..., max(0, -k) : rough.shape[-1] - max(0, k - 2)]
    return ~wide


def project(setup: Setup, h: Hits, th: Array, sd: Array, parts: Array, ok: Array) -> list[Array]:
    """Signals (scans, beams, columns) whitened by noise and by the error of each scan's pose."""
    noise = setup.noise
    pose = np.array([np.hypot(noise.position, noise.drift)] * 2 + [np.hypot(noise.heading, 0.3 * noise.drift)])
    jac = slopes(setup, h, th) * pose
    out = []
    for k in range(len(sd)):
        use = ok[k]
        if use.sum() < 20:
            continue
        a, b = jac[k][use] / sd[k][use, None], parts[k][use] / sd[k][use, None]
        u, s, _ = np.linalg.svd(a, full_matrices=False)
        out.append(b - u @ ((1 - 1 / np.sqrt(1 + s**2))[:, None] * (u.T @ b)))
    return out


def laser_strength(
    setup: Setup, causes: Sequence[Cause], cause: Cause, rivals: dict[str, float] | None = None
) -> tuple[float, float]:
    """Norm of a cause's signal in the readings of at most 300 scans, and what rivals leave of it."""
    if cause.id in SCATTER or (cause.curve and cause.curve.channel == "range_noise"):
        return scatter_strength(setup, causes, cause)
    rivals = LASER_RIVALS if rivals is None else rivals
    tried = [Cause(name, size) for name, size in rivals.items() if name not in {c.id for c in causes}]
    stack: list[Array] = []
    others = [c for c in without(causes, cause) if not shows_in_base(c) and c.id not in SCATTER]
    for drive, stamps in chosen_scans(setup):
        h = ends(setup, drive, stamps, causes)
        full = expected(setup, drive, h, causes)
        parts, ok = [], (full < FAR) & smooth(h)
        sets = [without(causes, c) for c in (cause, *others)] + [[*causes, c] for c in tried]
        for i, some in enumerate(sets):
            sign = 1 if i <= len(others) else -1
            there = ends(setup, drive, stamps, some)
            d = sign * (full - expected(setup, drive, there, some))
            ok = ok & (np.abs(d) < 0.25) & smooth(there) & (np.abs(there.normal - h.normal) < 0.1)
            parts.append(np.where(np.abs(d) < 0.25, d, 0.0))
        sd = np.hypot(spread(setup, drive, h, causes), RESOLUTION / np.sqrt(12))
        th = drive.true_path().at(h.t)[2]
        stack += project(setup, h, th, sd, np.stack(parts, -1), ok)
    return left_over(np.vstack(stack))


def scatter_strength(setup: Setup, causes: Sequence[Cause], cause: Cause) -> tuple[float, float]:
    """The same of what changes the distribution of readings, by the gain of log likelihood of each."""
    stack = []
    rest = without(causes, cause)
    for drive, stamps in chosen_scans(setup):
        h = ends(setup, drive, stamps, causes)
        ok = (expected(setup, drive, h, causes) < FAR) & np.isfinite(h.r)
        gain, sign = gains(setup, drive, h, rest, cause)
        signal = sign * np.sqrt(2 * np.maximum(gain, 0))
        one, rival = np.ones(h.r.shape), [tangent(h) ** 2, h.r]
        if cause.id in ("laser.incidence_noise", "laser.mixed_pixels", "laser.saturation", "laser.crosstalk"):
            rival = [one, np.where(ok, h.r, 0.0)]
        elif cause.curve:
            rival = [one, tangent(h) ** 2, np.where(ok, h.r, 0.0)]
        elif cause.id != "laser.range_noise":
            rival = []
        else:
            rival = [1 / h.cos - 1]
        stack.append(np.stack([signal, *rival], -1)[ok])
    return left_over(np.vstack(stack))


def gains(setup: Setup, drive: Drive, h: Hits, rest: Sequence[Cause], c: Cause) -> tuple[Array, Array]:
    """Gain of log likelihood of each reading, and the sign of the change."""
    one = np.ones(h.r.shape)
    if c.curve or c.id in ("laser.range_noise", "laser.incidence_noise"):
        low = np.hypot(spread(setup, drive, h, rest), RESOLUTION / np.sqrt(12))
        d = 2 * np.log(np.hypot(spread(setup, drive, h, [*rest, c]), RESOLUTION / np.sqrt(12)) / low)
        return (np.exp(d) - 1 - d) / 2, np.sign(d)
    if c.id == "laser.common_mode":
        sd = spread(setup, drive, h, rest)
        seen = 0.6 * np.sum(np.where(h.r < 3.9, c.size**2 / sd**2, 0.0), -1, keepdims=True)
        return one * (seen - np.log1p(seen)) / 2 / h.r.shape[-1], one
    if c.id == "laser.beam_correlation":
        b = (1 - np.sqrt(1 - 4 * min(c.size, 0.49) ** 2)) / (2 * min(c.size, 0.49))
        return one * (np.log1p(b * b) if c.other else -np.log(1 - c.size**2)) / 2, one
    if c.id == "laser.saturation":
        lost = ((expected(setup, drive, h, rest) > FAR - c.size) | (h.r < c.extra["near"] * c.size)).astype(float)
        return lost * -np.log(LOST), one
    if c.id == "laser.dropout":
        p = np.clip(missing(h, c) * np.isfinite(h.r), 1e-6, 0.9) + LOST
        return p * np.log(p / LOST) + (1 - p) * np.log((1 - p) / (1 - LOST)), one
    if c.id == "laser.mixed_pixels":
        return edges(h.r)[0] * c.size * np.log(c.size / 0.6 / 5e-4), one
    if c.id == "laser.crosstalk":
        middle = np.mod(c.extra["drift"] * h.t + 1.0 + np.pi, 2 * np.pi) - np.pi
        return (np.abs(h.bearing - middle) < c.extra["width"] / 2) * c.size * max(
            np.log(c.size * 0.25 / 5e-4), 0.1
        ), one
    return one * even_gain(c), one


def even_gain(c: Cause) -> float:
    """Gain per reading of what acts on all alike: tails, steps."""
    rng = np.random.default_rng(3)
    if c.id == "laser.quantisation":
        mu = c.size * rng.random(20000)
        k = np.round((mu + rng.normal(0, 0.0024, 20000)) / c.size) * c.size
        mass = [norm.cdf((k - mu + w) / 0.0024) - norm.cdf((k - mu - w) / 0.0024) for w in (c.size / 2, 0.0005)]
        return float(np.mean(np.log(mass[0] / np.maximum(mass[1], 1e-7))))
    z = tails(rng.normal(0, 1, 100000), c, rng)
    if c.other:
        p = c.size * 0.05
        true = (1 - p) * norm.pdf(z) + p * np.where(z > 0, np.exp(-np.maximum(z, 0) / 12) / 12, 0)
    else:
        true = student.pdf(z, 1 / c.size)
    best = min(
        float(np.mean(np.log(true / (0.998 * norm.pdf(z, scale=s) + 0.002 * 0.0025 / 4))))
        for s in (1, 1.1, 1.25, 1.5, 2)
    )
    return max(best, 1e-9)
