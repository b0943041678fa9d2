# SPDX-License-Identifier: BSD-3-Clause
"""The base model: the laws (1), (2), the unicycle (3), the laser's (4), one drive, and a filter that whitens it."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

F = NDArray[np.float64]

UP, UP_0 = 1.32402, 0.127906  # V_f of v > 0
BACK, BACK_0 = 2.07369, -0.108783  # V_f of v < 0
LEFT, LEFT_0 = -0.499211, 0.104181  # V_s of w > 0
RIGHT, RIGHT_0 = -0.469278, -0.169476  # V_s of w < 0
SLOPE, DATUM = 1.004587, 0.058826  # mean of a reading, equation (4)
GATE = (0.06, 4.0)  # data sheet
STEP = 0.001  # data sheet: resolution
CELL = 0.005  # longest time over which rates are constant [s]


@dataclass
class Cause:
    """One thing that is hidden: form 0 is the plain equation."""

    id: str
    p: dict[str, float]
    form: int = 0


@dataclass
class Noise:
    """Sizes of the noise: of the rates, and of the reference."""

    v: float
    w: float
    tau: float
    position: float
    heading: float


@dataclass
class Run:
    """One drive: commands, stamps relative to its start, and the path that was really driven."""

    name: str
    start: float
    pose0: tuple[float, float, float]
    ct: F
    cv: F
    cw: F
    pt: F
    st: F
    seed: int
    columns: dict[str, F] = field(default_factory=dict)
    column_t: F = field(default_factory=lambda: np.zeros(0))
    nv: F = field(default_factory=lambda: np.zeros(0))
    nw: F = field(default_factory=lambda: np.zeros(0))
    t: F = field(default_factory=lambda: np.zeros(0))
    x: F = field(default_factory=lambda: np.zeros(0))
    y: F = field(default_factory=lambda: np.zeros(0))
    th: F = field(default_factory=lambda: np.zeros(0))

    def prepare(self, late: list[float]) -> None:
        """Lay the grid of times, with the commands' edges as they act after some delays."""
        end = max(self.pt[-1], self.st[-1] if len(self.st) else 0.0) + 0.5
        parts = [np.arange(0.0, end, CELL), self.ct, self.pt, self.st]
        parts += [self.ct + d for d in late]
        t = np.unique(np.concatenate(parts))
        self.t = t[(t >= 0.0) & (t <= end)]
        zero = np.zeros(len(self.t))
        self.x, self.y, self.th = zero + self.pose0[0], zero + self.pose0[1], zero + self.pose0[2]

    @property
    def mid(self) -> F:
        """Middle of each cell."""
        return (self.t[1:] + self.t[:-1]) / 2

    def at(self, t: F) -> tuple[F, F, F]:
        """Where the chair really was."""
        return np.interp(t, self.t, self.x), np.interp(t, self.t, self.y), np.interp(t, self.t, self.th)

    def column(self, name: str, t: F) -> F:
        """A column of covariate.csv at any times."""
        return np.interp(t, self.column_t, self.columns[name])


def arr(x: Any) -> F:
    """An array, whatever its type is thought to be."""
    return np.asarray(x, np.float64)


def law(v: F, w: F) -> tuple[F, F]:
    """Voltages of rates, equations (1), (2)."""
    vf = np.where(v > 0, UP * v + UP_0, np.where(v < 0, BACK * v + BACK_0, 0.0))
    vs = np.where(w > 0, LEFT * w + LEFT_0, np.where(w < 0, RIGHT * w + RIGHT_0, 0.0))
    return vf, vs


def unlaw_v(vf: F) -> F:
    """Forward speed of a voltage."""
    return np.where(vf > UP_0, (vf - UP_0) / UP, np.where(vf < BACK_0, (vf - BACK_0) / BACK, 0.0))


def unlaw_w(vs: F, sign: F) -> F:
    """Yaw rate of a voltage, on the branch of the commanded sign."""
    left = np.maximum((vs - LEFT_0) / LEFT, 0.0)
    right = np.minimum((vs - RIGHT_0) / RIGHT, 0.0)
    return np.where(sign > 0, left, np.where(sign < 0, right, 0.0))


def path(t: F, v: F, w: F, u: F, pose0: tuple[float, float, float]) -> tuple[F, F, F]:
    """Integrate rates that are constant over each cell, in closed form."""
    dt = np.diff(t)
    th = pose0[2] + np.concatenate([[0.0], np.cumsum(w * dt)])
    half = w * dt / 2
    chord = np.sinc(half / np.pi) * dt
    m = th[:-1] + half
    x = np.cumsum(chord * (v * np.cos(m) - u * np.sin(m)))
    y = np.cumsum(chord * (v * np.sin(m) + u * np.cos(m)))
    return pose0[0] + np.concatenate([[0.0], x]), pose0[1] + np.concatenate([[0.0], y]), th


def flutter(t: F, tau: float, rng: np.random.Generator) -> F:
    """Stationary noise of variance 1 that forgets with a time constant."""
    a = np.exp(-np.diff(t) / tau)
    kick = np.sqrt(1 - a * a) * rng.standard_normal(len(a))
    out = np.empty(len(t))
    last = out[0] = rng.standard_normal()
    for i, (f, k) in enumerate(zip(a.tolist(), kick.tolist(), strict=True)):
        last = f * last + k
        out[i + 1] = last
    return out


def sigma(r: F) -> F:
    """Standard deviation of a reading, equation (4)."""
    return 0.000199 * r * r - 0.000488 * r + 0.002334


def wrap(a: F) -> F:
    """An angle within a half turn."""
    return (a + np.pi) % (2 * np.pi) - np.pi


def turn(a: F, x: F, y: F) -> tuple[F, F]:
    """A vector turned by an angle."""
    return np.cos(a) * x - np.sin(a) * y, np.sin(a) * x + np.cos(a) * y


@dataclass
class Gains:
    """What a filter does at each row, and what it then knows."""

    f: F  # n-1 x 5 x 5
    k: F  # n x 5 x 3
    white: F  # n x 3 x 3
    p: F  # n x 5 x 5, after the row
    logdet: float


def steps(inc: F, dt: F, noise: Noise, grow_v: F, grow_w: F) -> tuple[F, F]:
    """Transitions and their noise, for n increments; state: error in the body frame, noise of the rates."""
    n, tau = len(dt), noise.tau
    a = np.exp(-dt / tau)
    gain, var_n, cov = tau * (1 - a), 1 - a * a, tau * (1 - a) ** 2
    var_i = tau * tau * np.maximum(2 * dt / tau - 3 + 4 * a - a * a, 0.0)
    phi, c, s = inc[:, 2], np.cos(inc[:, 2]), np.sin(inc[:, 2])
    f = np.zeros((n, 5, 5))
    f[:, 0, 0], f[:, 0, 1], f[:, 1, 0], f[:, 1, 1] = c, s, -s, c
    f[:, 0, 2], f[:, 1, 2] = -c * inc[:, 1] + s * inc[:, 0], s * inc[:, 1] + c * inc[:, 0]
    f[:, 2, 2] = 1.0
    g = np.zeros((n, 5, 2))  # how the integrals of the noise enter
    ch, sh = np.cos(phi / 2), np.sin(phi / 2)
    g[:, 0, 0], g[:, 1, 0] = ch, -sh
    g[:, 0, 1] = (-c * inc[:, 1] + s * inc[:, 0]) / 2
    g[:, 1, 1] = (s * inc[:, 1] + c * inc[:, 0]) / 2
    g[:, 2, 1] = 1.0
    f[:, :, 3], f[:, :, 4] = g[:, :, 0] * (gain * grow_v)[:, None], g[:, :, 1] * (gain * grow_w)[:, None]
    f[:, 3, 3] = f[:, 4, 4] = a
    q = np.zeros((n, 5, 5))
    for j, (size, grow) in enumerate(((noise.v, grow_v), (noise.w, grow_w))):
        m = g[:, :, j] * grow[:, None]
        q += size**2 * var_i[:, None, None] * m[:, :, None] * m[:, None, :]
        q[:, :, 3 + j] += size**2 * cov[:, None] * m
        q[:, 3 + j, :] += size**2 * cov[:, None] * m
        q[:, 3 + j, 3 + j] += size**2 * var_n
    return f, q


def gains(t: F, inc: F, noise: Noise, seen: F | None = None, grow: tuple[F, F] | None = None) -> Gains:
    """Run the covariances of the filter."""
    n = len(t)
    one = np.ones(n - 1)
    f, q = steps(inc, np.diff(t), noise, *(grow if grow is not None else (one, one)))
    r = np.diag([noise.position**2, noise.position**2, noise.heading**2])
    p = np.diag([100.0, 100.0, 10.0, noise.v**2, noise.w**2])
    out = Gains(f, np.zeros((n, 5, 3)), np.zeros((n, 3, 3)), np.zeros((n, 5, 5)), 0.0)
    for i in range(n):
        if i:
            p = f[i - 1] @ p @ f[i - 1].T + q[i - 1]
        if seen is None or seen[i]:
            s = p[:3, :3] + r
            low = np.linalg.inv(np.linalg.cholesky(s))
            k = p[:, :3] @ (low.T @ low)
            p = p - k @ p[:3]
            p = (p + p.T) / 2
            out.k[i], out.white[i] = k, low
            if i:
                out.logdet -= 2 * float(np.log(np.diag(low)).sum())
        out.p[i] = p
    return out


def whiten(g: Gains, inc: F, signals: list[F]) -> F:
    """Differences of increments (each n-1 x 3) as white numbers: 3n x m."""
    n, m = len(g.k), len(signals)
    stack = np.stack(signals, axis=2)  # n-1, 3, m
    c, s = np.cos(inc[:, 2])[:, None], np.sin(inc[:, 2])[:, None]
    x, y = stack[:, 0].copy(), stack[:, 1].copy()
    stack[:, 0], stack[:, 1] = c * x + s * y, -s * x + c * y
    e, out = np.zeros((5, m)), np.zeros((n, 3, m))
    for i in range(n):
        if i:
            e = g.f[i - 1] @ e
            e[:3] += stack[i - 1]
        out[i] = g.white[i] @ e[:3]
        e = e - g.k[i] @ e[:3]
    return out.reshape(3 * n, m)


def add(pose: F, d: F) -> F:
    """A pose moved in its own frame."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([pose[0] + c * d[0] - s * d[1], pose[1] + s * d[0] + c * d[1], pose[2] + d[2]])


def between(a: F, b: F) -> F:
    """Pose b in the frame of pose a."""
    c, s = np.cos(a[2]), np.sin(a[2])
    x, y = b[0] - a[0], b[1] - a[1]
    return np.array([c * x + s * y, -s * x + c * y, b[2] - a[2]])


def follow(g: Gains, inc: F, rows: F, seen: F | None = None) -> tuple[F, F]:
    """Filter the rows: white innovations n x 3, and what is known after each row, n x 5."""
    n = len(rows)
    pose, rest, white, known = rows[0].copy(), np.zeros(2), np.zeros((n, 3)), np.zeros((n, 5))
    for i in range(n):
        if i:
            q = g.f[i - 1]
            pose = add(pose, inc[i - 1])
            d = q[:3, 3:] @ rest  # in the frame after the increment
            pose, rest = add(pose, d), q[3:, 3:] @ rest
        if seen is None or seen[i]:
            v = between(pose, rows[i])
            v[2] = wrap(v[2])
            white[i] = g.white[i] @ v
            d5 = g.k[i] @ v
            pose, rest = add(pose, d5[:3]), rest + d5[3:]
        known[i, :3], known[i, 3:] = pose, rest
    return white, known


def ahead(g: Gains, inc: F, q: F, known: F, row: F, span: tuple[int, int], noise: Noise) -> tuple[F, F]:
    """Motion that the reference would measure between two rows, seen at the first: means and deviations."""
    i, j = span
    pose, rest, p = known[i, :3], known[i, 3:], g.p[i]
    for k in range(i, j):
        pose = add(add(pose, inc[k]), g.f[k][:3, 3:] @ rest)
        rest = g.f[k][3:, 3:] @ rest
        p = g.f[k] @ p @ g.f[k].T + q[k]
    mean = between(row, pose)
    a = pose[2] - row[2]
    r = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    var = r @ p[:2, :2] @ r.T
    own = np.array([noise.position, noise.position, noise.heading]) ** 2
    return mean, np.sqrt(np.array([var[0, 0], var[1, 1], p[2, 2]]) + own)


def project(gram: F, true: int, rivals: list[int]) -> tuple[float, int]:
    """What is left of a signal when the best of some rivals is taken out, and which that is."""
    best, who = float(gram[true, true]), -1
    for r in rivals:
        if gram[r, r] > 1e-12:
            left = float(gram[true, true] - gram[true, r] ** 2 / gram[r, r])
            if left < best:
                best, who = left, r
    return float(np.sqrt(max(best, 0.0))), who


def project_all(gram: F, true: int, others: list[int]) -> float:
    """What is left of a signal when some others together are taken out."""
    a = gram[np.ix_(others, others)]
    b = gram[others, true]
    left = gram[true, true] - b @ np.linalg.pinv(a, rcond=1e-10) @ b
    return float(np.sqrt(max(left, 0.0)))
