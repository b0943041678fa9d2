# SPDX-License-Identifier: BSD-3-Clause
"""One fan of a ranger with effects of a laser: beams that leave from elsewhere and earlier, readings that are off."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from kurumaisu._core import Arena
from kurumaisu.effects import Beams, Echoes, LaserChain, incidence, slanted
from kurumaisu.geometry import PLANAR, between, compose, interpolate, wrap
from kurumaisu.sim.memory import recall, remember
from kurumaisu.sim.rangers.fans import RangerFan, moments
from kurumaisu.sim.sensors.ranger_noise import deviation
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class _Look:
    """What the beams of a scan met: true ranges, +inf for nothing, returns, both (samples,); origins: from where."""

    beams: Beams
    ranges: FloatArray
    returns: FloatArray
    incidence: FloatArray
    origins: FloatArray


class FanEffects:
    """Looks where the effects let the beams go, then lets them act on the readings."""

    def __init__(
        self, fan: RangerFan, chain: LaserChain, rng: np.random.Generator, arena: Arena, step: float, sweep: float
    ) -> None:
        """Have a chain act on a fan.

        rng: of the noise that the fan itself has not; step [s] of the world; sweep: share of it that a scan takes.
        """
        self._early = (1.0 - moments(fan.fan.samples, sweep)) * step  # [s] before the stamp that each beam fires
        self._fan = fan
        self._chain = chain
        self._rng = rng
        self._arena = arena
        self._step = step
        self._mount = fan.mount[PLANAR]
        self._times: list[float] = []  # of the poses below [s]
        self._poses: list[FloatArray] = []  # (4,) of the body, as far back as the next scan may need them

    def note(self, time: float, before: FloatArray, now: FloatArray) -> None:
        """Note where the body came from (4,) in the last step and is at a time [s]; call it in every step."""
        if not self._poses or not np.array_equal(self._poses[-1], before):  # somebody has moved it by hand
            self._times, self._poses = [time - self._step], [before.copy()]
        self._times.append(time)
        self._poses.append(now.copy())

    def look(self, time: float, off: FloatArray | None) -> _Look:
        """Return what the beams of a scan with a stamp [s] meet; off (samples,) [rad]: how far each points aside."""
        level = np.zeros(len(self._early))
        said = time - self._early
        height = float(self._poses[-1][2] + self._fan.mount[2])
        beams = self._chain.aim(Beams(time, said, self._mount, height, self._fan.bearings, level))
        origins = compose(self._at(beams.times), beams.mount)
        cast = partial(self._cast, height)
        bearings = beams.bearings if off is None else beams.bearings + off
        ranges, returns = cast(origins, bearings)
        angles = level
        if self._chain.oblique:
            angles = incidence(lambda poses, bearings: cast(poses, bearings)[0], origins, bearings, ranges)
        self._forget(float(min(beams.times.min(), time)))
        return _Look(beams, slanted(ranges, beams), returns, angles, origins)

    def read(self, look: _Look, noisy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return readings (samples,) [m], +inf no return, NaN no valid one, and returns; noisy: ranges with noise."""
        fan = self._fan.fan
        sd = deviation(fan, look.ranges)
        with np.errstate(invalid="ignore", divide="ignore"):  # no return, or a fan without noise of its own
            noise = (noisy - look.ranges) / sd
        own = self._rng.standard_normal(len(sd))
        met = np.isfinite(look.ranges)
        echoes = Echoes(
            stamp=look.beams.stamp,
            bearings=self._fan.bearings,
            ranges=look.ranges,
            incidence=look.incidence,
            returns=np.where(met, look.returns, 1.0),
            mean=look.ranges,
            sd=sd,
            noise=np.where(np.isfinite(noise) & (look.ranges < fan.range_max), noise, own),
            readings=look.ranges,
            origins=look.origins,
            known=self._rates(),
            farthest=fan.range_max,
        )
        readings = self._chain.read(echoes)
        beyond = readings > fan.range_max
        return np.where(beyond, np.inf, readings), np.where(beyond, 0.0, look.returns)

    def state(self) -> dict[str, Any]:
        """Return what the next scans depend on, copies."""
        return {
            "chain": remember(self._chain),
            "random": self._rng.bit_generator.state,
            "times": np.array(self._times),
            "poses": np.array(self._poses).reshape(-1, 4),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a state of a fan with the same effects."""
        recall(self._chain, state["chain"])
        self._rng.bit_generator.state = state["random"]
        self._times, self._poses = state["times"].tolist(), list(state["poses"].copy())

    def _cast(self, height: float, poses: FloatArray, bearings: FloatArray) -> tuple[FloatArray, FloatArray]:
        origins = np.column_stack([poses[:, :2], np.full(len(poses), height), poses[:, 2] + bearings])
        return self._arena.cast(origins, np.full(len(poses), self._fan.model.root), np.inf)

    def _at(self, times: FloatArray) -> FloatArray:
        """Return where the body is (n, 3) at times (n,); after the last one it goes on as before."""
        known = np.array(self._poses)[:, PLANAR]
        known[:, 2] = np.unwrap(known[:, 2])
        ahead = np.maximum(times - self._times[-1], 0.0) / self._step
        way = known[-1] - known[-2]
        return np.asarray(interpolate(np.array(self._times), known, times) + ahead[:, np.newaxis] * way)

    def _rates(self) -> dict[str, float]:
        """Return how the body moved in the last step, v [m/s] and w [rad/s]."""
        before, now = (pose[PLANAR] for pose in self._poses[-2:])
        ahead, _, turned = between(before, now).tolist()
        return {"v": ahead / self._step, "w": float(wrap(turned)) / self._step}

    def _forget(self, before: float) -> None:
        """Drop what the next scan does not need; its beams are fired after those of this one."""
        keep = int(np.searchsorted(self._times, before, side="right")) - 1
        keep = min(max(keep, 0), len(self._times) - 2)
        del self._times[:keep], self._poses[:keep]
