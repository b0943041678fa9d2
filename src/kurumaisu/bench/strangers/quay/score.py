# SPDX-License-Identifier: BSD-3-Clause
"""How sure hidden causes are: z, and beside what else is hidden and the worst rival."""
import numpy as np
from scipy.linalg import cho_factor, cho_solve

from kurumaisu.bench.strangers.quay.base import DT, Drive, Effects, mean_path, motion_cov, rates, refer, relative
from kurumaisu.bench.strangers.quay.causes import ALL, SCATTER, VOLTS, draw
from kurumaisu.bench.strangers.quay.scans import Fan
from kurumaisu.bench.strangers.quay.things import Array, Laser, Reference, Robot, Room


def chain(dr: Drive) -> Array:
    """Rows of the reference 1 s apart, those that are off aside."""
    keep, last = [], -9.0
    for i in np.flatnonzero(~dr.off):
        if dr.pose_t[i] - last >= 0.999:
            keep.append(int(i))
            last = dr.pose_t[i]
    return np.array(keep)


class Judge:
    """Effects of causes on the training drives, whitened by the noise."""

    def __init__(self, drives: list[Drive], robot: Robot, laser: Laser | None, room: Room, ref: Reference) -> None:
        self.drives, self.robot, self.laser, self.room, self.ref = drives, robot, laser, room, ref
        self.t = [d.pose_t[chain(d)] for d in drives]
        self.chol = [cho_factor(motion_cov(d, robot, ref, t, np.ones(d.n))) for d, t in zip(drives, self.t)]
        self.base = [self._motion(d, t, {}) for d, t in zip(drives, self.t)]
        self.fans = [Fan(d, robot, laser, room, ref) for d in drives] if laser else []

    def _motion(self, d: Drive, t: Array, eff: Effects) -> Array:
        q = refer(d, self.robot, eff, mean_path(d, self.robot, eff), t)
        i = np.arange(len(t) - 1)
        return relative(q, i, i + 1).T.ravel()

    def vector(self, eff: Effects) -> tuple[list[Array], list[Array]]:
        """What causes do to motions and to readings."""
        base = [self._motion(d, t, eff) - b for d, t, b in zip(self.drives, self.t, self.base)]
        lasts = any(k.startswith(("laser", "world", "base.marker", "base.clock", "unknown")) for k in eff)
        return base, [f.effect(eff) if lasts else np.zeros_like(f.base) for f in self.fans]

    def gram(self, effs: list[Effects]) -> Array:
        """Inner products of the causes' effects."""
        v = [self.vector(e) for e in effs]
        g = np.zeros((len(v), len(v)))
        for k, c in enumerate(self.chol):
            m = np.stack([x[0][k] for x in v], -1)
            g += m.T @ cho_solve(c, m)
        for k, f in enumerate(self.fans):
            g += f.gram([x[1][k] for x in v])
        return g

    def null_rms(self) -> float:
        """Rms z of what was measured against the base model, for tests."""
        out = []
        for d, t, b, c in zip(self.drives, self.t, self.base, self.chol):
            i = np.arange(len(t) - 1)
            r = relative(d.pose[chain(d)], i, i + 1).T.ravel() - b
            out.append(r @ cho_solve(c, r) / r.size)
        return float(np.sqrt(np.mean(out)))

    def noise_z(self, eff: Effects) -> float:
        """Sureness of noise that grows, beside noise of one size: sqrt(2 log likelihood ratio)."""
        total = 0.0
        p = eff["base.process_noise"]
        for d, t in zip(self.drives, self.t):
            v, _, w = rates(d, self.robot, eff, d.n)
            a = np.hypot(v / self.robot.vmax, w / self.robot.wmax)
            g = 1 + p["growth"] * (a * a if p["form"] else a)
            one = np.diag(motion_cov(d, self.robot, self.ref, t, g)).reshape(3, -1)[[0, 2]]
            q = one / one.mean(1, keepdims=True)
            total += float((q - 1 - np.log(q)).sum())
        return float(np.sqrt(total))

    def judge(self, eff: Effects, sure: dict[str, tuple[float, float]], rng: np.random.Generator,
              need: float = 10.0) -> dict[str, tuple[float, float]]:
        """(z, beside) of each cause."""
        out: dict[str, tuple[float, float]] = {}
        names = []
        for k in eff:
            if k == "base.process_noise":
                out[k] = (self.noise_z(eff),) * 2
            elif k == "laser.common_mode":
                out[k] = (float(np.sqrt(sum(f.common(eff[k]["sd"]) for f in self.fans))),) * 2
            elif k in SCATTER:
                z2, b2 = sure.get(k, (0.0, 0.0))
                b2 = min(z2, b2)
                out[k] = (float(np.sqrt(max(z2, 0))), float(np.sqrt(max(b2, 0))))
            else:
                names.append(k)
        if not names or any(v[0] < need for v in out.values()):
            return out
        g = self.gram([{k: eff[k]} for k in names])
        zs = np.sqrt(np.maximum(np.diag(g), 0))
        if zs.min() < need:
            return out | {k: (float(z), 0.0) for k, z in zip(names, zs)}
        rivals = [k for k in ALL if k not in eff and k not in SCATTER and k not in
                  ("base.process_noise", "base.sign", "base.steering_law") and
                  (self.robot.volts or k not in VOLTS) and
                  (self.laser or not k.startswith(("laser", "world"))) and
                  (k != "laser.temperature" or "temperature" in self.drives[0].cov)]
        rivals = [k for k in rivals if k not in ("laser.beam_bias", "world.map_error")]
        if not any(d.vc.min() < 0 for d in self.drives):
            rivals = [k for k in rivals if k not in ("base.reverse_gain", "base.caster_reversal")]
        if all(k.startswith("base") and "marker" not in k and "clock" not in k for k in names):
            rivals = [k for k in rivals if k.startswith("base")]
        elif all(k.startswith(("laser", "world")) for k in names):
            rivals = [k for k in rivals if k.startswith(("laser", "world", "base.marker"))]
        g = self.gram([{k: eff[k]} for k in names] +
                      [{k: draw(k, rng, 1.0, False, self.robot, self.laser, self.room, True)} for k in rivals])
        g += np.eye(len(g)) * 1e-6
        for i, k in enumerate(names):
            others = [j for j in range(len(names)) if j != i]
            left = []
            for r in [None, *range(len(names), len(g))]:
                o = others + ([r] if r is not None else [])
                x = g[i, i] - (g[i, o] @ np.linalg.solve(g[np.ix_(o, o)], g[o, i]) if o else 0)
                left.append(np.sqrt(max(x, 0)))
            out[k] = (float(zs[i]), float(min(left)))
        return out
