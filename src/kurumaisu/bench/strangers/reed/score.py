# SPDX-License-Identifier: BSD-3-Clause
"""How clearly an effect of the base shows: whitened differences, z, and what no other effect explains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.reed.base import BASE, DISCRETE
from kurumaisu.bench.strangers.reed.core import Array, Drive, Noise, Use, increments, reference, simulate

Pose = tuple[float, float, float]


@dataclass
class Ride:
    """A drive with its pose at the start and the stamps of its reference."""

    drive: Drive
    pose: Pose
    stamps: Array
    scans: Array


def _step(sd: float, tau: float, dt: float) -> tuple[float, float, float, float, float]:
    """Of integrated Ornstein-Uhlenbeck noise over dt: decay, reach, and the three covariances."""
    e = float(np.exp(-dt / tau))
    reach = tau * (1 - e)
    qaa = sd**2 * (2 * tau * (dt - reach) - reach**2)
    return e, reach, max(qaa, 0.0), sd**2 * reach * (1 - e), sd**2 * (1 - e**2)


def _filter(columns: Array, dts: Array, sds: Array, tau: float, err: float, extra: Array) -> tuple[Array, Array]:
    """Innovations of increments divided by their sds, and those sds squared."""
    mean_a, mean_n = np.zeros(columns.shape[1]), np.zeros(columns.shape[1])
    paa, pan, pnn = err**2, 0.0, float(sds[0]) ** 2
    total, out, var = np.cumsum(columns, axis=0), np.empty_like(columns), np.empty(len(dts))
    for k, dt in enumerate(dts.tolist()):
        e, reach, qaa, qan, qnn = _step(float(sds[k]), tau, dt)
        mean_a, mean_n = mean_a + reach * mean_n, e * mean_n
        paa = paa + 2 * reach * pan + reach**2 * pnn + qaa + float(extra[k])
        pan, pnn = e * (pan + reach * pnn) + qan, e * e * pnn + qnn
        s = paa + err**2
        innovation = total[k] - mean_a
        ga, gn = paa / s, pan / s
        mean_a, mean_n = mean_a + ga * innovation, mean_n + gn * innovation
        paa, pan, pnn = paa * (1 - ga), pan * (1 - ga), pnn - gn * pan
        out[k], var[k] = innovation / np.sqrt(s), s
    return out, var


def whiten(d: Array, rows: Array, stamps: Array, noise: Noise) -> Array:
    """Columns of differences of increments (K, 3, m), whitened and laid end to end."""
    dts, ones = np.diff(stamps), np.ones(len(stamps) - 1)
    way = np.hypot(*np.diff(rows[:, :2], axis=0).T)
    twist, none = (np.diff(rows[:, 2]) * noise.pos) ** 2, np.zeros(len(dts))
    sway = (way * noise.head) ** 2 + twist
    parts = [
        _filter(d[:, 0], dts, ones * noise.sd_v, noise.tau, noise.pos, twist)[0],
        _filter(d[:, 1], dts, ones * 1e-6, noise.tau, noise.pos, sway)[0],
        _filter(d[:, 2], dts, ones * noise.sd_w, noise.tau, noise.head, none)[0],
    ]
    return np.concatenate(parts)


def rows_of(ride: Ride, uses: list[Use]) -> Array:
    """What an errorless reference reads of a drive with some effects."""
    m, path = simulate(ride.drive, uses, ride.pose)
    return reference(m, path, ride.stamps)


def growth(ride: Ride, uses: list[Use], noise: Noise) -> float:
    """Twice the expected log likelihood ratio of noise that grows, over noise of the best fixed size."""
    m, _ = simulate(ride.drive, uses, ride.pose)
    dts, grown = np.diff(ride.stamps), np.interp(ride.stamps[:-1], m.t, m.grow)
    blank, total = np.zeros((len(dts), 1)), 0.0
    for sd, err in ((noise.sd_v, noise.pos), (noise.sd_w, noise.head)):
        mean = float(np.sqrt(np.mean(grown**2)))
        true = _filter(blank, dts, sd * grown, noise.tau, err, np.zeros(len(dts)))[1]
        fixed = _filter(blank, dts, sd * mean * np.ones(len(dts)), noise.tau, err, np.zeros(len(dts)))[1]
        total += float(np.sum(true / fixed - 1 - np.log(true / fixed)))
    return total


def hidden(rides: list[Ride], uses: list[Use], noise: Noise) -> list[Array]:
    """For each effect, what it makes of the training data beside all the others, whitened."""
    parts: list[list[Array]] = [[] for _ in uses]
    for ride in rides:
        full = rows_of(ride, uses)
        base = increments(full)
        d = [base - increments(rows_of(ride, [o for o in uses if o is not use])) for use in uses]
        white = whiten(np.stack(d, axis=2), full, ride.stamps, noise)
        for k in range(len(uses)):
            parts[k].append(white[:, k])
    return [np.concatenate(part) for part in parts]


def others(rides: list[Ride], names: list[str], noise: Noise) -> dict[str, Array]:
    """Small-signal responses of other effects, whitened, of unit size each."""
    parts: dict[str, list[Array]] = {name: [] for name in names}
    extra = {"period": 8.0, "odd": False, "length": 0.3}
    uses = [
        Use(
            BASE[name.split("~")[0]],
            BASE[name.split("~")[0]].size,
            False,
            {**extra, "phase": 1.571 if name.endswith("~y") else 0.0},
        )
        for name in names
    ]
    for ride in rides:
        plain = rows_of(ride, [])
        d = [increments(rows_of(ride, [use])) - increments(plain) for use in uses]
        white = whiten(np.stack(d, axis=2), plain, ride.stamps, noise)
        for k, name in enumerate(names):
            parts[name].append(white[:, k])
    return {name: np.concatenate(part) for name, part in parts.items()}


def candidates(robot: str, law: str) -> list[str]:
    """All effects that a robot can have, by small signals."""
    skip = {"base.process_noise", *DISCRETE}
    names = [n for n in BASE if n not in skip and ((robot == "md100" and law == "corrected") or BASE[n].stage != 1)]
    return [*names, "base.slope~y"]


def beside(named: dict[str, Array], rest: dict[str, Array]) -> dict[str, tuple[float, dict[str, float]]]:
    """For each named effect, the least norm that the other named ones and any single other leave; and each norm."""
    rest = {k: v for k, v in rest.items() if k.split("~")[0] not in named and float(v @ v) > 1e-6}
    table = np.stack([*named.values(), *rest.values()])
    gram, count = table @ table.T, len(named)
    out: dict[str, tuple[float, dict[str, float]]] = {}
    for k, me in enumerate(named):
        left: dict[str, float] = {}
        for j, name in enumerate(["", *rest]):
            against = [i for i in range(count) if i != k and gram[i, i] > 1e-9] + [count + j - 1] * bool(j)
            share = np.linalg.lstsq(gram[np.ix_(against, against)], gram[against, k], rcond=1e-10)[0]
            left[name] = float(np.sqrt(max(gram[k, k] - gram[against, k] @ share, 0.0)))
        out[me] = (min(left.values()), left)
    return out
