# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of robot wheelchairs with something wrong, by a control engineer of automated vehicles."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np

from kurumaisu.bench.strangers.moor import seeing, whiten
from kurumaisu.bench.strangers.moor.drives import Setting, drive, safe
from kurumaisu.bench.strangers.moor.kinds import Choice, choose
from kurumaisu.bench.strangers.moor.laser import Fan, Lens
from kurumaisu.bench.strangers.moor.motion import Causes, Law, simulate
from kurumaisu.bench.strangers.moor.recording import Take, row_stamps, scan_stamps, tables_of, write
from kurumaisu.bench.strangers.moor.world import draw_room
from kurumaisu.bench.strangers.moor.wrongs import WRONGS

NOISE = {"base": (12.0, 55.0), "laser": (15.0, 250.0)}


def draw_fan(rng: np.random.Generator, sparse: bool) -> Fan:
    """The model's fan thinned out, or half a turn."""
    if sparse:
        return Fan(-2.086214, 0.024543692, 171, 3.90625e-4, 1.0)
    if rng.random() < 0.3:
        return Fan(-1.570796, 0.008726646, 361, 1.3888889e-4, float(rng.choice([0.35, 0.5])))
    k, beams = (2, 341) if rng.random() < 0.7 else (3, 227)
    return Fan(-2.086214, 0.006135923 * k, beams, 9.765625e-5 * k, float(rng.choice([0.25, 0.4, 0.5])))


def draw_take(rng: np.random.Generator, seed: int, c: Choice) -> Take:
    """A setting without drives."""
    names = {law.name for law in c.base} | {lens.name for lens in c.laser}
    flip, sparse = "base.steering_law" in names, "laser.quantisation" in names
    few = flip or sparse
    n = 3 if few else int(rng.integers(3, 6))
    seconds = tuple(float(round(rng.uniform(60, 75 if few else 130))) for _ in range(n))
    covariates = {x for law in c.base for x in law.covariates if x in ("drive_current", "tyre_difference", "wind")}
    covariates |= {lens.column for lens in c.laser if lens.column}
    if covariates or rng.random() < 0.45:
        covariates |= {"battery", "tyre_pressure", "temperature"} if rng.random() < 0.5 else {"battery", "temperature"}
    style = replace(c.style, weights=(0.3, 0.05, 0.5, 0.1, 0.05, 0.0)) if flip else c.style
    sd_w = float(rng.uniform(0.08, 0.09) if flip else rng.uniform(0.015, 0.04))
    tau = 0.7 if flip else float(rng.uniform(0.1, 0.6))
    setting = Setting(
        c.volts, seconds, style, float(rng.uniform(0.008, 0.02)), sd_w, tau,
        bool(rng.random() < 0.15 and not c.laser and not c.rivals), tuple(sorted(covariates)),
        float(rng.integers(1_600_000_000, 1_750_000_000)) if rng.random() < 0.5 else 0.0,
    )  # fmt: skip
    spots = rng.uniform(0.002, 0.006), rng.uniform(0.003, 0.008), rng.uniform(0.0008, 0.002)
    noise = whiten.Noise(setting.sd_v, sd_w, tau, *map(float, spots))
    fan = draw_fan(rng, sparse) if c.scans else None
    return Take(seed, setting, draw_room(rng), noise, fan, [], [], [], [], [], [], np.zeros(0), np.zeros(0))


def drive_all(take: Take, base: Causes) -> bool:
    """Drive all drives with their causes; whether nothing was hit."""
    take.drives = [drive(take.seed, take.setting, k, take.room, base) for k in range(len(take.setting.seconds))]
    take.motions = [simulate(d, base) for d in take.drives]
    rng = np.random.default_rng([take.seed, 31])
    rate = float(rng.choice([8, 10, 15, 20]))
    take.stamps = [row_stamps(rng, d.t[-1], rate) for d in take.drives]
    take.scans = [scan_stamps(rng, d.t[-1], take.fan) for d in take.drives] if take.fan is not None else []
    take.tests = 2 if len(take.drives) == 5 else 1
    end = float(take.drives[-1].t[-1])
    take.windows = np.arange(8.0, end - 8, max(9.0, (end - 16) / 6))
    if take.fan is not None:
        late = take.scans[-1][(take.scans[-1] > 4) & (take.scans[-1] < end - 3)]
        away = np.all((late[:, None] < take.windows - 0.5) | (late[:, None] > take.windows + 5), axis=1)
        take.asked = np.sort(rng.choice(late[away], min(7, int(away.sum())), replace=False))
        take.stamps[-1] = np.unique(np.concatenate([take.stamps[-1], take.asked]))
    return all(safe(take.room, m) for m in take.motions)


def rows_of(take: Take) -> list[whiten.Rows]:
    """The reference's rows of the drives to train."""
    n = len(take.drives) - take.tests
    return [whiten.Rows(d, s) for d, s in zip(take.drives[:n], take.stamps[:n], strict=True)]


def views_of(take: Take) -> seeing.Views:
    """The scans of the drives to train."""
    n = len(take.drives) - take.tests
    assert take.fan is not None
    scenes = [seeing.Scene(m, s, take.seed) for m, s in zip(take.motions[:n], take.scans[:n], strict=True)]
    return seeing.views(scenes, take.fan, take.room, take.noise)


def hide(take: Take, c: Choice, rng: np.random.Generator) -> list[tuple[float, float]] | None:
    """Drive without effects to find their sizes, then with them; z and beside of each, if all is as it should be."""
    if not drive_all(take, []):
        return None
    wants = {side: np.exp(rng.uniform(np.log(low), np.log(high), 3)) for side, (low, high) in NOISE.items()}
    signs = rng.choice([-1.0, 1.0], 6)
    if c.base:
        rows = rows_of(take)
        take.base = [
            (law, whiten.size_for(rows, take.noise, law, float(z), float(s) if law.signed else 1.0))
            for law, z, s in zip(c.base, wants["base"], signs, strict=False)
        ]  # fmt: skip
    if c.laser:
        view = views_of(take)
        take.lenses = [
            (lens, seeing.size_for(view, lens, float(z), float(s) if lens.signed else 1.0))
            for lens, z, s in zip(c.laser, wants["laser"], signs[3:], strict=False)
        ]  # fmt: skip
    if take.base and not drive_all(take, take.base):
        return None
    sizes = whiten.strengths(rows_of(take), take.noise, take.base, c.rivals) if c.base else []
    sizes += seeing.strengths(views_of(take), take.lenses, c.rivals) if c.laser else []
    least = 4 if len(sizes) > 1 else 6
    most = [60.0] * len(take.base) + [300.0] * len(take.lenses)
    good = all(10 <= z <= top and beside >= least for (z, beside), top in zip(sizes, most, strict=True))
    return sizes if good else None


def truth_of(kind: str, take: Take, c: Choice, sizes: list[tuple[float, float]]) -> dict[str, object]:
    """What truth.json says."""
    causes: list[dict[str, object]] = []
    says = []
    hidden: list[tuple[Law | Lens, float]] = [*take.base, *take.lenses]
    for (law, size), (z, beside) in zip(hidden, sizes, strict=True):
        numbers = {k: round(f * size, 7) for k, f in law.parameters.items()} | getattr(law, "fixed", {})
        causes.append(
            {"id": law.name, "z": round(z, 2), "beside": round(beside, 2), "form": law.form, "parameters": numbers}
        )
        says.append(f"{law.name} of size {size:.4g}")
    neutral = ["base.process_noise"] + (["laser.dropout", "laser.heavy_tails"] if take.fan else [])
    truth: dict[str, object] = {"kind": kind, "causes": causes, "unknown": None, "wrong": None}
    truth["neutral"] = [n for n in neutral if n not in {x["id"] for x in causes}]
    if kind == "unknown":
        one = hidden[0][0]
        about = {"channel": one.channel, "covariates": list(one.covariates)}
        truth |= {"causes": [], "unknown": about | {"z": causes[0]["z"], "beside": causes[0]["beside"]}}
        says = [f"{one.channel} follows {one.covariates[0]}"]
    if c.wrong >= 0:
        truth["wrong"] = WRONGS[c.wrong].words
        says = [WRONGS[c.wrong].words]
    if c.rivals:
        truth["rivals"] = list(c.rivals)
        says.append("which these drives cannot tell from " + ", ".join(c.rivals))
    truth["sentence"] = "; ".join(says) or "nothing is hidden"
    return truth


def make(out: Path, kind: str, seed: int) -> None:
    """Write one recording with what is true of it."""
    own = 8 * seed + ("null", "single", "form", "pair", "triple", "unknown", "confounded", "wrong").index(kind)
    for attempt in range(14):
        c = choose(kind, seed if attempt < 6 else seed + 1000 + attempt, attempt)
        rng = np.random.default_rng([own, 1, attempt])
        take = draw_take(rng, own, c)
        sizes = hide(take, c, rng)
        if sizes is not None:
            break
    else:
        raise RuntimeError(f"nothing came out for {kind} {seed}")
    tables, offsets = tables_of(take)
    if c.wrong >= 0:
        WRONGS[c.wrong].act(tables)
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    write(out, take, tables, offsets)
    (out / "truth.json").write_text(json.dumps(truth_of(kind, take, c, sizes), indent=2) + "\n")
