# SPDX-License-Identifier: BSD-3-Clause
"""Recordings with a laser: stops or drives before known walls, with a map, a fan and the reference's deviations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kurumaisu.bench.hidden.base.recordings import run_of
from kurumaisu.bench.hidden.base.sizing import scaled_to
from kurumaisu.bench.hidden.generator.case import APART, FAINTEST, Ask, Case, Truth
from kurumaisu.bench.hidden.generator.motion import Fault, Sizes
from kurumaisu.bench.hidden.generator.noise import USUAL, draw_regime
from kurumaisu.bench.hidden.generator.rooms import world_text
from kurumaisu.bench.hidden.generator.scanning import ANGLE_MIN, ANGLE_STEP, BEAMS, MOUNT, expected, read
from kurumaisu.bench.hidden.generator.tours import Tour, draw_tour
from kurumaisu.bench.hidden.laser.catalogue import LASER
from kurumaisu.bench.hidden.laser.signal import MEANS, LaserScale, odd_z, spread_z
from kurumaisu.bench.hidden.laser.usual_effects import BACKDROPS, Backdrop, draw_backdrop
from kurumaisu.critic.values.recording import LaserMount, Recording, Run, Series
from kurumaisu.types import FloatArray
from kurumaisu.whole_files import write_whole

MATERIAL = 0.6e-3  # [m] least root mean square of a change of the mean readings, unless a z is asked for
_TOURS = 8  # drawn at most for a fault to show
_SAME = 3.0  # a rival that leaves less than this z explains the signal


@dataclass(frozen=True)
class Draw:
    """All that is random in the readings: seed of the noise, and the backdrop."""

    seed: int
    backdrop: Backdrop
    world: Path


def make_laser(ask: Ask, seed: int, folder: Path) -> Case:
    """Return a case of laser or world; its world file is written into folder."""
    what, where, how = (np.random.default_rng([seed, 10 + i]) for i in range(3))
    ids = ask.ids or _random_ids({"null": 0, "single": 1, "pair": 2, "triple": 3, "confounded": 1}[ask.kind], what)
    backdrop = BACKDROPS[ask.regime] if ask.regime in BACKDROPS else draw_backdrop(how)
    regime = draw_regime(how) if ask.regime is None else USUAL
    regime = replace(regime, position_sd=min(regime.position_sd, 0.01), heading_sd=min(regime.heading_sd, 0.005))
    moving = any(LASER[name].moving for name in ids)
    design = ask.design or ("drive" if moving else str(where.choice(["room", "room", "drive"])))
    if ask.design is None and {"laser.warmup", "laser.temperature"} & set(ids):
        design = "room"
    around = _without(backdrop, ids)
    for _ in range(_TOURS):  # on some, the largest size that there is hardly shows
        tour = draw_tour(design, regime, where)
        scale = LaserScale(tour, backdrop)
        sizes = {name: _sizes(name, scale, ask, what) for name in ids}
        truth = _truth(ask, scale, sizes, around)
        if ask.z is not None or not ids or truth.z >= FAINTEST:
            break
    faults = [LASER[name].fault(sizes[name], ask.form) for name in ids]
    folder.mkdir(parents=True, exist_ok=True)
    draw = Draw(int(how.integers(2**31)), around, folder / f"hidden_{seed}.world")
    write_whole({draw.world: world_text(f"hidden {seed}", tour.room)})
    null = recording(f"hidden {seed}", tour, (), draw)
    found = recording(f"hidden {seed}", tour, faults, draw) if faults else null
    return Case(found, null, truth, seed)


def recording(name: str, tour: Tour, faults: Sequence[Fault], draw: Draw) -> Recording:
    """Return what was measured on a tour with these faults."""
    rng = np.random.default_rng(draw.seed)
    scans = expected(tour, faults)
    plain = scans.sd if not faults else expected_sd(tour)
    scans = replace(scans, unit=draw.backdrop.noise(plain, rng))
    readings = draw.backdrop.lose(read(scans, faults), rng)
    columns = tuple(f"r{i}" for i in range(BEAMS))
    runs = []
    for i, leg in enumerate(tour.legs):
        mine = scans.leg == i
        poses = leg.poses(leg.times) + leg.errors
        run = run_of("", leg.setting, poses) if leg.setting else Run("", pose=_pose(leg.times, poses))
        warmth = Series(leg.stamps, scans.temperature[mine, None], ("temperature",))
        scan = Series(leg.stamps, readings[mine], columns)
        runs.append(replace(run, name=f"run_{i + 1}", scan=scan, covariates={"temperature": warmth}))
    mount = LaserMount(*MOUNT, ANGLE_MIN, ANGLE_STEP, BEAMS)
    names = tuple(run.name for run in runs)
    return Recording(name, tuple(runs), train=names, world=draw.world, laser=mount, truth=tour.truth)


def expected_sd(tour: Tour) -> FloatArray:
    """Return the deviations (s, b) [m] of readings without faults, in whose units noise is drawn."""
    return expected(tour, ()).sd


def _pose(times: FloatArray, poses: FloatArray) -> Series:
    return Series(times, poses, ("x", "y", "theta"))


def _random_ids(count: int, rng: np.random.Generator) -> tuple[str, ...]:
    """Return different ids in the catalogue's order; no more than one of those that need a drive or a still room."""
    names = list(LASER)
    chosen = sorted(rng.choice(len(names), size=count, replace=False))
    ids = tuple(names[i] for i in chosen)
    still = {"laser.warmup", "laser.temperature"} & set(ids)
    if still and any(LASER[name].moving for name in ids):
        return _random_ids(count, rng)
    return ids


def _without(backdrop: Backdrop, ids: Sequence[str]) -> Backdrop:
    """Return the backdrop without what is hidden: its null must not have it."""
    gone = {
        "laser.beam_correlation": {"beam_rho": 0.0},
        "laser.common_mode": {"common_sd": 0.0},
        "laser.beam_bias": {"beam_sd": 0.0},
        "laser.dropout": {"lost": 0.0},
    }
    for name in ids:
        backdrop = replace(backdrop, **gone.get(name, {}))
    return backdrop


def _sizes(name: str, scale: LaserScale, ask: Ask, rng: np.random.Generator) -> Sizes:
    hidden = LASER[name]
    sizes = hidden.draw(rng)
    if ask.kind == "confounded":
        sizes["size"] = abs(sizes["size"])  # what a tilt stands in for is longer ranges: it shortens none
    wanted = ask.z or float(np.exp(rng.uniform(np.log(5.0), np.log(60.0))))
    if hidden.by != "mean":
        return sizes

    def signal(size: float) -> FloatArray:
        return scale.signal(hidden.fault({**sizes, "size": size}, ask.form))

    def worth(size: float) -> float:
        return float(np.sqrt(scale.gram(signal(size)[..., None])[0, 0]))

    most = 12 * hidden.typical
    size = scaled_to(wanted, worth, sizes["size"], most)
    if ask.z is None and 0 < rms(signal(size)) < MATERIAL:  # would be seen, and matter to nobody
        size = scaled_to(MATERIAL, lambda size: rms(signal(size)), size, most)
    return {**sizes, "size": size}


def rms(signal: FloatArray) -> float:
    """Return the root mean square [m] over the beams that change."""
    changed = signal[signal != 0]
    return float(np.sqrt((changed**2).mean())) if len(changed) else 0.0


def _truth(ask: Ask, scale: LaserScale, sizes: dict[str, Sizes], backdrop: Backdrop) -> Truth:
    ids = tuple(sizes)
    parameters = {name: LASER[name].called(sizes[name], ask.form) for name in ids}
    odd = {name: _odd(name, scale, sizes[name], ask.form) for name in ids if LASER[name].by != "mean"}
    means = [name for name in ids if name not in odd]
    scale = scale.noisier([LASER[name].fault(sizes[name], ask.form) for name in odd])
    truth = Truth(ask.kind, ids, parameters, background=backdrop.ids, accepted=(ids,) if ids else ())
    if not means:
        return replace(truth, z=float(np.linalg.norm(list(odd.values()))), z_alone=odd)
    own = [scale.signal(LASER[name].fault(sizes[name], ask.form)) for name in means]
    plain = [scale.signal(LASER[name].fault(sizes[name], "plain")) for name in means]
    others = [name for name in MEANS if name not in ids and (scale.tour.moving or not LASER[name].moving)]
    rivals = scale.rivals(others, ids)
    gram, rest = left_after_rivals(scale, np.stack([*own, *plain], axis=-1), len(means), rivals)
    nearest = min(rest, key=lambda name: rest[name])
    alone = {name: left(gram, [i], _all_but(len(means), i)) for i, name in enumerate(means)}
    same = tuple((name,) for name, z in rest.items() if z < _SAME) if len(ids) == 1 else ()
    return replace(
        truth,
        z=float(np.hypot(left(gram, len(means), []), np.linalg.norm(list(odd.values())))),
        z_alone={**alone, **odd},
        z_rival=rest[nearest],
        rival=nearest,
        z_form=left(gram, len(means), range(len(means), 2 * len(means))),
        accepted=(ids, *same),
        near=tuple(name for name, z in rest.items() if z < APART) if len(ids) == 1 else (),
    )


def left_after_rivals(
    scale: LaserScale, signals: FloatArray, count: int, rivals: Sequence[tuple[str, FloatArray]]
) -> tuple[FloatArray, dict[str, float]]:
    """Return the gram of signals (s, b, n) and all rivals' columns, and the least that each rival leaves, by name.

    The first `count` signals are hidden together; a rival, as LaserScale.rivals has them, takes the place of one.
    """
    gram = scale.gram(np.concatenate([signals, *(columns for _, columns in rivals)], axis=-1))
    at, rest = signals.shape[-1], dict[str, float]()
    for name, columns in rivals:
        those = range(at, at + columns.shape[-1])
        least = min(left(gram, count, [*_all_but(count, i), *those]) for i in range(count))
        rest[name] = min(least, rest.get(name, least))
        at += columns.shape[-1]
    return gram, rest


def _odd(name: str, scale: LaserScale, sizes: Sizes, form: str) -> float:
    fault = LASER[name].fault(sizes, form)
    if fault.form.stage == "sd":
        return spread_z(scale.nominal, fault.form.act(scale.nominal, sizes), scale.count)
    return odd_z(name, sizes, scale)


def _all_but(count: int, i: int) -> list[int]:
    return [j for j in range(count) if j != i]


def left(gram: FloatArray, signal: int | Sequence[int], columns: Sequence[int]) -> float:
    """Return the norm of what columns leave of the sum of signals: those listed, or the first so many."""
    ones = np.zeros(len(gram))
    ones[list(range(signal)) if isinstance(signal, int) else list(signal)] = 1.0
    total = float(ones @ gram @ ones)
    if not len(columns):
        return float(np.sqrt(max(total, 0.0)))
    inner = gram[np.ix_(columns, columns)]
    norms = np.sqrt(np.maximum(np.diag(inner), 1e-30))
    outer = (ones @ gram)[list(columns)] / norms
    fit = np.linalg.pinv(inner / np.outer(norms, norms), rcond=1e-9, hermitian=True) @ outer
    return float(np.sqrt(max(total - outer @ fit, 0.0)))
