# SPDX-License-Identifier: BSD-3-Clause
"""All rangers of a world: where their beams leave from, and when; one call of the ray caster for all that are due."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from kurumaisu._core import mounted
from kurumaisu.geometry import attached
from kurumaisu.sim.rangers.fans import RangerFan, moments, spread
from kurumaisu.sim.rangers.ray_casters import RayCaster
from kurumaisu.sim.rangers.scans import Scans, Sweep
from kurumaisu.sim.sensors.ranger_noise import RangerNoise
from kurumaisu.types import FloatArray, IntArray

if TYPE_CHECKING:
    from kurumaisu.sim.rangers.fan_effects import FanEffects

_TURN = 2 * np.pi
_BLIND = 1e-6  # range_max [m] of fans that the effects look with


class Rangers:
    """Takes the scans of all fans; those of one period and birth are a cohort."""

    def __init__(
        self,
        eyes: RayCaster,
        fans: Sequence[RangerFan],
        rhythm: IntArray,
        sweep: float,
        touched: Mapping[int, FanEffects],
    ) -> None:
        """Measure with fans whose rhythm (f, 2) is their period and birth [steps].

        sweep: share of a step; touched: effects on fans, by their places.
        """
        self._touched = [(fan.body, touched[i]) for i, fan in enumerate(fans) if i in touched]
        self._eyes = eyes
        self._cohorts: list[_Cohort] = []
        self._places: list[tuple[int, int, int]] = [(0, 0, 0)] * len(fans)
        for number, (every, birth) in enumerate(sorted(set(map(tuple, rhythm.tolist())))):
            members = [i for i in range(len(fans)) if rhythm[i].tolist() == [every, birth]]
            effects = {k: touched[i] for k, i in enumerate(members) if i in touched}
            self._cohorts.append(_Cohort(eyes, [fans[i] for i in members], (every, birth % every), sweep, effects))
            ends = np.cumsum([fans[i].fan.samples for i in members]).tolist()
            for i, start, stop in zip(members, [0, *ends], ends, strict=False):
                self._places[i] = (number, start, stop)
        self._scans = Scans((), self._places)

    @property
    def scans(self) -> Scans:
        """The newest scan of each fan."""
        return self._scans

    @property
    def truths(self) -> FloatArray | None:
        """How far all beams of the newest scans went [m], in the order of the fans; None: as far as they say."""
        known = [cohort.truths for cohort in self._cohorts]
        if all(truths is None for truths in known):
            return None
        true = [s.ranges if t is None else t for s, t in zip(self._scans.sweeps, known, strict=True)]
        together: FloatArray = np.concatenate([true[number][start:stop] for number, start, stop in self._places])
        return together

    def start(self, time: float, frames: FloatArray, rng: np.random.Generator) -> None:
        """Look once with all fans, before their first update, from frames (b + 1, 4): bodies and the map."""
        self._eyes.follow(frames)
        self._note(time, frames, frames)
        self._scans = Scans(tuple(c.measure(time, 0, frames, frames, rng) for c in self._cohorts), self._places)

    def update(self, step: int, time: float, way: tuple[FloatArray, FloatArray], rng: np.random.Generator) -> None:
        """Measure with those due in a step, counted from 1, on the way between frames (b + 1, 4)."""
        self._eyes.follow(way[1])
        self._note(time, *way)
        for cohort in self._cohorts:
            if step % cohort.every == cohort.phase:
                break
        else:
            return
        old = self._scans.sweeps
        new = tuple(
            c.measure(time, o.count + 1, *way, rng) if step % c.every == c.phase else o
            for c, o in zip(self._cohorts, old, strict=True)
        )
        self._scans = Scans(new, self._places)

    def take_over(self, old: Scans, same: Sequence[tuple[int, int]]) -> None:
        """Have the old scans of fans that are the same: pairs of their places, here and there."""
        sweeps = [replace(s, ranges=s.ranges.copy(), returns=s.returns.copy()) for s in self._scans.sweeps]
        for here, there in same:
            number, start, stop = self._places[here]
            scan, sweep = old[there], sweeps[number]
            sweep.ranges[start:stop], sweep.returns[start:stop] = scan.ranges, scan.returns
            sweeps[number] = replace(sweep, time=scan.time, count=scan.count)
        self._scans = Scans(tuple(sweeps), self._places)

    def keep(self, sweeps: tuple[Sweep, ...]) -> None:
        """Have these as the newest scans, of the same cohorts."""
        self._scans = Scans(sweeps, self._places)
        for cohort in self._cohorts:
            cohort.truths = None

    def _note(self, time: float, before: FloatArray, now: FloatArray) -> None:
        for body, effects in self._touched:
            effects.note(time, before[body], now[body])


class _Cohort:
    """Fans that are always due together."""

    def __init__(
        self,
        eyes: RayCaster,
        fans: Sequence[RangerFan],
        rhythm: tuple[int, int],
        sweep: float,
        touched: Mapping[int, FanEffects],
    ) -> None:
        self.every, self.phase = rhythm
        self.truths: FloatArray | None = (
            None  # how far the beams went, where noise or effects make something else of it
        )
        self._eyes = eyes
        self._body = np.array([fan.body for fan in fans], dtype=np.int64)
        self._trees = np.array([fan.model.root for fan in fans], dtype=np.int64)
        self._mounts = np.array([fan.mount for fan in fans]).reshape(-1, 4)
        self._fans = np.array([[*spread(f.fan), f.fan.samples, f.fan.range_max] for f in fans]).reshape(-1, 4)
        self._noise = RangerNoise([fan.fan for fan in fans])
        self._beams = _Beams(fans, sweep) if sweep or self._noise.on_bearings else None
        ends = np.cumsum([fan.fan.samples for fan in fans]).tolist()
        self._touched = [(slice(ends[k] - fans[k].fan.samples, ends[k]), touched[k]) for k in touched]
        self._fans[list(touched), 3] = _BLIND

    def measure(self, time: float, count: int, before: FloatArray, now: FloatArray, rng: np.random.Generator) -> Sweep:
        off = self._noise.bearings(rng) if self._noise.on_bearings else None
        if self._beams is None:
            ranges, returns = self._eyes.scan(mounted(now, self._body, self._mounts), self._trees, self._fans)
        else:
            ranges, returns = self._cast(self._beams, before, now, off)
        looks = [fan.look(time, off if off is None else off[part]) for part, fan in self._touched]
        for (part, _), look in zip(self._touched, looks, strict=True):
            ranges[part], returns[part] = look.ranges, look.returns
        self.truths = ranges.copy() if looks or self._noise.on_ranges else None
        if self._noise.on_ranges:
            ranges = self._noise.readings(ranges, rng)
        for (part, effects), look in zip(self._touched, looks, strict=True):
            ranges[part], returns[part] = effects.read(look, ranges[part])
        return Sweep(ranges, returns, time, count)

    def _cast(
        self, beams: _Beams, before: FloatArray, now: FloatArray, off: FloatArray | None
    ) -> tuple[FloatArray, FloatArray]:
        """Cast every beam on its own, from where its robot is when it fires."""
        bodies = self._body[beams.fan]
        way = now - before
        way[:, 3] -= _TURN * np.rint(way[:, 3] / _TURN)
        frames = now[bodies] - (1.0 - beams.moment)[:, np.newaxis] * way[bodies]
        origins = attached(frames, self._mounts[beams.fan])
        origins[:, 3] += beams.bearings
        if off is not None:
            origins[:, 3] += off
        ranges, returns = self._eyes.cast(origins, self._trees[beams.fan], float(beams.range_max.max(initial=1.0)))
        beyond = ranges > beams.range_max
        ranges[beyond], returns[beyond] = np.inf, 0.0
        return ranges, returns


class _Beams:
    """All beams of some fans: fan (n,), bearing (n,) [rad], range_max (n,) [m], moment (n,) of firing in the step."""

    def __init__(self, fans: Sequence[RangerFan], sweep: float) -> None:
        samples = [fan.fan.samples for fan in fans]
        self.fan = np.repeat(np.arange(len(fans)), samples)
        self.bearings = np.concatenate([np.empty(0), *(fan.bearings for fan in fans)])
        self.range_max = np.repeat(np.array([fan.fan.range_max for fan in fans], dtype=np.float64), samples)
        self.moment = np.concatenate([np.empty(0), *(moments(n, sweep) for n in samples)])
