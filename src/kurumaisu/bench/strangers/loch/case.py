# SPDX-License-Identifier: BSD-3-Clause
"""One case: what is hidden, who drives where, and whether it can be told."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from kurumaisu.bench.strangers.loch import score
from kurumaisu.bench.strangers.loch.driver import Noise, drive, safe
from kurumaisu.bench.strangers.loch.laser import LASER, Box, Fan, room, walls
from kurumaisu.bench.strangers.loch.motion import CATALOGUE, Array, Drive, Hidden, Law, law, seen, truth
from kurumaisu.bench.strangers.loch.optics import EFFECTS
from kurumaisu.bench.strangers.loch.tables import columns, reference

FIXED = ("base.steering_law",)
GENTLE = {"base.saturation": 0.1, "laser.saturation": 0.03, "laser.tilt": 0.5, "laser.quantisation": 0.5}


@dataclass
class Case:
    """Everything that is drawn before anybody drives, and what came of it."""

    rng: np.random.Generator
    hidden: list[Hidden]
    laser: bool
    law: Law | None
    dull: tuple[str, float, float] | None
    key: list[int]
    noise: Noise = field(init=False)
    boxes: list[Box] = field(init=False)
    fan: Fan = field(init=False)
    train: int = 2
    records: list[score.Record] = field(default_factory=list)
    z: dict[str, float] = field(default_factory=dict)
    beside: dict[str, float] = field(default_factory=dict)
    rivals: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Draws noise, room and fan."""
        u, step = self.rng.uniform, int(self.rng.choice([2, 3]))
        self.noise = Noise(u(0.006, 0.018), u(0.016, 0.045), u(0.12, 0.5), u(0.0015, 0.005), u(0.0015, 0.005))
        self.boxes = room(self.rng)
        self.fan = Fan(-2.086214, step * 0.006135923, 340 if step == 2 else 227, step * 9.765625e-5)
        self.train = int(self.rng.integers(2, 4))

    @property
    def on_base(self) -> list[Hidden]:
        """What acts on the base."""
        return [h for h in self.hidden if h.id in CATALOGUE]

    def drives(self) -> list[Drive]:
        """All drives, or none at all if the chair touched something."""
        rng, around, start, out = np.random.default_rng([*self.key, 7]), walls(self.boxes), 0.0, []
        for i in range(self.train + int(rng.integers(1, 3))):
            length = rng.uniform(62, 95 if self.laser else 120)
            style = "steps" if self.dull else ("steps", "joystick", "planner")[rng.integers(3)]
            for _ in range(8):
                d = drive(
                    f"run_{i + 1}",
                    start,
                    length,
                    style,
                    self.law,
                    self.noise,
                    around,
                    self.on_base,
                    rng,
                    columns(int(length / 0.01), start, rng),
                    self.dull,
                )
                if self.dull or safe(d, around, self.on_base):
                    break
            else:
                return []
            out.append(replace(d, seed=int(rng.integers(1 << 30))))
            start += length + rng.uniform(15, 90)
        return out

    def measure(self, drives: Sequence[Drive]) -> None:
        """Paths and the reference's rows of all drives."""
        self.records = []
        for i, d in enumerate(drives):
            rng, last, path = np.random.default_rng([*self.key, 11, i]), i == len(drives) - 1, truth(d, self.on_base)
            clean = seen(path, self.on_base, path)
            end = float(d.t[-1]) - 0.5 if self.laser else 0.0
            scan_t: Array = np.arange(0.5, end, rng.uniform(0.3, 0.6), dtype=np.float64).round(4)
            asked = rng.choice(scan_t[10:-4], 5, replace=False) if self.laser and last else scan_t[:0]
            t, poses, good = reference(d, clean, self.noise, rng, asked, last)
            self.records.append(score.Record(d, path, clean, t, poses, good, scan_t, self.fan, self.boxes))

    def columns(self, which: Sequence[Hidden]) -> Array:
        """Whitened responses of effects, all of the base or all of the laser, in the training data."""
        if which[0].id in LASER:
            return score.laser_columns(self.records[: self.train], self.noise, which)
        return score.base_columns(self.records[: self.train], self.noise, which)

    def clarity(self, h: Hidden) -> float:
        """How clearly one effect shows."""
        if h.id == "base.process_noise":
            return score.growth_z(self.records[: self.train], self.noise, h, self.on_base)
        return float(np.linalg.norm(self.columns([h])))

    def calibrate(self, aims: dict[str, float], drives: list[Drive], rounds: int) -> None:
        """Sizes that show as clearly as was drawn."""
        for k, h in enumerate(self.hidden):
            for _ in range(0 if h.id in FIXED else rounds):
                ratio = aims[h.id] / max(self.clarity(h), 0.05)
                if abs(np.log(ratio)) < 0.06:
                    break
                change = np.clip(ratio, 0.15, 6) ** GENTLE.get(h.id, 1.0)
                most = EFFECTS[h.id].largest
                h = self.hidden[k] = h._replace(size=float(np.clip(h.size * change, -most, most)))
                if h.id == "base.process_noise":
                    self.measure(drives)

    def stage(self) -> bool:
        """Drives, chooses sizes, drives again; whether nothing was touched and all shows as it should."""
        u = self.rng.uniform
        aims = {
            h.id: float(
                u(16, 52)
                if h.id in CATALOGUE
                else 60 * 3.9 ** u(0, 1)
                if "n" in EFFECTS[h.id].flags
                else 15 * 8 ** u(0, 1)
            )
            for h in self.hidden
        }
        drives: list[Drive] = []
        for rounds in (4, 3):
            drives = self.drives()
            if not drives:
                return False
            self.measure(drives)
            if not self.hidden:
                return True
            self.calibrate(aims, drives, rounds)
        if not self.dull and not all(safe(d, walls(self.boxes), self.on_base) for d in drives):
            return False
        self.measure(drives)
        self.judge()
        return all(z >= 12 and (z <= (250 if i in LASER else 62) or i in (*FIXED, *GENTLE)) for i, z in self.z.items())

    def judge(self) -> None:
        """How clearly each effect shows, alone and beside the others; who could stand for it."""
        for h in self.hidden:
            mine = [k for k in self.hidden if (k.id in LASER) == (h.id in LASER) and k.id != "base.process_noise"]
            if h.id == "base.process_noise":
                self.z[h.id] = self.beside[h.id] = self.clarity(h)
            elif h is mine[0]:
                rest = score.others(h, h.id in LASER, self.law is not None, self.hidden)
                m, n = self.columns([*mine, *rest]), len(mine)
                for k, g in enumerate(mine):
                    kept, self.z[g.id] = np.delete(m[:, :n], k, axis=1), float(np.linalg.norm(m[:, k]))
                    self.beside[g.id], self.rivals = score.beside(m[:, k], kept, rest, m[:, n:], 2.5)


def draw(ids: Sequence[str], form: int, key: list[int], need: str, dull: str) -> Case:
    """A case for these effects: robot, law, laser as they need it."""
    rng, hidden = np.random.default_rng(key), []
    for e, i in ((EFFECTS[i], i) for i in ids):
        sign = 1.0 if "+" in e.flags else float(rng.choice([-1, 1]))
        hidden.append(Hidden(i, e.sizes[0] * sign, form, tuple(float(a) for a in rng.uniform(0.05, 0.95, 4))))
    laser = not dull and (any(i in LASER for i in ids) or need == "laser" or (need == "any" and rng.random() < 0.35))
    volts = need == "volts" or any("v" in EFFECTS[i].flags for i in ids) or (need != "velocity" and rng.random() < 0.5)
    name = "published" if "base.steering_law" in ids or rng.random() < 0.5 else "corrected"
    return Case(
        rng,
        hidden,
        laser,
        law(name) if volts else None,
        (dull, float(rng.uniform(0.2, 0.5)), float(rng.uniform(0.4, 0.8))) if dull else None,
        key,
    )
