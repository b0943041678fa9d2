# SPDX-License-Identifier: BSD-3-Clause
"""How strongly a cause shows in the base: increments whitened by a Kalman filter of the true noise."""

from collections.abc import Sequence

import numpy as np

from kurumaisu.bench.strangers.delta.camera import seen
from kurumaisu.bench.strangers.delta.chair import rough, simulate
from kurumaisu.bench.strangers.delta.core import DT, Array, Cause, Drive, Noise, Setup
from kurumaisu.bench.strangers.delta.law import held
from kurumaisu.bench.strangers.delta.mechanics import Motion

BASE_RIVALS = {
    "base.gain_v": 0.01,
    "base.gain_w": 0.01,
    "base.veer": 0.005,
    "base.delay": 0.02,
    "base.lag_v": 0.02,
    "base.lag_w": 0.02,
    "base.marker_x": 0.01,
    "base.marker_y": 0.01,
}


def body(poses: Array) -> Array:
    """Sum of the increments between neighbouring rows in the body frame: (rows, 3), the first being zero."""
    d, th = np.diff(poses, axis=0), poses[:-1, 2]
    c, s = np.cos(th), np.sin(th)
    step = np.stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0], d[:, 2]], -1)
    return np.vstack([np.zeros(3), step])


def kept(drive: Drive) -> Array:
    """Rows that are not off."""
    return np.flatnonzero(drive.odd == 0)


def blind(drive: Drive) -> Array:
    """Rows whose increments say little: after a gap, or about a contact."""
    t = drive.rows[kept(drive)]
    touched = (t > drive.contact[0] - 0.3) & (t < drive.contact[1] + 0.6) & (drive.contact[0] >= 0)
    return np.asarray((np.diff(t, prepend=t[0]) > 0.3) | touched)


def model(setup: Setup, drive: Drive, causes: Sequence[Cause]) -> Array:
    """Increments between the rows that are kept, by the chair without noise, as the cameras would see them."""
    path = simulate(setup, drive, causes, along=drive.path)
    step = body(seen(setup, drive, path, drive.rows[kept(drive)], causes))
    step[blind(drive)] = 0.0
    return step


def whiten(setup: Setup, drive: Drive, signals: Array, factor: Array | None = None) -> tuple[Array, Array]:
    """Innovations in units of their sd, and their log variances: of signals (rows, 3, columns) of increments."""
    noise, t = setup.noise, drive.rows[kept(drive)]
    v, w = held(drive.commands, round(drive.length / DT))
    share = np.clip((np.abs(v) + np.abs(w)) / 0.05, 0, 1) * (1 if factor is None else factor)
    grid = DT * np.arange(len(v) + 1)
    h = np.diff(t)
    active, way = (
        np.diff(np.interp(t, grid, np.concatenate([[0.0], np.cumsum(u) * DT]))) / h for u in (share, np.abs(v))
    )
    total, lost = np.cumsum(signals, axis=0), blind(drive)
    sd = np.array([noise.sd_v, 1e-5, noise.sd_w])
    meas = np.array([noise.position, noise.position, noise.heading]) ** 2
    slow = np.array([noise.drift, noise.drift, 0.3 * noise.drift]) ** 2
    p = np.zeros((3, 3, 3))
    p[:, 0, 0], p[:, 1, 1], p[:, 2, 2] = sd**2, 1e2, slow
    state = np.zeros((3, 3, signals.shape[2]))
    out, logs = np.zeros((len(t), 3, signals.shape[2])), np.zeros((len(t), 3))
    for k in range(len(t)):
        if k:
            f, q = transition(noise, sd, slow, h[k - 1], active[k - 1], way[k - 1] * h[k - 1])
            q[:, 1, 1] += 100.0 * lost[k]
            state, p = f @ state, f @ p @ f.transpose(0, 2, 1) + q
        hp = p[:, 1, :] + p[:, 2, :]
        s = hp[:, 1] + hp[:, 2] + meas
        e = total[k] - state[:, 1] - state[:, 2]
        gain = hp / s[:, None]
        state = state + gain[:, :, None] * e[:, None, :]
        p = p - gain[:, :, None] * hp[:, None, :]
        out[k], logs[k] = e / np.sqrt(s)[:, None], np.log(s)
    return out[1:], logs[1:]


def transition(noise: Noise, sd: Array, slow: Array, h: float, m: float, way: float) -> tuple[Array, Array]:
    """Transition of (rate's noise, place, drift) over a time, for each of the three channels."""
    tau, a, b = noise.tau, np.exp(-h / noise.tau), np.exp(-h / noise.drift_tau)
    f, q = np.zeros((3, 3, 3)), np.zeros((3, 3, 3))
    f[:, 0, 0], f[:, 1, 0], f[:, 1, 1], f[:, 2, 2] = a, m * tau * (1 - a), 1, b
    q[:, 0, 0] = sd**2 * (1 - a * a)
    q[:, 0, 1] = q[:, 1, 0] = m * sd**2 * tau * (1 - a) ** 2
    q[:, 1, 1] = m * m * sd**2 * tau * tau * np.maximum(2 * h / tau - 3 + 4 * a - a * a, 0) + 1e-14
    q[1, 1, 1] += (way * noise.heading) ** 2
    q[:, 2, 2] = slow * (1 - b * b)
    return f, q


def left_over(columns: Array) -> tuple[float, float]:
    """Norm of the first column, and of what the others leave of it."""
    first, rest = columns[:, 0], columns[:, 1:]
    z = float(np.linalg.norm(first))
    rest = rest[:, np.linalg.norm(rest, axis=0) > 1e-9] if rest.size else rest
    if not rest.size:
        return z, z
    rest = rest / np.linalg.norm(rest, axis=0)
    fit = np.linalg.lstsq(rest, first, rcond=1e-9)[0]
    return z, float(np.linalg.norm(first - rest @ fit))


def without(causes: Sequence[Cause], cause: Cause) -> list[Cause]:
    """The other causes."""
    return [c for c in causes if c is not cause]


def base_strength(
    setup: Setup, causes: Sequence[Cause], cause: Cause, rivals: dict[str, float] | None = None
) -> tuple[float, float]:
    """Norm of a cause's signal in the drives to train, and what rivals and other causes leave of it."""
    if cause.id == "base.process_noise":
        return noise_strength(setup, causes, cause)
    rivals = BASE_RIVALS if rivals is None else rivals
    tried = [Cause(name, size) for name, size in rivals.items() if name not in {c.id for c in causes}]
    others = [c for c in without(causes, cause) if shows_in_base(c)]
    stack = []
    for drive in setup.drives[: setup.train]:
        full = model(setup, drive, causes)
        parts = [full - model(setup, drive, without(causes, c)) for c in (cause, *others)]
        parts += [model(setup, drive, [*causes, c]) - full for c in tried]
        white = whiten(setup, drive, np.stack(parts, -1))[0]
        stack.append(white.reshape(-1, len(parts)))
    return left_over(np.vstack(stack))


def noise_strength(setup: Setup, causes: Sequence[Cause], cause: Cause) -> tuple[float, float]:
    """The same of noise that grows with the rates: by the variances of the innovations."""
    gain = np.zeros(2)
    for drive in setup.drives[: setup.train]:
        v, w = held(drive.commands, round(drive.length / DT))
        m = Motion(DT * np.arange(len(v)), v, w, drive.session, v, w)
        factor = rough(m, cause)
        driving = (np.abs(v) + np.abs(w)) > 0.02
        level = np.full(len(v), np.sqrt(np.mean(factor[driving] ** 2)))
        blank = np.zeros((len(kept(drive)), 3, 1))
        logs = [whiten(setup, drive, blank, f)[1] for f in (factor, np.ones(len(v)), level)]
        for i in (0, 1):
            d = logs[0] - logs[i + 1]
            gain[i] += np.sum((np.exp(d) - 1 - d) / 2)
    z, beside = np.sqrt(2 * gain)
    return float(z), float(beside)


def shows_in_base(cause: Cause) -> bool:
    """Whether a cause acts on the motion or on the reference."""
    if cause.curve:
        return not cause.curve.channel.startswith("range")
    return cause.id.startswith("base.")
