# SPDX-License-Identifier: BSD-3-Clause
"""How sure hidden causes are: z, and beside what else is hidden and the worst rival."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from kurumaisu.bench.strangers.quay.base import Drive, Effects, growth, mean_path, rates
from kurumaisu.bench.strangers.quay.causes import ALL, SCATTER, VOLTS, draw
from kurumaisu.bench.strangers.quay.fan import Fan
from kurumaisu.bench.strangers.quay.reading import Sure
from kurumaisu.bench.strangers.quay.reference import motion_cov, refer, relative
from kurumaisu.bench.strangers.quay.things import Array, Rng, Scene

NEED = 10.0  # z of what counts
NO_RIVALS = {
    *SCATTER,
    *("base.process_noise", "base.sign", "base.steering_law", "laser.beam_bias", "world.map_error"),
}
SEEN = ("laser", "world", "base.marker", "base.clock", "unknown")


def _chain(dr: Drive) -> Array:
    """Return stamps of rows of the reference 1 s apart, those that are off aside."""
    keep, last = [], -9.0
    for t in dr.pose_t[~dr.off].tolist():
        if t - last >= 0.999:
            keep.append(t)
            last = t
    return np.array(keep)


class Judge:
    """Effects of causes on the training drives, whitened by the noise."""

    def __init__(self, drives: list[Drive], scene: Scene) -> None:
        self.drives, self.scene = [(d, _chain(d)) for d in drives], scene
        robot, ref = scene.robot, scene.ref
        self.chol = [cho_factor(motion_cov(d, robot, ref, t, np.ones(d.n))) for d, t in self.drives]
        self.base = [self._motion(d, t, {}) for d, t in self.drives]
        self.fans = [Fan(d, scene) for d in drives] if scene.laser else []

    def _motion(self, d: Drive, t: Array, eff: Effects) -> Array:
        q = refer(d, self.scene.robot, eff, mean_path(d, self.scene.robot, eff), t)
        i = np.arange(len(t) - 1)
        return relative(q, i, i + 1).T.ravel()

    def _vector(self, eff: Effects) -> tuple[list[Array], list[Array]]:
        """Return what causes do to motions and to readings."""
        motions = [self._motion(d, t, eff) - b for (d, t), b in zip(self.drives, self.base, strict=True)]
        seen = any(k.startswith(SEEN) for k in eff)
        return motions, [f.effect(eff) if seen else np.zeros_like(f.base) for f in self.fans]

    def _gram(self, effs: list[Effects]) -> Array:
        """Return inner products of the causes' effects."""
        v = [self._vector(e) for e in effs]
        g = np.zeros((len(v), len(v)))
        for k, c in enumerate(self.chol):
            m = np.stack([x[0][k] for x in v], -1)
            g += m.T @ cho_solve(c, m)
        for k, f in enumerate(self.fans):
            g += f.gram([x[1][k] for x in v])
        return g

    def _noise_z(self, eff: Effects) -> float:
        """Return how sure noise is that grows, beside noise of one size: sqrt(2 log likelihood ratio)."""
        total, robot = 0.0, self.scene.robot
        for d, t in self.drives:
            v, _, w = rates(d, robot, eff, d.n)
            cov = motion_cov(d, robot, self.scene.ref, t, growth(robot, eff, v, w))
            one = np.diag(cov).reshape(3, -1)[[0, 2]]
            q = one / one.mean(1, keepdims=True)
            total += float((q - 1 - np.log(q)).sum())
        return float(np.sqrt(total))

    def _scatter(self, k: str, eff: Effects, sure: Sure) -> tuple[float, float]:
        """Return z and beside of a cause that shows in the scatter."""
        if k == "base.process_noise":
            z = self._noise_z(eff)
            return z, z
        if k == "laser.common_mode":
            z = float(np.sqrt(sum(f.common(eff[k]["sd"]) for f in self.fans)))
            return z, z
        z2, b2 = sure.get(k, (0.0, 0.0))
        return float(np.sqrt(max(z2, 0))), float(np.sqrt(max(min(z2, b2), 0)))

    def _rivals(self, eff: Effects, names: list[str]) -> list[str]:
        """Return the causes that could pass for one that is hidden."""
        rivals = [k for k in ALL if k not in eff and k not in NO_RIVALS]
        rivals = [k for k in rivals if self.scene.robot.volts or k not in VOLTS]
        rivals = [k for k in rivals if self.scene.laser or not k.startswith(("laser", "world"))]
        if not any(d.vc.min() < 0 for d, _ in self.drives):
            rivals = [k for k in rivals if k not in ("base.reverse_gain", "base.caster_reversal")]
        if all(k.startswith("base") and "marker" not in k and "clock" not in k for k in names):
            return [k for k in rivals if k.startswith("base")]
        if all(k.startswith(("laser", "world")) for k in names):
            return [k for k in rivals if k.startswith(("laser", "world", "base.marker"))]
        return rivals

    def judge(self, eff: Effects, sure: Sure, rng: Rng) -> dict[str, tuple[float, float]]:
        """Return (z, beside) of each cause; only of some where one is too weak."""
        scatter = [k for k in eff if k == "base.process_noise" or k in SCATTER]
        out, names = {k: self._scatter(k, eff, sure) for k in scatter}, [k for k in eff if k not in scatter]
        if not names or any(z < NEED for z, _ in out.values()):
            return out
        g = self._gram([{k: eff[k]} for k in names])
        zs = np.sqrt(np.maximum(np.diag(g), 0))
        if zs.min() < NEED:
            return out | {k: (float(z), 0.0) for k, z in zip(names, zs, strict=True)}
        rivals = [{k: draw(k, rng, 1.0, False, self.scene, typical=True)} for k in self._rivals(eff, names)]
        g = self._gram([{k: eff[k]} for k in names] + rivals)
        g += np.eye(len(g)) * 1e-6
        for i, k in enumerate(names):
            others = [j for j in range(len(names)) if j != i]
            left = []
            for o in [others, *([*others, r] for r in range(len(names), len(g)))]:
                x = g[i, i] - (g[i, o] @ np.linalg.solve(g[np.ix_(o, o)], g[o, i]) if o else 0)
                left.append(np.sqrt(max(x, 0)))
            out[k] = (float(zs[i]), float(min(left)))
        return out
