# SPDX-License-Identifier: BSD-3-Clause
"""What the report shows of the scans: misfits over what an effect follows, rivals, noise. It names no effect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.critic.ranges.noise.shared_errors import pose_sds
from kurumaisu.critic.ranges.search.effect_sets import FormPosterior
from kurumaisu.critic.ranges.search.normal_equations import Assembly, NormalEquations
from kurumaisu.critic.values.story import FOLLOWED, Alternative, Misfit, Moments, NoiseParameter, bins, explained
from kurumaisu.types import FloatArray, IntArray

_SAMPLES = 20_000  # readings of which means are drawn, evenly taken: of 100 000, no mean is a picture's width off
_ALTERNATIVES = 6
_LEAST = 1e-6  # [m], [rad] sd of an error that is none


@dataclass(frozen=True)
class Part:
    """What acts on the mean: an id, its columns of the whole matrix, and its coefficients."""

    id: str
    span: slice
    coefficients: FloatArray


def misfits(assembly: Assembly, normal: NormalEquations, parts: Sequence[Part]) -> tuple[Misfit, ...]:
    """Return per part what is wrong with the readings without it, over what it follows, and what it adds."""
    added = [np.asarray(assembly.columns[:, :, part.span] @ part.coefficients, dtype=np.float64) for part in parts]
    left = _without_shared_errors(
        assembly, normal, np.asarray(assembly.residual - sum(added, np.zeros(assembly.residual.shape)))
    )
    step = max(1, int(normal.beam_noise.valid.sum()) // _SAMPLES)
    rows = np.flatnonzero(normal.beam_noise.valid & np.isfinite(left))[::step]
    over = {name: (unit, values.ravel()[rows]) for name, (unit, values) in _covariates(assembly).items()}
    when = _moments(assembly, rows)
    return tuple(
        replace(_misfit(part.id, over, left.ravel()[rows], each.ravel()[rows]), moments=when)
        for part, each in zip(parts, added, strict=True)
    )


def _moments(assembly: Assembly, rows: IntArray) -> Moments:
    """Return when and where readings were taken; rows: places of them in arrays (k, b) made flat."""
    shots, seen = assembly.shots, assembly.marks.seen
    scan, beam = np.divmod(rows, seen.ranges.shape[1])
    places = seen.ends(np.where(np.isfinite(seen.level), seen.level, np.nan))[scan, beam]
    return Moments(shots.runs, shots.run[scan], shots.stamps[scan] + shots.zero, places)


def _without_shared_errors(assembly: Assembly, normal: NormalEquations, error: FloatArray) -> FloatArray:
    """Return errors (k, b) [m] without what is most likely an error of the reference or of the whole scan."""
    scan, beam = normal.scan_noise, normal.beam_noise
    out = error.copy()
    for k, valid in enumerate(beam.valid):
        shared = assembly.random_columns(k)
        size = np.maximum(assembly.random_sds(k, scan), _LEAST)
        use = valid & np.isfinite(error[k])
        white = shared[use] / beam.sd[k][use, np.newaxis]
        target = white.T @ (error[k][use] / beam.sd[k][use])
        out[k] -= shared @ np.linalg.solve(white.T @ white + np.diag(size**-2), target)
    return out


def alternatives(found: FormPosterior) -> tuple[Alternative, ...]:
    """Return the best other sets of effects, and why each lost."""
    best, seen = found.best, {found.best.ids}
    out: list[Alternative] = []
    for fit in found.fits:
        if fit.ids in seen or len(out) == _ALTERNATIVES:
            continue
        seen.add(fit.ids)
        better = fit.log_likelihood - best.log_likelihood
        why = f"fits better by {better:.1f} nats, too little to justify another effect"
        if better <= 0:
            why = f"fits worse by {-better:.1f} nats"
        out.append(
            Alternative(" + ".join(sorted(fit.ids)) or "no effect on the mean reading", fit.score - best.score, why)
        )
    return tuple(out)


def noise_rows(normal: NormalEquations) -> tuple[NoiseParameter, ...]:
    """Return the noise of the scans."""
    scan, beam = normal.scan_noise, normal.beam_noise
    position_sd, _, heading_sd = pose_sds(scan).tolist()
    rows = (
        ("laser: single reading (median)", float(np.median(beam.sd[beam.valid])), "m"),
        ("laser: correlation of neighbouring readings", beam.rho, "1"),
        ("laser: error common to a whole scan", scan.common_sd, "m"),
        ("laser: time constant of the common error", scan.common_tau, "s"),
        ("reference position at the scans, each axis", position_sd, "m"),
        ("reference heading at the scans", heading_sd, "rad"),
    )
    return tuple(NoiseParameter(*row) for row in rows)


def _misfit(name: str, over: Mapping[str, tuple[str, FloatArray]], left: FloatArray, added: FloatArray) -> Misfit:
    share = {which: explained(values, added) for which, (_, values) in over.items()}
    best = max(share, key=lambda which: share[which])
    unit, x = over[best] if share[best] >= FOLLOWED else ("m", added)
    curve = bins(x, added, 1)
    return Misfit(
        channel="range",
        unit="m",
        covariate_name=best if share[best] >= FOLLOWED else f"change by {name}",
        covariate_unit=unit,
        covariate=x,
        residual=left + added,
        bins=bins(x, left + added),
        explained_by=name,
        curve=np.column_stack([curve.centre, curve.mean]),
        after=bins(x, left),
    )


def _covariates(assembly: Assembly) -> dict[str, tuple[str, FloatArray]]:
    """Return what a misfit may be drawn over, with units and a value per reading, (k, b)."""
    seen, shots = assembly.marks.seen, assembly.shots
    shape = seen.ranges.shape
    out: Sequence[tuple[str, str, FloatArray]] = (
        ("range", "m", seen.ranges),
        ("angle of incidence", "rad", seen.incidence),
        ("bearing of the beam", "rad", seen.bearings),
        ("time", "s", np.broadcast_to(shots.stamps[:, np.newaxis], shape)),
        ("reflectance of the wall", "1", seen.returns),
        ("change of the range with the heading", "m/rad", assembly.poses[:, :, 2]),
        ("x of the laser in the map", "m", seen.origins[..., 0]),
        ("y of the laser in the map", "m", seen.origins[..., 1]),
    )
    return {name: (unit, values) for name, unit, values in out if np.isfinite(values).all() and np.ptp(values) > 0}
