# SPDX-License-Identifier: BSD-3-Clause
"""How well a laser effect shows against the readings' noise and the error of the reference pose."""

from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.moor.laser import Cast, Fan, Lens, Lenses, edges, expect, look, optics_of, true_pose
from kurumaisu.bench.strangers.moor.laser_laws import LASER, slant
from kurumaisu.bench.strangers.moor.motion import Motion
from kurumaisu.bench.strangers.moor.whiten import Noise
from kurumaisu.bench.strangers.moor.world import Array, Flags, Room

RIVALS = {"offset": 1e-3, "scale": 1e-3, "mount_x": 5e-3, "mount_y": 5e-3, "mount_yaw": 5e-3, "latency": 0.01}
MOST = 300


@dataclass(frozen=True)
class Scene:
    """The scans of one drive."""

    motion: Motion
    stamps: Array
    seed: int


@dataclass
class Views:
    """What is known of the scenes without any effect: casts, derivatives by the pose, which readings count."""

    scenes: list[Scene]
    fan: Fan
    room: Room
    noise: Noise
    casts: list[Cast]
    slopes: list[Array]
    use: list[Flags]


def views(scenes: list[Scene], fan: Fan, room: Room, noise: Noise) -> Views:
    """Cast all scans, of which never more than 300 count."""
    total = sum(s.stamps.size for s in scenes)
    every = max(1, -(-total // MOST))
    scenes = [Scene(s.motion, s.stamps[::every], s.seed) for s in scenes]
    out = Views(scenes, fan, room, noise, [], [], [])
    for s in scenes:
        first = cast(out, s, [], (0.0, 0.0, 0.0))
        parts = []
        for i, d in enumerate((1e-3, 1e-3, 5e-4)):
            error = (d * (i == 0), d * (i == 1), d * (i == 2))
            parts.append(np.nan_to_num((cast(out, s, [], error).r - first.r) / d, posinf=99, neginf=99))
        slope = np.stack(parts, axis=2)
        out.casts.append(first)
        out.slopes.append(slope)
        out.use.append((first.r < 3.85) & ~edges(first, 0) & (abs(slope).max(axis=2) < 5))
    return out


def cast(v: Views, s: Scene, lenses: Lenses, error: tuple[float, float, float]) -> Cast:
    """The scans of a scene with some effects."""
    return look(s.motion, true_pose(s.motion, error), s.stamps, v.fan, v.room, optics_of(lenses), s.seed)


def gram(v: Views, sets: list[Lenses]) -> Array:
    """Inner products of the signals of sets of effects, whitened by noise, pose error and the reference's drift."""
    n = len(sets)
    total = np.zeros((n, n))
    for s, base, slope, use in zip(v.scenes, v.casts, v.slopes, v.use, strict=True):
        mean, sd = expect(base, [])
        signals = []
        for one in sets:
            part = (
                1.0 if one[0][0].name == "laser.tilt" else 0.02
            )  # all others are linear where no beam meets another face
            moved = one[0][0].kind == "optics"
            c = cast(v, s, [(one[0][0], part * one[0][1])], (0.0, 0.0, 0.0)) if moved else base
            with np.errstate(invalid="ignore"):
                change = (expect(c, one)[0] - mean) / (part if moved else 1.0)
            signals.append(np.where(use & (abs(change) < 0.3) & (c.face == base.face), change, 0.0))
        knots = np.arange(0, s.motion.t[-1] + 20, 20.0)
        prior = v.noise.drift**2 * np.exp(-abs(knots[:, None] - knots) / 60) + 1e-9 * np.eye(knots.size)
        g = np.zeros((n + 2 * knots.size, n + 2 * knots.size))
        inverse = np.diag(1 / np.array([v.noise.position, v.noise.position, v.noise.heading]) ** 2)
        for k, stamp in enumerate(s.stamps):
            on = use[k]
            hats = np.maximum(1 - abs(stamp - knots) / 20, 0)
            j = slope[k][on]
            x = np.concatenate(
                [np.stack([q[k][on] for q in signals], axis=1), j[:, :1] * hats, j[:, 1:2] * hats], axis=1
            )
            x, j = x / sd[k][on, None], j / sd[k][on, None]
            jx = j.T @ x
            g += x.T @ x - jx.T @ np.linalg.solve(inverse + j.T @ j, jx)
        low = np.linalg.inv(np.kron(np.eye(2), prior)) + g[n:, n:]
        total += g[:n, :n] - g[:n, n:] @ np.linalg.solve(low, g[n:, :n])
    return np.asarray(total)


def surprise(v: Views, lens: Lens, size: float) -> tuple[float, float]:
    """The z of scatter or of what happens to single readings; and what is left beside more or less noise."""
    squared, left = 0.0, 0.0
    for base, slope, use in zip(v.casts, v.slopes, v.use, strict=True):
        if lens.kind == "sd":
            ratio = np.log(expect(base, [(lens, size)])[1] / expect(base, [])[1])[use] * 2
            shapes = {"laser.range_noise": 1 + 0 * ratio, "laser.incidence_noise": slant(base)[use], "r": base.r[use]}
            shapes.pop(lens.name, None)
            gain = (np.exp(ratio) - 1 - ratio).sum() * (1 - 3 / v.fan.beams)
            x = np.stack(list(shapes.values()), axis=1)
            rest = ratio - x @ np.linalg.lstsq(x, ratio, rcond=None)[0]
            squared += gain
            left += gain * float(rest @ rest) / max(float(ratio @ ratio), 1e-12)
            continue
        both = 2 * single(base, slope, use, lens, size, v.noise)
        squared, left = squared + both[0], left + both[1]
    return float(np.sqrt(max(squared, 0))), float(np.sqrt(max(left, 0)))


def pair(gain: float) -> Array:
    """A gain that more noise cannot imitate."""
    return np.array([gain, gain])


def single(base: Cast, slope: Array, use: Flags, lens: Lens, size: float, noise: Noise) -> Array:
    """Log likelihood gained, in all and beside more noise; the base allows a stray reading in 10^4, a lost in 2000."""
    trick = lens.act(base, size)
    assert isinstance(trick, dict)
    n, sd = int(use.sum()), expect(base, [])[1]
    met = np.isfinite(base.r) & (base.r < 3.9)
    if "common" in trick:
        gain = 0.0
        for k in range(use.shape[0]):
            j, one = slope[k][use[k]] / sd[k][use[k], None], 1 / sd[k][use[k]]
            p = np.diag(1 / np.array([noise.position, noise.position, noise.heading]) ** 2)
            ratio = size**2 * float(one @ one - one @ j @ np.linalg.solve(p + j.T @ j, j.T @ one))
            gain += 0.5 * (ratio - np.log1p(ratio))
        return pair(gain)
    if "rho" in trick:
        return pair(-0.5 * n * np.log(1 - size**2))
    if "nu" in trick or "outliers" in trick:
        return tails(trick, float(np.median(sd[use])), n)
    if "lost" in trick:
        p = np.clip(np.broadcast_to(np.asarray(trick["lost"]), use.shape), 5e-4, 0.9)[met]
        return pair(np.sum(p * np.log(p / 5e-4) + (1 - p) * np.log((1 - p) / (1 - 5e-4))))
    if "far" in trick:
        return pair(np.sum(met & (base.r * 1.0046 + 0.0588 > np.asarray(trick["far"]))) * np.log(2000))
    if "mixed" in trick:
        return pair(np.sum(edges(base) & met) * (size * np.log(1e4) + (1 - size) * np.log(1 - size)))
    if "noisy" in trick:
        return pair(np.sum(np.asarray(trick["noisy"]) * use) * np.log(1e4))
    return pair(n * np.log(max(float(trick["step"]) / 1e-3, 1.0)))


def tails(trick: dict[str, Array | float], sd: float, n: int) -> Array:
    """Log likelihood gained by long tails over normal noise of the model's size, and over that of the best size."""
    rng = np.random.default_rng(1)
    p, reach = float(trick.get("outliers", 0.0)), float(trick.get("reach", 0.1))
    nu = float(trick.get("nu", 0.0))
    e = sd * (rng.standard_t(nu, 40000) if nu else rng.normal(0, 1, 40000))
    e = e + (rng.random(40000) < p) * rng.normal(0, reach, 40000)

    def normal(size: float) -> Array:
        return np.asarray(np.exp(-0.5 * (e / size) ** 2) / size / np.sqrt(2 * np.pi))

    if nu:
        from scipy.stats import t as student

        true = np.asarray(student.pdf(e / sd, nu)) / sd
    else:
        true = (1 - p) * normal(sd) + p * normal(np.hypot(sd, reach))
    gains = [
        float(np.mean(np.log(true / ((1 - 1e-4) * normal(sd * f) + 1e-4 / 0.4)))) for f in (1, 1.1, 1.2, 1.35, 1.6, 2)
    ]
    return np.array([n * gains[0], n * min(gains)])


def strengths(v: Views, lenses: Lenses, spare: tuple[str, ...] = ()) -> list[tuple[float, float]]:
    """For each effect of the laser: z, and what is left beside the usual rivals and the others."""
    names = {lens.name for lens, _ in lenses} | set(spare)
    linear = [(x, RIVALS[x.name[6:]]) for x in LASER if x.name[6:] in RIVALS and x.name not in names]
    own = [c for c in lenses if c[0].kind in ("mean", "optics")]
    g = gram(v, [[c] for c in own + linear]) if own else np.zeros((0, 0))
    out = []
    for cause in lenses:
        if cause not in own:
            out.append(surprise(v, *cause))
            continue
        i = own.index(cause)
        rest = np.delete(np.arange(len(g)), i)
        part = g[i, rest] @ np.linalg.pinv(g[np.ix_(rest, rest)], rcond=1e-10) @ g[rest, i]
        out.append((float(np.sqrt(g[i, i])), float(np.sqrt(max(g[i, i] - part, 0.0)))))
    return out


def size_for(v: Views, lens: Lens, want: float, sign: float) -> float:
    """The size at which an effect has the z that is wanted, as near as its bounds allow."""
    if lens.kind in ("mean", "optics") and lens.name != "laser.tilt":
        unit = np.sqrt(lens.low * lens.high)
        return float(sign * np.clip(want * unit / np.sqrt(gram(v, [[(lens, unit)]])[0, 0]), lens.low, lens.high))
    sizes = np.exp(np.linspace(np.log(lens.low), np.log(lens.high), 9 if lens.kind == "optics" else 24))
    if lens.kind == "optics":
        z = np.sqrt(np.diag(gram(v, [[(lens, sign * float(s))] for s in sizes])))
    else:
        z = np.array([surprise(v, lens, float(s))[0] for s in sizes])
    order = np.argsort(z)
    return float(sign * np.exp(np.interp(np.log(want), np.log(np.maximum(z[order], 1e-6)), np.log(sizes[order]))))
