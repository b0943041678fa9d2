# SPDX-License-Identifier: BSD-3-Clause
"""How well a signal in the increments of the pose shows against the noise of rates and reference."""

from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.bench.strangers.moor.base_laws import BASE
from kurumaisu.bench.strangers.moor.motion import Causes, Drive, Law, simulate
from kurumaisu.bench.strangers.moor.world import Array

RIVALS = ("gain_v", "gain_w", "veer", "delay", "lag_v", "lag_w", "marker_x", "marker_y")
SMALL = {"delay": 0.03, "lag_v": 0.06, "lag_w": 0.06}


@dataclass(frozen=True)
class Noise:
    """The true noise: of the rates with its time constant, of a row's position and heading, and the slow drift's."""

    sd_v: float
    sd_w: float
    tau: float
    position: float
    heading: float
    drift: float


def increments(pose: Array) -> Array:
    """Motions between neighbouring rows, in the body frame of the earlier one."""
    d = np.diff(pose, axis=0)
    c, s = np.cos(pose[:-1, 2]), np.sin(pose[:-1, 2])
    return np.stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0], d[:, 2]], axis=1)


def whiten(stamps: Array, pose: Array, grow: Array, noise: Noise, signals: Array) -> tuple[Array, float]:
    """Innovations of signals (rows, 3, n) in increments by a Kalman filter, and the logarithm of all determinants.

    State: both rates' noise and its integral over the interval, the reference's error at this row and the one before.
    """
    q0 = np.array([noise.position**2, noise.position**2, noise.heading**2])
    state, cov = np.zeros((10, signals.shape[2])), np.zeros((10, 10))
    cov[0, 0], cov[1, 1] = noise.sd_v**2, noise.sd_w**2
    cov[4:7, 4:7] = np.diag(q0)
    out, logs = np.empty_like(signals), 0.0
    moves = increments(pose)
    for k, dt in enumerate(np.diff(stamps)):
        a, tau = np.exp(-dt / noise.tau), noise.tau
        f, q = np.zeros((10, 10)), np.zeros((10, 10))
        for i, sd in enumerate((noise.sd_v, noise.sd_w)):
            f[i, i], f[2 + i, i] = a, tau * (1 - a)
            q[i, i], q[2 + i, 2 + i] = 1 - a * a, 2 * tau * dt - tau**2 * (3 - 4 * a + a * a)
            q[i, 2 + i] = q[2 + i, i] = tau * (1 - a) ** 2
            q[np.ix_([i, 2 + i], [i, 2 + i])] *= sd * sd
        f[7:10, 4:7] = np.eye(3)
        q[4:7, 4:7] = np.diag(q0)
        state, cov = f @ state, f @ cov @ f.T + q
        h = np.zeros((3, 10))
        dx, dy, turn = moves[k]
        g = grow[k]
        h[0, 2:4], h[1, 2:4], h[2, 3] = [np.cos(turn / 2), -dy / 2], [np.sin(turn / 2), dx / 2], 1
        h *= g
        c, s = np.cos(pose[k, 2]), np.sin(pose[k, 2])
        h[:3, 4:7] = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        h[:3, 7:10] = -h[:3, 4:7]
        h[0, 9], h[1, 9] = dy, -dx
        slow = 2 * noise.drift**2 * dt / 60 + 1e-10
        inner = h @ cov @ h.T + np.diag([slow, slow, 1e-10])
        root = np.linalg.cholesky(inner)
        inverse = np.linalg.inv(root)
        rest = signals[k] - h @ state
        out[k] = inverse @ rest
        gain = cov @ h.T @ inverse.T @ inverse
        state, cov = state + gain @ rest, cov - gain @ h @ cov
        logs += 2 * float(np.log(np.diag(root)).sum())
    return out, logs


@dataclass(frozen=True)
class Rows:
    """A drive to train with the stamps of its reference."""

    drive: Drive
    stamps: Array


def columns_of(rows: list[Rows], noise: Noise, sets: list[Causes], base: Causes) -> Array:
    """Whitened signals, one column for each set of causes, against the base set."""
    parts = []
    for r in rows:
        now = simulate(r.drive, base)
        zero = increments(now.reference(r.stamps))
        signals = [increments(simulate(r.drive, s).reference(r.stamps)) - zero for s in sets]
        grow = np.interp(r.stamps[1:], now.t, now.grow * r.drive.free)
        white, _ = whiten(r.stamps, now.reference(r.stamps), grow, noise, np.stack(signals, axis=2))
        parts.append(white.reshape(-1, len(sets)))
    return np.concatenate(parts)


def rest_of(column: Array, rivals: Array) -> float:
    """What is left of a column beside others."""
    if rivals.size == 0:
        return float(np.linalg.norm(column))
    scaled = rivals / np.maximum(np.linalg.norm(rivals, axis=0), 1e-9)
    return float(np.linalg.norm(column - scaled @ np.linalg.lstsq(scaled, column, rcond=1e-8)[0]))


def strengths(rows: list[Rows], noise: Noise, causes: Causes, spare: tuple[str, ...] = ()) -> list[tuple[float, float]]:
    """For each cause: z, and what is left beside the usual rivals and the other causes."""
    names = {law.name for law, _ in causes} | set(spare)
    if "base.payload" in names:  # a load is gains and lags of both axes together: one of each pair is rival enough
        names |= {"base.lag_v", "base.lag_w"}
    laws = [law for law in BASE if law.name[5:] in RIVALS and law.name not in names]
    linear: list[Causes] = [[(law, SMALL.get(law.name[5:], 0.02))] for law in laws]
    own = [c for c in causes if c[0].name != "base.process_noise"]
    sets: list[Causes] = [[c] for c in own] + linear
    out, white = [], columns_of(rows, noise, sets, []) if sets else np.zeros((1, 0))
    for law, size in causes:
        if law.name == "base.process_noise":
            z = growth(rows, noise, law, size)
            out.append((z, z))
            continue
        i = own.index((law, size))
        out.append((float(np.linalg.norm(white[:, i])), rest_of(white[:, i], np.delete(white, i, axis=1))))
    return out


def growth(rows: list[Rows], noise: Noise, law: Law, size: float) -> float:
    """The z of noise that grows: what its likelihood gains over the best noise that is the same throughout."""
    gain = 0.0
    motions = [simulate(r.drive, [(law, size)]) for r in rows]
    level = float(np.sqrt(np.mean(np.concatenate([m.grow**2 for m in motions]))))
    flat = replace(noise, sd_v=noise.sd_v * level, sd_w=noise.sd_w * level)
    for r, m in zip(rows, motions, strict=True):
        rng = np.random.default_rng([r.drive.luck, 5])
        pose = m.reference(r.stamps)
        seen = pose + rng.normal(0, 1, pose.shape) * [noise.position, noise.position, noise.heading]
        data = (increments(seen) - increments(simulate(r.drive, [], noise=0.0).reference(r.stamps)))[:, :, None]
        for which, sign, grow in ((noise, 1, m.grow), (flat, -1, np.ones_like(m.t))):
            at = np.interp(r.stamps[1:], m.t, grow * r.drive.free)
            white, logs = whiten(r.stamps, pose, at, which, data)
            gain -= sign * 0.5 * (float(np.sum(white**2)) + logs)
    return float(np.sqrt(max(2 * gain, 0.0)))


def grid_sizes(law: Law, n: int = 14) -> Array:
    """Sizes to try, evenly by their logarithm."""
    return np.asarray(np.exp(np.linspace(np.log(law.low), np.log(law.high), n)))


def size_for(rows: list[Rows], noise: Noise, law: Law, want: float, sign: float) -> float:
    """The size at which an effect has the z that is wanted, as near as its bounds allow."""
    sizes = grid_sizes(law, 5 if law.name == "base.process_noise" else 14)
    if law.name == "base.process_noise":
        z = np.array([growth(rows, noise, law, float(s)) for s in sizes])
    else:
        white = columns_of(rows, noise, [[(law, sign * float(s))] for s in sizes], [])
        z = np.linalg.norm(white, axis=0)
    order = np.argsort(z)
    logs = np.interp(np.log(want), np.log(np.maximum(z[order], 1e-6)), np.log(sizes[order]))
    return float(sign * np.exp(logs))
