# SPDX-License-Identifier: BSD-3-Clause
"""Whether scans as a whole are off together, by all of them: some ninety say too little of half a millimetre."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import expit

from kurumaisu import effects
from kurumaisu.critic.ranges.noise.scan_noise import CommonMode
from kurumaisu.critic.ranges.noise.shared_errors import ScanNoise
from kurumaisu.critic.scatter.scatter_search import ScatterEffect
from kurumaisu.critic.values.policy import NAMED, RIVAL, log_prior
from kurumaisu.critic.values.recording import Recording
from kurumaisu.critic.values.verdict import NORMAL90
from kurumaisu.effects import Echoes, Parameter
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray

_BEAMS = 8  # of a scan on which it is tried what an effect does to all of them


@dataclass(frozen=True)
class CommonOffset:
    """The effect that has whole scans off together: its size [m], and its correlation with the next scan's [1]."""

    id: str
    size: Parameter
    memory: Parameter


@cache
def common_offsets() -> tuple[CommonOffset, ...]:
    """Return the effects that move all beams of a scan alike, each scan by another draw; found by trying."""
    return tuple(_tried())


def with_common_offset(
    scatter: Sequence[ScatterEffect],
    seen: CommonMode,
    noise: ScanNoise,
    recording: Recording,
    ids: frozenset[str] | None,
) -> list[ScatterEffect]:
    """Return effects on the scatter with a common mode of the scans where the likelihood of all scans calls for one.

    Its sizes are taken from there even where the scatter has shown it: there, only some of the scans were looked at.
    ids: the effects that may be named; None for all.
    """
    count, out = len(effects.LASER), list(scatter)
    nats = seen.nats + log_prior(1, count) - log_prior(0, count)
    p = float(expit(nats))
    for whole in common_offsets() if p >= NAMED else ():
        known = next((each for each in out if each.setting.id == whole.id), None)
        if known is None and any(each.rivals.get(whole.id, 0.0) >= RIVAL for each in out):
            continue  # what stands in its place was weighed against it
        if ids is not None and whole.id not in ids:
            continue
        rho = float(np.exp(-_period(recording) / noise.common_tau))
        values = {
            whole.size.name: min(noise.common_sd, whole.size.upper),
            whole.memory.name: min(max(rho, whole.memory.lower), whole.memory.upper),
        }
        sizes, taus = seen.ends(noise, NORMAL90)
        memories = np.exp(-_period(recording) / taus)
        sds = {whole.size.name: _reach(noise.common_sd, sizes), whole.memory.name: _reach(rho, memories)}
        rest = [each for each in out if each is not known]
        out = [
            *rest,
            ScatterEffect(EffectSetting(whole.id, values), p, max(nats, known.nats if known else nats), sds, {}),
        ]
    return out


def _reach(value: float, ends: FloatArray) -> tuple[float, float]:
    """Return sds below and above a value with which its 90 % interval has these ends: its log is normal, it is not."""
    below, above = (np.abs(ends - value) / NORMAL90).tolist()
    return below, above


def own_sd(own: Sequence[EffectSetting]) -> float:
    """Return the sd [m] of whole scans in a model with these effects."""
    sizes = {whole.id: whole.size.name for whole in common_offsets()}
    return float(np.linalg.norm([each.parameters[sizes[each.id]] for each in own if each.id in sizes]))


def beyond_own_offset(scatter: Sequence[ScatterEffect], least: float, own: float = 0.0) -> list[ScatterEffect]:
    """Return effects on the scatter without those that have whole scans off together by less than `least` [m].

    own [m]: by which they are in the model already.
    """
    known = {whole.id for whole in common_offsets()}
    return [
        each
        for each in scatter
        if each.setting.id not in known or np.sqrt(abs(own_sd([each.setting]) ** 2 - own**2)) >= least
    ]


def _tried() -> Iterator[CommonOffset]:
    for effect in effects.LASER:
        nulls = {p.name: p.null for p in effect.parameters}
        for size in effect.parameters:
            others = [p for p in effect.parameters if p is not size]
            if not effect.random or size.unit != "m" or len(others) != 1:
                continue
            one, other = (_moved(EffectSetting(effect.id, {**nulls, size.name: size.scale}), seed) for seed in (0, 1))
            if np.any(one) and not np.array_equal(one, other) and np.ptp(one) < 1e-9:
                yield CommonOffset(effect.id, size, others[0])


def _moved(setting: EffectSetting, seed: int) -> FloatArray:
    """Return by how much [m] the readings of one scan of a wall are moved where there is no other noise."""
    chain = effects.build_laser((setting,), np.random.default_rng(seed))
    flat, wall = np.zeros(_BEAMS), np.full(_BEAMS, 2.0)
    read = chain.read(Echoes(0.0, np.linspace(-1.0, 1.0, _BEAMS), wall, flat, flat + 1, wall, flat + 0.01, flat, wall))
    return np.asarray(np.nan_to_num(read - wall))


def _period(recording: Recording) -> float:
    """Return the usual time [s] from one scan of a recording to the next, whatever of them is looked at."""
    steps = [np.diff(run.scan.t) for run in recording.runs if run.name in recording.train and run.scan is not None]
    return float(np.median(np.concatenate(steps)))
