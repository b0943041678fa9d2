# SPDX-License-Identifier: BSD-3-Clause
"""Which recording to make: the setup, the drives, and what is hidden in them."""

from dataclasses import dataclass, field

import numpy as np

from kurumaisu.bench.strangers.delta.answers import ask
from kurumaisu.bench.strangers.delta.camera import record
from kurumaisu.bench.strangers.delta.catalogue import ALL, BASE, LASER, draw, possible, unknowns
from kurumaisu.bench.strangers.delta.circumstances import CONFOUNDED, columns
from kurumaisu.bench.strangers.delta.core import WARM, Cause, Drive, Fan, Noise, Setup
from kurumaisu.bench.strangers.delta.drives import drive_it
from kurumaisu.bench.strangers.delta.room import furnish
from kurumaisu.bench.strangers.delta.scanner import scan
from kurumaisu.bench.strangers.delta.strength import base_strength, shows_in_base
from kurumaisu.bench.strangers.delta.visibility import LASER_RIVALS, SCATTER, laser_strength


@dataclass
class Case:
    """A setup with what is hidden in it."""

    setup: Setup
    causes: list[Cause]
    strengths: list[tuple[float, float]] = field(default_factory=list)
    rivals: list[str] = field(default_factory=list)


def prepare(rng: np.random.Generator, kind: str, want: str = "") -> Setup:
    """A setup without anything hidden."""
    scans = rng.random() < 0.5 if not want else want.split(".")[0] in ("laser", "world")
    beams = 682 if rng.random() < 0.3 else int(rng.integers(200, 500))
    fan = Fan(-2.086214, 0.006135923, 682, 9.765625e-5)
    if beams != 682:
        step = round(float(np.radians(240) / beams), 7)
        fan = Fan(-step * (beams - 1) / 2, step, beams, round(0.1 * 240 / 360 / beams, 9))
    noise = Noise(
        sd_v=float(rng.uniform(0.004, 0.012)),
        sd_w=float(rng.uniform(0.008, 0.025)),
        tau=float(np.exp(rng.uniform(np.log(0.1), np.log(0.8)))),
        position=float(np.exp(rng.uniform(np.log(0.001), np.log(0.006)))),
        heading=float(np.exp(rng.uniform(np.log(0.001), np.log(0.006)))),
        drift=float(rng.uniform(0.0005, 0.002)),
    )
    n, start, session = int(rng.integers(3, 6)), 1.7e9 + float(rng.integers(0, 9**8)), 20.0
    drives = []
    for i in range(n):
        length = float(rng.integers(70, 150))
        drives.append(Drive(f"run_{i + 1}", round(start + session, 2), length, session))
        session += length + float(rng.uniform(30, 150))
    names = list(rng.permutation(["battery", "temperature", "tyre_pressure", "humidity", "lamp"])[: rng.integers(1, 4)])
    named = columns(rng, names if rng.random() < 0.5 or kind == "unknown" else [])
    facts = {
        "command_rate": float(rng.choice([10, 20, 25, 50])),
        "pose_rate": float(rng.choice([10, 15, 20, 30])),
        "soft": float(rng.choice([0.6, 1.0, 2.0, 50.0])),
        "scan_period": float(rng.choice([0.4, 0.5, 0.7])),
        "says_truth": bool(rng.random() < 0.5),
        "wrapped": bool(rng.random() < 0.7),
    }
    style = "dull" if rng.random() < 0.2 else "lab"
    return Setup(
        rng,
        bool(rng.random() < 0.5),
        scans,
        furnish(rng),
        fan,
        noise,
        style,
        named,
        drives,
        max(2, n - 1 - (n > 4)),
        facts,
    )


def drive_all(setup: Setup, causes: list[Cause], dry: bool = False) -> None:
    """Drive and record everything."""
    rng = setup.rng
    for i, drive in enumerate(setup.drives):
        drive.contact, drive.walker, drive.asked_scans, drive.windows = (-1.0, -1.0), (-1.0, 0.0, 0.0), [], []
        if i < setup.train and rng.random() < 0.12:
            begin = float(rng.uniform(15, drive.length - 15))
            drive.contact = (begin, begin + float(rng.uniform(1.2, 2.2)))
        if setup.scans and rng.random() < 0.25:
            drive.walker = (
                float(rng.uniform(10, drive.length - 15)),
                float(rng.uniform(1, 4)),
                float(rng.normal(0, 0.2)),
            )
        for _ in range(6):
            if drive_it(setup, drive, causes):
                break
        else:
            raise RuntimeError("the chair would drive through walls")
        if setup.scans:
            scan(setup, drive, causes, dry)
        if i == len(setup.drives) - 1:
            ask(setup, drive)
        record(setup, drive, causes)


def strength(setup: Setup, causes: list[Cause], cause: Cause) -> tuple[float, float]:
    """Strength of a cause where it shows."""
    return base_strength(setup, causes, cause) if shows_in_base(cause) else laser_strength(setup, causes, cause)


def limits(cause: Cause) -> tuple[float, float]:
    """Smallest and largest size."""
    return (1e-4, 0.6) if cause.curve else (ALL[cause.id].low, ALL[cause.id].high)


def fit_size(setup: Setup, cause: Cause, goal: float) -> None:
    """Bring a cause's size to where its signal has the strength wanted."""
    low, high = limits(cause)
    for _ in range(4):
        z = strength(setup, [cause], cause)[0]
        ratio = float(np.clip(goal / max(z, 1e-3), 0.1, 10))
        if 0.85 < ratio < 1.18:
            break
        power = 0.6 if cause.id in ("laser.tilt", "base.saturation", "base.dac_quantisation") else 1.0
        cause.size = float(np.sign(cause.size) * np.clip(abs(cause.size) * ratio**power, low, high))


def fits(cause: Cause, z: float, beside: float, least: float) -> bool:
    """Whether a cause came out as strong as asked for."""
    scatters = cause.id in SCATTER or cause.id.startswith(("laser.", "world."))
    free = cause.id in ("base.steering_law", "laser.quantisation")
    most = 1e9 if free else 300 if scatters or (cause.curve and cause.curve.channel.startswith("range")) else 60
    return 10 <= z <= most and beside >= least


def choose(rng: np.random.Generator, kind: str) -> Case:
    """Draw until a case has the strengths it should have."""
    for _ in range(40):
        try:
            case = attempt(rng, kind)
        except RuntimeError:
            continue
        if case is not None:
            return case
    raise RuntimeError(f"no case of kind {kind} came out")


def attempt(rng: np.random.Generator, kind: str) -> Case | None:
    """One draw; none if it does not come out."""
    if kind == "confounded":
        return confounded(rng)
    want, name = "", ""
    if kind in ("single", "form"):
        name = want = str(rng.choice([n for n in ALL if kind == "single" or ALL[n].other]))
    setup = prepare(rng, kind, want)
    if name == "laser.temperature" and "temperature" not in setup.columns:
        setup.columns.update(columns(rng, ["temperature"]))
    if name in BASE:
        setup.volts = setup.volts or name not in possible(setup, False)
        setup.scans = bool(rng.random() < 0.35)
    drive_all(setup, [], dry=kind not in ("null", "wrong"))
    if kind in ("null", "wrong"):
        return Case(setup, [])
    causes = hidden(setup, kind, name)
    for c in causes:
        laser = not shows_in_base(c)
        fit_size(setup, c, float(np.exp(rng.uniform(np.log(16), np.log(120 if laser else 45)))))
    least = 6 if kind in ("single", "form", "unknown") else 4
    first = [strength(setup, causes, c) for c in causes]
    if not all(fits(c, 1.15 * z, 1.15 * b, least) for c, (z, b) in zip(causes, first, strict=True)):
        return None
    drive_all(setup, causes)
    final = [strength(setup, causes, c) for c in causes]
    if not all(fits(c, z, b, least) for c, (z, b) in zip(causes, final, strict=True)):
        return None
    return Case(setup, causes, final)


def hidden(setup: Setup, kind: str, name: str) -> list[Cause]:
    """What to hide, of a middle size."""
    rng = setup.rng
    if kind in ("single", "form"):
        return [draw(rng, name, kind == "form")]
    if kind == "unknown":
        curves = unknowns(setup)
        kinds = sorted({c.channel.split(".")[0] for c in curves})
        channel = str(rng.choice(kinds))
        some = [c for c in curves if c.channel.split(".")[0] == channel]
        return [Cause("unknown", 0.01 if channel == "range" else 0.03, curve=some[int(rng.integers(len(some)))])]
    names = [n for n in possible(setup, False) if n != "base.steering_law"]
    picked = [str(n) for n in rng.permutation(names)[: 2 if kind == "pair" else 3]]
    if kind == "triple" and setup.scans:
        picked = [str(rng.choice([n for n in names if n in BASE])), str(rng.choice([n for n in names if n in LASER]))]
        picked.append(str(rng.choice([n for n in names if n not in picked])))
    return [draw(rng, n, bool(ALL[n].other and rng.random() < 0.15)) for n in picked]


def confounded(rng: np.random.Generator) -> Case | None:
    """An effect in drives that cannot tell it from another."""
    name, rivals, style = CONFOUNDED[int(rng.integers(len(CONFOUNDED)))]
    setup = prepare(rng, "confounded", name)
    setup.style, setup.facts["soft"] = style, {"slow": 0.12, "lab": 1.0}.get(style, 50.0)
    cause = draw(rng, name, False)
    if "temperature" in "".join([name, *rivals]):
        tau, rise = cause.extra.get("tau", WARM), float(rng.uniform(3, 6))
        cause.extra.update({"tau": tau} if name == "laser.warmup" else {})
        setup.columns["temperature"] = lambda s: 20 + rise * (1 - np.exp(-s / tau))
    drive_all(setup, [], dry=True)
    goal = float(np.exp(rng.uniform(np.log(15), np.log(40))))
    fit_size(setup, cause, goal)
    drive_all(setup, [cause])
    z, beside = against(setup, cause, rivals)
    return Case(setup, [cause], [(z, beside)], list(rivals)) if 10 <= z <= 60 and beside < max(2.0, 0.08 * z) else None


def against(setup: Setup, cause: Cause, rivals: dict[str, float]) -> tuple[float, float]:
    """Strength, and what the rivals of this case leave of it."""
    if shows_in_base(cause):
        return base_strength(setup, [cause], cause, rivals)
    more = {"laser.offset": LASER_RIVALS["laser.offset"]} if "laser.temperature" in (cause.id, *rivals) else {}
    return laser_strength(setup, [cause], cause, {**rivals, **more})
