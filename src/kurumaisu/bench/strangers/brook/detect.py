# SPDX-License-Identifier: BSD-3-Clause
"""How well a hidden cause shows: z and what remains of it beside other effects, by the true noise.

The deviation of the chair from its path is a linear system in the heading's frame: ahead a, left l, heading q, the
coloured noise of both rates, and the reference's drift. With every row whitened, A x = y + unit noise; what of a signal
y is left after least squares over x has the squared norm s' C^-1 s, C the covariance of the poses given a free start,
i.e. of their increments; with scans, C that of readings and poses together. Scatter: half the summed squares of the
relative change of variance. Rare large errors: 25 at most per reading.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.sparse import coo_matrix, csr_matrix

from .catalogue import BENT, USUAL_BASE, Effect
from .effects import simulate
from .plant import Arr, Motion, Noise, Run, integral

STEP, COARSE = 0.04, 10  # of the chain [s], of signals [ms]
TINY = 2e-5
Ints = npt.NDArray[np.int64]


@dataclass
class Chain:
    """The whitened system of one drive, factored: rows of poses first after the prior's, then those of readings."""

    a: csr_matrix
    factor: Arr
    prior: int
    sd: Arr

    def rest(self, y: Arr) -> Arr:
        """What least squares over the chair's own freedom leaves of signals y (measured rows, signals), whitened."""
        full = np.concatenate((np.zeros((self.prior, y.shape[1])), y / self.sd[:, None]))
        x = cho_solve_banded((self.factor, True), self.a.T @ full)
        return np.asarray(full - self.a @ x)


def _weights(t: Arr, n: int) -> tuple[Ints, Arr]:
    k = np.clip((t / STEP).astype(np.int64), 0, n - 2)
    return k, t / STEP - k


def chain(m: Motion, t: Arr, noise: Noise, scans: tuple[Arr, Arr, Arr] | None = None) -> Chain:
    """Build it for poses at t, and for readings at scans = (times, gradients (n, 3) over a, l, q, sd)."""
    n = int(np.ceil(m.t[-1] / STEP)) + 1
    at = np.arange(n) * STEP
    turn = np.diff(np.interp(at, m.t, np.unwrap(m.pose[2])))
    c, s, way = np.cos(turn), np.sin(turn), np.diff(np.interp(at, m.t, integral(m.v, m.t[1] - m.t[0])))
    hc, hs = np.cos(turn / 2), np.sin(turn / 2)
    g = np.interp(at[:-1] + STEP / 2, m.t, m.moving) * STEP / 2
    rv, rw, rd = (np.exp(-STEP / x) for x in (noise.tv, noise.tw, noise.td))
    dp, dh = max(noise.dp, 1e-5), max(noise.dh, 1e-5)
    one = np.ones(n - 1)
    terms = [  # equation, state now or next, value, sd
        (0, [(8, one), (0, -c), (1, -s), (3, -g * hc), (11, -g * hc), (2, -way / 2 * hs), (10, -way / 2 * hs)], TINY),
        (1, [(9, one), (0, s), (1, -c), (3, g * hs), (11, g * hs), (2, -way / 2 * hc), (10, -way / 2 * hc)], TINY),
        (2, [(10, one), (2, -one), (4, -g), (12, -g)], TINY),
        (3, [(11, one), (3, -rv * one)], noise.sv * np.sqrt(1 - rv**2)),
        (4, [(12, one), (4, -rw * one)], noise.sw * np.sqrt(1 - rw**2)),
        (5, [(13, one), (5, -rd * c), (6, -rd * s)], dp * np.sqrt(1 - rd**2)),
        (6, [(14, one), (6, -rd * c), (5, rd * s)], dp * np.sqrt(1 - rd**2)),
        (7, [(15, one), (7, -rd * one)], dh * np.sqrt(1 - rd**2)),
    ]
    k = np.arange(n - 1)
    rows, cols, vals = [np.arange(5)], [np.arange(3, 8)], [1 / np.array([noise.sv, noise.sw, dp, dp, dh])]
    for eq, parts, sd in terms:
        for col, val in parts:
            rows.append(5 + 8 * k + eq)
            cols.append(8 * k + col)
            vals.append(val / sd)
    prior = 5 + 8 * (n - 1)
    v, w = np.interp(t, m.t, m.v0), np.interp(t, m.t, m.w0)
    sds = [np.hypot(noise.p, v * noise.jitter), np.full(len(t), noise.p), np.hypot(noise.h, w * noise.jitter)]
    i, f = _weights(t, n)
    for ch in range(3):
        for near, share in ((0, 1 - f), (8, f)):
            for state in (ch, ch + 5):
                rows.append(prior + ch * len(t) + np.arange(len(t)))
                cols.append(8 * i + near + state)
                vals.append(share / sds[ch])
    sd_all = np.concatenate(sds)
    if scans is not None:
        i, f = _weights(scans[0], n)
        for ch in range(3):
            for near, share in ((0, 1 - f), (8, f)):
                rows.append(prior + len(sd_all) + np.arange(len(i)))
                cols.append(8 * i + near + ch)
                vals.append(share * scans[1][:, ch] / scans[2])
        sd_all = np.concatenate((sd_all, scans[2]))
    shape = (prior + len(sd_all), 8 * n)
    a = coo_matrix((np.concatenate(vals), (np.concatenate(rows), np.concatenate(cols))), shape=shape).tocsr()
    normal = (a.T @ a).tocoo()
    band, low = np.zeros((16, 8 * n)), normal.row >= normal.col
    band[(normal.row - normal.col)[low], normal.col[low]] = normal.data[low]
    return Chain(a, cholesky_banded(band, lower=True), prior, sd_all)


def deviation(with_: Motion, without: Motion, path: Motion) -> Arr:
    """(3, n): how far a, l, q of the measured pose deviate, to first order, along a path."""
    dt, c, s, on = path.t[1] - path.t[0], path.cs[0], path.cs[1], path.moving
    q = integral((with_.w0 - without.w0) * on, dt)
    dv, dl = (with_.v0 - without.v0) * on, (with_.lat - without.lat) * on + path.v * q
    x, y = integral(dv * c - dl * s, dt), integral(dv * s + dl * c, dt)
    late = (with_.clock - without.clock) * path.t
    ref = with_.ref - without.ref
    return np.array([x * c + y * s + ref[0] - late * path.v, y * c - x * s + ref[1], q + ref[2] - late * path.w])


def sampled(d: Arr, m: Motion, t: Arr) -> Arr:
    """Deviations at the rows' times, in the order of the chain's rows."""
    return np.concatenate([np.interp(t, m.t, d[k]) for k in range(3)])


def catalogue(more: dict[str, dict[str, float]], skip: set[str]) -> list[Effect]:
    """The other effects, at several sizes where size bends the signal."""
    out = []
    for ident, size in USUAL_BASE.items():
        if ident in skip:
            continue
        for k in (0.4, 2.0) if ident in BENT else (0.5,):
            if ident == "base.saturation":
                out += [
                    Effect(ident, k * size, more={"axis": a, "top": more["top"]["v" if a == 0 else "w"]})
                    for a in (0.0, 1.0)
                ]
            elif ident == "base.slope":
                out += [Effect(ident, k * size, more={"uphill": a}) for a in (0.0, np.pi / 2)]
            elif ident == "base.caster_reversal":
                out += [Effect(ident, k * size, more={"length": a}) for a in (0.15, 0.35)]
            else:
                out.append(Effect(ident, k * size))
    return out


@dataclass
class Fit:
    """The runs to fit as the measures see them: run, motion at a coarse step, rows' times."""

    runs: list[Run]
    paths: list[Motion]
    times: list[Arr]
    noise: Noise
    chains: list[Chain]

    def signal(self, with_: list[Effect], without: list[Effect]) -> list[Arr]:
        """Signals of the rows of each run: simulated with less simulated without, no noise, on the true path."""
        out = []
        for run, path, t in zip(self.runs, self.paths, self.times, strict=True):
            a, b = (simulate(run, e, None, COARSE, given=path.pose.copy()) for e in (with_, without))
            out.append(sampled(deviation(a, b, path), path, t))
        return out

    def gram(self, signals: list[list[Arr]]) -> Arr:
        """Whitened inner products of signals, over all runs."""
        total = np.zeros((len(signals), len(signals)))
        for k, c in enumerate(self.chains):
            left = c.rest(np.stack([s[k] for s in signals], axis=1))
            total += left.T @ left
        return total


def beside(gram: Arr, first: int, groups: dict[str, list[int]]) -> dict[str, float]:
    """Norm that remains of signal `first` after least squares by each group of signals alone."""
    out = {}
    for name, cols in groups.items():
        sub = gram[np.ix_(cols, cols)] + 1e-9 * np.diag(gram[cols, cols] + 1e-9)
        b = gram[cols, first]
        out[name] = float(np.sqrt(max(gram[first, first] - b @ np.linalg.solve(sub, b), 0.0)))
    return out
