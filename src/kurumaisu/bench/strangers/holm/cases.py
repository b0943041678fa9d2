# SPDX-License-Identifier: BSD-3-Clause
"""Draws a case of a kind, makes sure that it is strong enough, and writes it."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kurumaisu.bench.strangers.holm import core
from kurumaisu.bench.strangers.holm.chair import Noise
from kurumaisu.bench.strangers.holm.core import CORRECTED, PUBLISHED, Array, Effect, Maker, chosen, log_uniform
from kurumaisu.bench.strangers.holm.drives import Drive, Scene, plan, reference, style
from kurumaisu.bench.strangers.holm.judge import Judge
from kurumaisu.bench.strangers.holm.laser import Fan
from kurumaisu.bench.strangers.holm.record import Case, write
from kurumaisu.bench.strangers.holm.rooms import draw
from kurumaisu.bench.strangers.holm.unknowns import EXTRA, PICKS, WRONG, WRONG_SCANS, Pick

CONFOUNDED = [
    ("base.gain_v", "forward"),
    ("base.curvature_v", "forward"),
    ("base.dac_zero_f", "forward"),
    ("base.dead_zone_v", "forward"),
    ("base.reverse_gain", "reverse"),
    ("base.gain_w", "left"),
    ("base.gain_w", "yaw"),
    ("base.left_right_gain", "left"),
    ("base.dac_zero_s", "left"),
    ("base.curvature_w", "yaw"),
    ("base.dead_zone_w", "yaw"),
]
_BASE = """dac_zero_f dac_zero_s cross_v_to_w gain_v gain_w left_right_gain veer reverse_gain caster_reversal
cross_w_to_v slope marker_x marker_y marker_yaw clock_scale"""
_LASER = """mount_x mount_y mount_yaw offset scale quadratic incidence_bias reflectance temperature latency clock_skew
warmup"""
SIGNED = {"base." + name for name in _BASE.split()} | {"laser." + name for name in _LASER.split()}
STRONG = {
    "null": (0.0, 0.0),
    "single": (10.0, 6.0),
    "form": (10.0, 6.0),
    "pair": (10.0, 4.0),
    "triple": (10.0, 4.0),
    "unknown": (10.0, 6.0),
    "confounded": (10.0, 0.0),
    "wrong": (0.0, 0.0),
}


@dataclass
class Wish:
    """A cause of a size that may change: what makes it, and its smallest and largest size."""

    name: str
    maker: Maker
    size: float
    sign: float
    least: float

    def effect(self, rng: np.random.Generator) -> Effect:
        """The cause at its present size."""
        return self.maker(self.sign * self.size, rng)

    def grow(self, factor: float) -> None:
        """Change the size, within what can be."""
        if self.name == "laser.saturation":
            self.size = float(np.clip(self.size / factor**0.2, 1.2, 3.5))
        elif self.name != "base.steering_law":
            self.size = min(max(self.size * factor, self.least), core.MOST.get(self.name, np.inf))


def _wishes(rng: np.random.Generator, kind: str) -> tuple[list[Wish], str, Pick | None]:
    """What to hide, the driver's habit, and an unknown."""
    if kind in ("null", "wrong"):
        return [], "normal", None
    if kind == "unknown":
        pick: Pick = chosen(rng, PICKS)
        size, sign = pick.size * log_uniform(rng, 0.7, 2), chosen(rng, (-1, 1))
        least = pick.size * log_uniform(rng, 0.35, 1.2)
        return [Wish("unknown", lambda x, _: pick.effect(x), size, sign, least)], "normal", pick
    if kind == "confounded":
        name, mode = chosen(rng, CONFOUNDED)
        names, source = [name], core.USUAL
    else:
        source = core.OTHER if kind == "form" else core.USUAL
        count = {"pair": 2, "triple": 3}.get(kind, 1)
        names, mode = [str(x) for x in rng.choice(sorted(source), count, replace=False)], "normal"
    out = []
    for name in names:
        size, maker = source[name]
        signed = name in SIGNED or (name == "world.map_error" and kind != "form")
        sign = chosen(rng, (-1, 1)) if signed else 1
        wish = Wish(name, maker, size, sign, size * log_uniform(rng, 0.35, 1.5))
        wish.grow(log_uniform(rng, 0.6, 2))
        out.append(wish)
    return out, mode, None


def _swing(rng: np.random.Generator, name: str, duration: float) -> Array:
    middle, half = EXTRA[name]
    t = np.arange(int(duration) + 3)
    wave = np.sin(2 * np.pi * t / rng.uniform(60, 130) + rng.uniform(0, 6))
    return np.asarray(middle + half * (wave + rng.normal(0, 0.02, t.size)))


def _scene(rng: np.random.Generator, wishes: list[Wish], mode: str, pick: Pick | None) -> Scene:
    laser = pick.channel.startswith("laser") if pick else any(not w.name.startswith("base") for w in wishes)
    with_scans = laser or (mode == "normal" and rng.random() < 0.4)
    room = draw(rng) if with_scans else None
    fan = None
    if with_scans:
        step = int(chosen(rng, (1, 2, 2, 3, 4)))
        beams = min(682 // step, int(chosen(rng, (682, 500, 341, 227, 170, 682))))
        first = -2.086214 if beams >= 682 // step - 1 else round(-0.5 * beams * step * 0.006135923, 5)
        fan = Fan(0.30, 0.0, 0.0, first, step * 0.006135923, beams, step * 9.765625e-5)
    ids = {w.name for w in wishes}
    volts = ids & {"base.dac_zero_s", "base.dead_zone_w", "base.cross_v_to_w", "base.dac_quantisation"}
    law = PUBLISHED if "base.steering_law" in ids or (not volts and rng.random() < 0.25) else CORRECTED
    sizes = log_uniform(rng, 0.004, 0.016), log_uniform(rng, 0.008, 0.03), log_uniform(rng, 0.1, 0.6)
    noise = Noise(*sizes, bool(rng.random() < 0.5))
    count = int(rng.integers(3, 5))
    low, high = (60, 130) if with_scans else (70, 240 if count < 4 else 160)
    durations = [float(round(rng.uniform(low, high), 1)) for _ in range(count)]
    total = sum(durations) * (fan.beams if fan else 1)
    rate = float(min(chosen(rng, (10, 5, 4, 8)), max(2.0, 700000 / total)))
    names = ["temperature"] if "laser.temperature" in ids else []
    names += [pick.follows] if pick and pick.follows in EXTRA else []
    return Scene(room, fan, law, noise, reference(rng), style(rng, room, mode), durations, rate, names)


def _drives(seed: int, sc: Scene, effects: list[Effect], only_train: bool) -> list[Drive]:
    rng = np.random.default_rng(seed)
    out: list[Drive] = []
    start = 0.0
    for k, duration in enumerate(sc.durations):
        test = k == len(sc.durations) - 1
        extra = {n: _swing(rng, n, duration) for n in sc.extra}
        child = np.random.default_rng(int(rng.integers(1 << 40)))
        if not (only_train and test):
            d = plan(child, f"run_{k + 1}", sc, duration, start, effects, extra)
            d.test = test
            if sc.fan is not None:
                t = np.arange(0.7, duration - 0.7, 1 / sc.scan_rate)
                d.stamps = np.round(t + child.uniform(-0.1, 0.1, t.size) / sc.scan_rate, 4)
            out.append(d)
        start += round(duration + float(rng.uniform(10, 60)), 1)
    return out


Strong = tuple[list[Drive], list[Effect], list[tuple[float, float]]]


def _strong(rng: np.random.Generator, kind: str, wishes: list[Wish], sc: Scene) -> Strong | None:
    z_least, beside_least = STRONG[kind]
    seed = int(rng.integers(1 << 40))
    goal = log_uniform(rng, 1.3, 5)
    for attempt in range(4):
        effects = [w.effect(np.random.default_rng(seed + k)) for k, w in enumerate(wishes)]
        drives = _drives(seed, sc, effects, True)
        found = Judge(drives, sc).strength(effects, np.random.default_rng(seed))
        good = all(z >= z_least and b >= beside_least for z, b in found)
        if kind == "confounded" and good and any(b >= 1 for _, b in found):
            return None
        small = all(z < 10 * z_least or w.size <= 1.05 * w.least for w, (z, _) in zip(wishes, found, strict=True))
        if good and (attempt > 2 or small):
            return _drives(seed, sc, effects, False), effects, found
        if any(z < 0.5 or (kind != "confounded" and b < 0.3) for z, b in found):
            return None
        for w, (z, b) in zip(wishes, found, strict=True):
            need = max(z_least / z, beside_least / max(b, 0.1) if beside_least else 0)
            w.grow(float(np.clip(need * goal, 0.1, 6)))
    return None


def _truth(kind: str, made: Strong, pick: Pick | None, tamper: str, dead: bool, sc: Scene) -> dict[str, Any]:
    _, effects, found = made
    sizes = [{"z": round(z, 2), "beside": round(beside, 2)} for z, beside in found]
    form, unknown, causes = "other" if kind == "form" else "usual", None, []
    words = " and ".join(e.id for e in effects) or tamper or "nothing"
    if pick:
        follows = pick.follows.split()
        unknown = {"channel": pick.channel, "covariates": follows, **sizes[0]}
        words = f"{pick.says}: {pick.channel} follows {follows[0]}"
    else:
        for e, size in zip(effects, sizes, strict=True):
            parameters = {} if kind == "form" else {k: round(v, 6) for k, v in e.parameters.items()}
            causes.append({"id": e.id, **size, "form": form, "parameters": parameters})
    return {
        "kind": kind,
        "causes": causes,
        "neutral": ["base.process_noise"] + (["laser.dropout"] if dead else []),
        "unknown": unknown,
        "wrong": tamper or None,
        "sentence": f"A chair watched by a {sc.ref.kind}; hidden: {words}.",
    }


def make(folder: Path, kind: str, seed: int) -> None:
    """Write the case of a kind and seed into folder; RuntimeError if none of 30 draws is strong enough."""
    if kind not in STRONG:
        raise ValueError(kind)
    for draw_number in range(30):
        rng = np.random.default_rng([zlib.crc32(kind.encode()), seed, draw_number])
        wishes, mode, pick = _wishes(rng, kind)
        sc = _scene(rng, wishes, mode, pick)
        tamper = chosen(rng, WRONG + (WRONG_SCANS * 2 if sc.fan else [])) if kind == "wrong" else ""
        made: Strong | None
        if wishes:
            made = _strong(rng, kind, wishes, sc)
        else:
            made = _drives(int(rng.integers(1 << 40)), sc, [], False), [], []
        if made:
            break
    else:
        raise RuntimeError(f"no {kind} of seed {seed} is strong enough")
    drives, effects, _ = made
    dead = np.zeros(0, dtype=int)
    if sc.fan is not None and rng.random() < 0.4 and not any(e.id == "laser.dropout" for e in effects):
        dead = rng.choice(sc.fan.beams, int(rng.integers(1, 4)), replace=False)
    names = ["battery", "cpu_load", "lab_light", "wifi"]
    decoys = [str(x) for x in rng.choice(names, int(rng.integers(0, 4)), replace=False)]
    zero = float(chosen(rng, (0.0, 0.0, 12.5, 1.7e9 + 86400 * int(rng.integers(300)))))
    voltages = (rng.random() < 0.6 or tamper == "voltages in mV") and tamper != "commands in km/h"
    case = Case(drives, effects, sc, zero, voltages, decoys, dead, tamper, says=bool(rng.random() < 0.5))
    write(Path(folder), case, _truth(kind, made, pick, tamper, dead.size > 0, sc), rng)
