# SPDX-License-Identifier: BSD-3-Clause
"""Which effects can be hidden, and at what sizes; robots, lasers, references and rooms; how people drive."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from kurumaisu.bench.strangers.tarn.base import DT, Drive, Effect, Lab, Laser, Noise, Reference, Rng, coloured
from kurumaisu.params import shipped

# name, sign (~ either, + only this, = nearly this), size, how it goes with the robot's speed (a as 1/speed, b as
# 1/speed^2, c as speed), ! if the equation has exactly that parameter; * after an id: there is an unusual equation.
SPEC = """
base.dac_zero_f offset~0.03! | base.dac_zero_s offset~0.02! | base.dac_quantisation* step+0.08! | base.delay delay+0.2!
base.steering_law flip=1 | base.dead_zone_v* width+0.04c | base.dead_zone_w* width+0.04 | base.backlash* play+0.06
base.cross_v_to_w share~0.03! | base.gain_v gain~0.05! | base.gain_w gain~0.05! | base.left_right_gain* asymmetry~0.05
base.veer* curvature~0.06a! | base.reverse_gain* gain~0.08! | base.curvature_v* curvature+0.15a! | base.lag_w* tau+0.2!
base.curvature_w* curvature+0.12! | base.saturation* inverse_v+1.4a inverse_w+1.4 | base.battery_sag* sag+0.0007!
base.lag_v* tau+0.25! | base.accel_limit slowness_v+2.5a slowness_w+1.2 | base.payload droop+0.06 tau+0.2
base.understeer* k+0.3b! | base.caster_reversal* kick~0.2 length=0.25 | base.lateral_slip* c+0.05a!
base.slope* climb_x~0.02c! climb_y~0.015c! | base.cross_w_to_v* lever+0.03c | base.marker_x x~0.03c!
base.marker_y y~0.03c! | base.marker_yaw yaw~0.03! | base.clock_scale scale~0.002 | laser.mount_x x~0.02!
laser.mount_y y~0.02! | laser.mount_yaw yaw~0.02! | laser.tilt pitch+0.06 roll~0.03 | laser.sweep stretch~0.5
laser.latency delay+0.04! | laser.clock_skew* skew~0.0006 | laser.offset offset~0.01! | laser.scale scale~0.006!
laser.quadratic* quadratic~0.002! | laser.warmup* amplitude~0.012 tau=60 | laser.temperature* coefficient~0.0015!
laser.cyclic* amplitude+0.005! wavelength=2.5! phase=1 | laser.incidence_bias* k~0.005 | laser.reflectance* bias~0.02
laser.beam_bias sd+0.0015 amplitude~0.003 phase=1 | laser.range_noise share+0.35! | laser.incidence_noise gain+0.6
laser.common_mode sd+0.001 rho=0.7 | laser.beam_correlation rho+0.3! | laser.mixed_pixels probability+0.5
laser.heavy_tails outliers+0.03 inverse_nu+0.25 reach=0.12 | laser.dropout probability+0.05 per_metre+0.01
laser.saturation* inverse_far+0.4 | laser.crosstalk probability+0.4 width+0.5 drift=0.3 reach=4
laser.quantisation* step+0.02! | world.map_error* scale~0.008 sd+0.01
"""
PARTS = [part.split() for part in SPEC.replace("\n", "|").split("|") if part.strip()]
TABLE = {p[0].strip("*"): [re.fullmatch(r"(\w+)([~+=])([\d.]+)([abc]?)(!?)", q) for q in p[1:]] for p in PARTS}
IDS, ALT = list(TABLE), [p[0].strip("*") for p in PARTS if p[0].endswith("*")]
_SCATTER = """range_noise incidence_noise common_mode beam_correlation heavy_tails mixed_pixels dropout crosstalk
quantisation"""
SCATTER = {"laser." + i for i in _SCATTER.split()}
VOLTAGE = {"base." + i for i in ("dac_zero_f", "dac_zero_s", "dac_quantisation", "steering_law", "cross_v_to_w")}
MOST = {"probability": 0.8, "rho": 0.8, "inverse_nu": 0.4, "outliers": 0.1}


def draw_effect(rng: Rng, lab: Lab, id_: str, strength: float, alt: bool = False) -> Effect:
    """An effect of a drawn size; `strength` 1 is typical."""
    f, side, s = strength * rng.uniform(0.7, 1.5), float(rng.choice([-1, 1])), lab.vmax / 0.6
    p, told = dict[str, float](), []
    for token in TABLE[id_]:
        assert token
        name, sign, size, by, sure = token.groups()
        speed = {"a": 1 / s, "b": 1 / s**2, "c": min(max(s, 0.5), 2.0), "": 1.0}[by]
        drawn = rng.uniform(0.8, 1.25) if sign == "=" else f * side if sign == "~" else f
        p[name] = min(float(size) * speed * drawn, MOST.get(name, 1e9))
        told += [name] if sure and not alt else []
    if id_ == "base.slope" and rng.random() < 0.5:
        p["climb_y"] *= -1
    if id_ == "base.saturation":
        most = float(np.clip(0.75 / strength, 0.35, 0.85))
        p = {"inverse_v": 1 / (most * lab.vmax), "inverse_w": 1 / (most * lab.wmax)}
    if id_ == "laser.saturation" and lab.laser:
        p = {"inverse_far": 1 / min(rng.uniform(0.25, 0.6) * lab.laser.rmax, 3.5)}
    if id_ == "laser.quantisation" and lab.laser:
        p["step"] = float(rng.choice([0.015, 0.02, 0.03, 0.05])) + 2 * lab.laser.res
    if id_ == "world.map_error":
        p = {"swell": 0.003 * f} if alt else {k: p[k] for k in [str(rng.choice(["scale", "sd"]))]}
    if id_ == "laser.heavy_tails":
        p.pop(str(rng.choice(["inverse_nu", "outliers"])))
    if id_ == "laser.reflectance" and rng.random() < 0.3 and not alt:
        p["noise"] = 1.0
    return Effect(id_, p, alt, told=tuple(told))


def possible(lab: Lab, id_: str) -> bool:
    """Whether this robot with this laser can have the effect."""
    return lab.kind == "md100" if id_ in VOLTAGE else id_.startswith("base.") or lab.laser is not None


def typical(lab: Lab, id_: str) -> list[Effect]:
    """A rival at its typical size, in the shapes that it has."""
    p = draw_effect(np.random.default_rng(3), lab, id_, 1.0).p
    if id_ in ("base.slope", "base.accel_limit", "base.saturation", "base.payload", "laser.tilt"):
        return [Effect(id_, {k: v}) for k, v in p.items()]
    if id_ in ("laser.cyclic", "laser.beam_bias"):
        return [Effect(id_, {**p, "sd": 0.0, "phase": f}) for f in (0.0, 1.57)]
    return [Effect(id_, {"scale": 0.005} if id_ == "world.map_error" else p)]


URG = (1.004587, 0.058826, (0.002334, -0.000488, 0.000199), 0.001, 0.06, 4.0)
LASERS = {
    "urg": (-2.086214, 0.006135923, 682, 9.765625e-5, 0.1, *URG),
    "half": (-2.086214, 0.012271846, 341, 1.953125e-4, 0.1, *URG),
    "spin": (-3.14159265, 0.017453293, 360, 3.968e-4, 0.142857, 1.0, 0.0, (0.006, 0.002, 0.0008), 0.0, 0.12, 6.0),
    "spin_cm": (-3.14159265, 0.017453293, 360, 5.55556e-4, 0.2, 1.0, 0.0, (0.005, 0.001, 0.0005), 0.01, 0.15, 8.0),
    "wide": (-2.35619449, 0.013089969, 361, 2.5e-5, 0.025, 1.0, 0.0, (0.006, 0.0005, 0.00005), 0.001, 0.1, 18.0),
    "near": (-2.35619449, 0.017453293, 271, 1.0e-4, 0.05, 1.0, 0.0, (0.004, 0.0008, 0.0001), 0.001, 0.05, 10.0),
}
REFERENCES = [
    ("camera", 0.0012, 0.003, 0.0012, 0.0015, 40.0, 3e-4),
    ("station", 0.002, 0.006, 1e-3, 1e-3, 60.0, 1e-3),
    ("matcher", 0.002, 0.002, 0.0035, 0.003, 8.0, 2e-3),
]


def draw_lab(rng: Rng, wheelchair: bool, laser: bool, need: list[str], column: bool, manner: str) -> Lab:
    """A robot with its instruments; `need` are the effects that it must be able to have."""
    u, kind = rng.uniform, "md100" if wheelchair else str(rng.choice(["velocity", "diff_drive"]))
    if wheelchair:
        vmax, wmax, size, margin, fans = u(0.4, 0.8), u(0.5, 0.8), u(1.6, 3.2), 0.75, ["urg", "half", "urg", "near"]
    elif rng.random() < 0.5:
        vmax, wmax, size, margin, fans = u(0.18, 0.3), u(0.8, 1.5), u(0.8, 1.4), 0.25, ["spin", "spin_cm", "half"]
    else:
        vmax, wmax, size, margin, fans = u(1.0, 1.5), u(0.8, 1.3), u(3.5, 5.5), 0.6, ["wide", "spin_cm", "near"]
    fan, x, z = LASERS[str(rng.choice(fans))], round(u(-0.05, 0.2), 2), 0.4 if wheelchair else 0.2
    rate = min(float(rng.choice([2.0, 2.5, 4.0, 5.0])), 5.0 if fan[2] < 400 else 2.5)
    las = Laser(0.3 if wheelchair else x, float(rng.choice([0.0, 0.05])), z, 0.0, *fan, rate)
    name, *sds = REFERENCES[int(rng.choice([0, 0, 1, 2]))]
    often = {"camera": float(rng.choice([30, 50, 100, 120])), "station": u(5, 10), "matcher": u(8, 20)}[name]
    room, grow, coarse = str(rng.choice(["office", "corridor", "hall", "askew"])), u(0.7, 1.3), max(vmax / 0.5, 0.4)
    noise = Noise(0.004 * coarse * grow, 0.012 * grow, 0.008 * grow, 0.015 * grow, u(0.15, 0.5), 0.25)
    half = (size * 1.8, size * 0.45) if room == "corridor" else (size, size * u(0.7, 1.0))
    pixel = float(rng.choice([0.0, 0.0, 0.01, 0.02])) if room != "askew" and "laser.reflectance" not in need else 0.0
    track = 0.54 if wheelchair else round(vmax * 0.35 + 0.08, 3)
    law = "published" if "base.steering_law" in need and rng.random() < 0.5 else "corrected"
    ref = Reference(name, often, *sds)
    rate, epoch, uneven = (float(rng.choice(a)) for a in ((10, 20, 50), (0.0, 0.0, 1.7e9), (0.05, 0.15, 0.5)))
    robot = kind, law, vmax, wmax, 1 / rate, round(track / 5, 3), track
    place = half, margin, room, pixel, epoch, uneven, bool(rng.random() < 0.6) or column
    return Lab(*robot, las if laser else None, ref, noise, *place, manner)


def model_text(lab: Lab) -> str:
    """The model that is criticised: the given one with this lab's laser and voltage law."""
    text, q, new = shipped("launch/md100.yaml").read_text(), lab.laser, f"voltage_law: {lab.law}"
    if q:
        new += f"""
  mount: {{x: {q.x}, y: {q.y}, z: {q.z}, yaw: {q.yaw}}}
  angle_min: {q.amin}
  angle_increment: {q.ainc}
  beams: {q.beams}
  scan_time: {q.scan_time}
  time_increment: {q.tinc:.8f}
    scale: {q.scale}
    datum_offset: {q.offset}
    sigma: [{", ".join(f"{one:.7f}" for one in q.sigma)}]
    resolution: {q.res}
    range_min: {q.rmin}
    range_max: {q.rmax}"""
    for line in [*new.splitlines(), *(["name: robot"] if lab.kind != "md100" else [])]:
        text = re.sub(rf"(?m)^{line.split(':')[0]}:.*$", line, text, count=1)
    return text


def meta_text(lab: Lab, world: str, names: list[str]) -> str:
    """meta.yaml; the last drive is the test."""
    q, robot = lab.laser, f"{{kind: diff_drive, radius: {lab.radius}, track: {lab.track}}}"
    robot = robot if lab.kind == "diff_drive" else lab.kind
    out = f"model: model.yaml\nrobot: {robot}\ntrain: [{', '.join(names[:-1])}]\ntest: [{names[-1]}]\n"
    if q:
        fan = f"angle_min: {q.amin}, angle_increment: {q.ainc}, beams: {q.beams}, time_increment: {q.tinc:.8f}"
        out += f"world: {world}\nlaser: {{x: {q.x}, y: {q.y}, yaw: {q.yaw}, {fan}}}\n"
    return out


def _pick(rng: Rng, lab: Lab) -> tuple[float, float]:
    """A speed and a yaw rate as somebody with a joystick asks for."""
    v = lab.vmax * float(rng.choice([0.08, 0.15, 0.3, 0.5, 0.7, 1.0])) * (1 if rng.random() < 0.65 else -0.7)
    w = lab.wmax * float(rng.choice([0.08, 0.2, 0.4, 0.7, 1.0])) * float(rng.choice([-1, 1]))
    u = rng.random()
    if lab.manner == "one_speed":
        return (0.6 * lab.vmax, 0.0) if u < 0.55 else (0.0, w)
    if lab.manner == "one_turn":
        return (v, 0.0) if u < 0.5 else (0.0, 0.6 * lab.wmax)
    if lab.manner == "one_curve":
        return 0.6 * lab.vmax, 0.0 if u < 0.3 else 0.5 * w
    return (v, 0.0) if u < 0.35 else (0.0, w) if u < 0.55 else (v, 0.6 * w)


def drive(rng: Rng, lab: Lab, name: str, start: float, long: float, run: Callable[[Drive], None]) -> Drive:
    """Ask for segments one after the other, so that the robot, as it really moves, keeps to its area."""
    n, slips = int(long / DT), np.zeros((2, int(long / DT)))
    t, end = start + np.arange(n) * DT, start + long
    for slip in slips:
        for at in rng.uniform(0, long - 1, rng.poisson(long / 60)):
            slip[int(at / DT) :][:30] = rng.normal() * 2.0 * np.sin(np.linspace(0, np.pi, 30))
    ov, ow = (coloured(rng, n, tau) + s for tau, s in zip((lab.noise.tau_v, lab.noise.tau_w), slips, strict=True))
    d = Drive(name, t, ov, ow, (float(rng.normal() * 0.2), float(rng.normal() * 0.1), rng.uniform(-3, 3)))
    share, swing = (t - start) / long, float(rng.choice([-1, 1]) * rng.uniform(5, 9))
    d.cov = {
        "temperature": 20 + rng.uniform(-2, 2) + swing * (share - 0.5) + 2 * np.sin(2 * np.pi * share / 0.6),
        "humidity": 45 + 4 * coloured(rng, n, 20.0),
        "tyre": 2.5 + 0.3 * coloured(rng, n, 15.0),
        "lux": 300 + 50 * coloured(rng, n, 10.0),
    }
    now, rows, before = start + rng.uniform(1.0, 2.5), [(start, 0.0, 0.0)], (0.0, 0.0)
    while now < end - 6:
        run(d)
        i = min(int((now - start) / DT) + 20, n)
        best, choice = 1e9, (0.0, 0.0, 2.0)
        for _ in range(14):
            v, w = _pick(rng, lab)
            last = min(rng.uniform(1.0, 4.5 if v else 3.0), end - 2.5 - now)
            a = d.th[i] + w * last * np.linspace(0, 1, 12)
            x, y = d.x[i] + v * last * np.cumsum(np.cos(a)) / 12, d.y[i] + v * last * np.cumsum(np.sin(a)) / 12
            out = max(np.abs(x).max() - lab.half[0], 0) + max(np.abs(y).max() - lab.half[1], 0) + 0.08 * rng.random()
            out += 0.03 * np.hypot(x[-1] + 0.3 * np.cos(a[-1]), y[-1] + 0.3 * np.sin(a[-1])) / np.hypot(*lab.half)
            best, choice = (out, (v, w, last)) if out < best else (best, choice)
        v, w, last = choice
        ramp = 1e-6 if lab.manner else float(rng.choice([1e-6, 0.3, 0.8]))
        at = now + np.cumsum(np.clip(rng.normal(1, lab.uneven, int(last / lab.cmd_dt) + 1), 0.1, 4)) * lab.cmd_dt
        f = np.minimum((at - now) / ramp, 1.0)
        rows += zip(at, before[0] + (v - before[0]) * f, before[1] + (w - before[1]) * f, strict=True)
        now, before = float(at[-1]) + lab.cmd_dt, (v, w)
        if rng.random() < 0.2:
            rows.append((now, 0.0, 0.0))
            now, before = now + rng.uniform(1.0, 2.5), (0.0, 0.0)
        d.tc, d.vc, d.wc = np.round(np.array([*rows, (now, 0.0, 0.0)]).T, 6)
    run(d)
    return d
