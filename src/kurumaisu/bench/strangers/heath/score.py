# SPDX-License-Identifier: BSD-3-Clause
"""How much is hidden: whitened norms by a Kalman filter (base) and scan by scan (laser), and what rivals leave."""

from collections.abc import Callable, Container
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .base import BASE
from .chair import Hidden, Run, drift, model, pose, reference
from .laser import LASER, Fan, Room, look

Array = NDArray[Any]
H = np.hstack([np.eye(3), np.zeros((3, 2)), np.eye(3)])
SIZES = {
    "base.lag_v": (0.08, 0.4),
    "base.lag_w": (0.08, 0.4),
    "base.delay": (0.05, 0.3),
    "base.saturation": (1.6, 3.0),
    "base.dead_zone_v": (0.03, 0.15),
    "base.dead_zone_w": (0.03, 0.12),
}
SHAPES = {
    "base.slope": [(0.02, {"way": a}) for a in (0.0, 1.5708)],
    "base.accel_limit": [(a, {"slowness_w": b}) for a, b in ((1.5, 0.01), (0.01, 0.8), (4, 0.01))],
    "base.payload": [(0.05, {"tau": 0.001}), (0.001, {"tau": 0.15})],
    "laser.cyclic": [(0.003, {"wavelength": w, "phase": f}) for w in (1.2, 3) for f in (0, 1.57)],
}
FREE = {
    True: {
        "constant v": ("rate", "v = v + 0.01 * (v != 0)"),
        "constant w": ("rate", "w = w + 0.01 * ((v != 0) | (w != 0))"),
        "constant w, always": ("rate", "w = w + 0.01"),
    },
    False: {
        "laser.beam_bias": ("mean", "mu = mu + 0.003 * sin(beta)"),
        "over the beams": ("mean", "mu = mu + 0.003 * cos(beta)"),
        "share": ("sd", "sd = sd * 1.1"),
        "slope": ("sd", "sd = sd + 0.0003 * r"),
    },
}


@dataclass
class Noise:
    """Standard deviations of the rates with their time constant, and of the reference, a share of it coloured."""

    sd_v: float
    sd_w: float
    tau: float
    position: float
    heading: float
    share: float
    tau_c: float

    def rows(self) -> Array:
        """Return variances of a row of the reference."""
        return np.array([self.position, self.position, self.heading]) ** 2


def advance(x: Array, p: Array, run: Run, noise: Noise, t0: float, t1: float) -> tuple[Array, Array]:
    """Move the filter's state (errors x, y, theta; noise of v, w; coloured errors) to t1 along the true path."""
    parts = max(1, int(np.ceil((t1 - t0) / 0.25)))
    at, d, tau = pose(run, np.linspace(t0, t1, parts + 1)), (t1 - t0) / parts, noise.tau
    a, ac = np.exp(-d / tau), np.exp(-d / noise.tau_c)
    g = tau * (1 - a)
    cov = np.array([[tau**2 * (2 * d / tau - 3 + 4 * a - a * a), tau * (1 - a) ** 2], [tau * (1 - a) ** 2, 1 - a * a]])
    f, b = np.diag([1, 1, 1, a, a, ac, ac, ac]), np.zeros((8, 4))
    f[2, 4] = g
    b[2, 2] = b[3, 1] = b[4, 3] = 1
    q, extra = np.kron(np.diag([noise.sd_v**2, noise.sd_w**2]), cov), np.zeros(8)
    extra[5:] = noise.rows() * noise.share * (1 - ac * ac)
    for k in range(parts):
        m, (dx, dy) = (at[k, 2] + at[k + 1, 2]) / 2, at[k + 1, :2] - at[k, :2]
        c, s = np.cos(m), np.sin(m)
        f[0, 2:5], f[1, 2:5] = (-dy, c * g, -dy / 2 * g), (dx, s * g, dx / 2 * g)
        b[0, 0], b[1, 0], b[0, 2], b[1, 2] = c, s, -dy / 2, dx / 2
        x, p = f @ x, f @ p @ f.T + b @ q @ b.T + np.diag(extra)
    return x, p


def kalman(
    run: Run, noise: Noise, times: Array, data: Array, keep: Container[int] = ()
) -> tuple[Array, dict[int, tuple[Array, Array]]]:
    """Return whitened columns of data (rows, 3, columns), and the states after the rows in `keep`."""
    p = np.diag([100.0, 100.0, 10.0, noise.sd_v**2, noise.sd_w**2, *noise.rows() * noise.share])
    r, kept = np.diag(noise.rows() * (1 - noise.share)), {}
    x, white = np.zeros((8, data.shape[2])), np.zeros(data.shape)
    for k, t in enumerate(times):
        if k:
            x, p = advance(x, p, run, noise, times[k - 1], t)
        hp = H @ p
        s, miss = hp @ H.T + r, data[k] - H @ x
        white[k] = np.linalg.solve(np.linalg.cholesky(s), miss) if k else 0
        gain = np.linalg.solve(s, hp).T
        x, p = x + gain @ miss, p - gain @ hp
        p = (p + p.T) / 2
        if k in keep:
            kept[k] = (x, p)
    return white.reshape(-1, data.shape[2]), kept


def hide(name: str, form: str, size: float, shape: dict[str, float] | None = None) -> Hidden:
    """Return a cause of the tables in one of its forms."""
    line = (BASE | LASER)[name]
    return Hidden(
        name,
        form,
        line.stage,
        line.forms[form],
        size,
        shape or {k: (a + b) / 2 for k, (a, b) in line.others.items()},
        line,
    )


def rivals(base: bool) -> list[tuple[str, list[Hidden]]]:
    """Return every plain effect at one or several sizes, constants and gains."""
    out = []
    for name, line in (BASE if base else LASER).items():
        if line.stage not in ("eps", "read") and name.split(".")[1] not in ("temperature", "steering_law", "beam_bias"):
            shapes = SHAPES.get(name, [(a, None) for a in SIZES.get(name, (line.low * 2,))])
            out.append((name, [hide(name, "plain", a, q) for a, q in shapes]))
    return out + [(n, [Hidden(n, "", stage, rule)]) for n, (stage, rule) in FREE[base].items()]


def base_signals(runs: list[Run], noise: Noise, things: list[Hidden], step: float = 0.2) -> Array:
    """Return the Gram matrix of the whitened signals of things along the true paths."""
    gram = np.zeros((len(things), len(things)))
    for run in runs:
        t, zero = np.arange(step, run.length, step), model(run, [], run.path.middle)
        signals = [
            reference(run, [c], t) - pose(run, t) if c.stage in ("ref", "clock") else drift(run, [c], t, zero)
            for c in things
        ]
        white, _ = kalman(run, noise, t, np.stack(signals, -1))
        gram += white.T @ white
    return gram


def laser_signals(
    runs: list[Run], noise: Noise, room: Room, fan: Fan, times: list[Array], things: list[Hidden], most: int = 24000
) -> Array:
    """Return the Gram matrix of the whitened signals of things in the readings, each scan's pose being uncertain."""
    gram = np.zeros((len(things), len(things)))
    every = max(1, int(np.ceil(sum(map(len, times)) * fan.beams / most)))
    shifts = [Hidden("", "", "geo", rule) for rule in ("mx += 1e-4", "my += 1e-4", "myaw += 1e-4; my += 3e-5")]
    for run, t in zip(runs, (t[::every] for t in times), strict=True):
        g = look(room, fan, run, t, [])
        ok, mean, spread = (g.mu < 3.95) & ~g.edge, [], []
        for c in shifts + things:
            h = look(room, fan, run, t, [c])
            by, top = (1.0, 60.0) if c.id else (1e4, 1e4)
            mean.append(np.where(ok & ~h.edge, np.clip((h.mu - g.mu) / g.sd * by, -top, top), 0))
            spread.append(np.where(ok, np.clip((h.sd / g.sd) ** 2 - 1, -3, 6) / np.sqrt(2), 0))
        j, a, u = np.stack(mean[:3], -1), np.stack(mean[3:], -1), np.stack(spread[3:], -1)
        ja = np.einsum("sbi,sbk->sik", j, a)
        inner = np.linalg.solve(np.diag(4 / noise.rows()) + np.einsum("sbi,sbk->sik", j, j), ja)
        both = np.concatenate([a, u], axis=0)
        gram += every * (np.einsum("sbi,sbk->ik", both, both) - np.einsum("sik,sil->kl", ja, inner))
    return gram


def left(gram: Array, mine: int, others: list[int]) -> float:
    """Return the norm of column `mine` without what the others explain linearly."""
    scale = np.sqrt(np.maximum(np.diag(gram)[others], 1e-12))
    inner = gram[np.ix_(others, others)] / np.outer(scale, scale) + 1e-9 * np.eye(len(others))
    b = gram[others, mine] / scale
    return float(np.sqrt(max(gram[mine, mine] - b @ np.linalg.solve(inner, b), 0)))


def compare(
    signals: Callable[[list[Hidden]], Array], causes: list[Hidden], base: bool
) -> list[tuple[float, float, dict[str, float]]]:
    """Return for each cause z, beside (its companions fitted, too), and what each rival alone leaves."""
    table = [(n, f) for n, f in rivals(base) if n not in {c.id for c in causes}]
    gram, out = signals(list(causes) + [f for _, group in table for f in group]), []
    for k, _ in enumerate(causes):
        rest, at, leaves = [i for i in range(len(causes)) if i != k], len(causes), {}
        for name, group in table:
            leaves[name] = left(gram, k, rest + list(range(at, at + len(group))))
            at += len(group)
        out.append((left(gram, k, []), min([left(gram, k, rest), *leaves.values()]), leaves))
    return out
