# SPDX-License-Identifier: BSD-3-Clause
"""The laser on a moving chair: every beam from where the laser is when it fires."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from kurumaisu import effects
from kurumaisu.effects import Beams, Echoes, LaserChain, incidence, slanted
from kurumaisu.errors import Error
from kurumaisu.geometry import compose
from kurumaisu.params import EffectSetting, Laser
from kurumaisu.sim.chair.sight import Sight
from kurumaisu.sim.memory import recall, remember
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class Scan:
    """Readings (beams,) [m]: +inf no return, NaN no valid reading, as one below range_min.

    time [s] on the scan's stamp, which is that of the first beam; pose (3,): base_link in the map at that time;
    returns (beams,): reflectance of what the beams met, 0 where that is nothing; truths (beams,): how far they went.
    """

    time: float
    pose: FloatArray
    ranges: FloatArray
    returns: FloatArray
    truths: FloatArray


class Scanner:
    """Takes a scan every scan_time from the poses of the chair."""

    def __init__(self, laser: Laser, sight: Sight, chain: LaserChain, rng: np.random.Generator) -> None:
        """Start a scan at time 0; chain: the laser's effects. Raise Error for a fan that outlasts scan_time."""
        self._laser = laser
        self.sight = sight
        self._chain = chain
        self._rng = rng
        self._mount = np.array([laser.mount.x, laser.mount.y, laser.mount.yaw])
        self._bearings = laser.bearings
        self._delays = laser.time_increment * np.arange(laser.beams)  # of the beams after the first [s]
        if self._delays[-1] > laser.scan_time:
            raise Error(
                f"laser: the last beam comes {self._delays[-1]:g} s after the first, "
                f"more than scan_time = {laser.scan_time:g} s"
            )
        self._start(0)

    def observe(self, time: float, pose: FloatArray) -> Scan | None:
        """Note where the chair is, times increasing [s]; return the scan that is complete, if any.

        That is when its last beam has been fired, in truth and by its stamp.
        """
        self.sight.note(time, pose)
        rounding = 1e-9  # [s] of multiples of the step
        if time < self._complete - rounding:
            return None
        beams = self._beams
        poses = self.sight.poses(np.append(beams.times, beams.stamp))
        scan = Scan(beams.stamp, poses[-1], *self._readings(beams, poses[:-1]))
        self._start(self._count + 1)
        self.sight.forget(min(self._beams.stamp, self._beams.times.min()))
        return scan

    def switch(self, settings: tuple[EffectSetting, ...], time: float, rng: np.random.Generator) -> None:
        """Go on with these effects from a time [s] on; a scan under way keeps its beams. rng: for the new ones.

        Raise Error, with nothing changed, for effects that are unknown or whose parameters do not fit.
        """
        effects.check(settings)
        before = {effect.id for effect in self._chain.effects}
        self._chain = effects.build_laser(settings, rng, self._chain.effects)
        for effect in self._chain.effects:
            if effect.id not in before:
                effect.since = time

    def state(self) -> dict[str, Any]:
        """Return all that the next scans depend on."""
        chain, random = remember(self._chain), remember(self._rng)
        return {"count": self._count, "sight": self.sight.state(), "chain": chain, "random": random}

    def restore(self, known: dict[str, Any]) -> None:
        """Go back to a state of the same laser, as new."""
        recall(self._chain, known["chain"])
        recall(self._rng, known["random"])
        self.sight.restore(known["sight"])
        self._start(known["count"])

    def _start(self, count: int) -> None:
        """Go on as if so many scans had been taken."""
        self._count = count
        self._aim()

    def _aim(self) -> None:
        """Prepare the beams of the next scan."""
        stamp = self._count * self._laser.scan_time
        level = np.zeros(self._laser.beams)
        height = self._laser.mount.z
        said = stamp + self._delays
        self._beams = self._chain.aim(Beams(stamp, said, self._mount, height, self._bearings, level))
        self._complete = max(said[-1], self._beams.times.max())

    def _readings(self, beams: Beams, poses: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        error = self._laser.error
        origins = compose(poses, beams.mount)
        look = self.sight.look(beams.times, beams.height)
        level, returns = look.cast(origins, beams.bearings)
        noise = self._rng.standard_normal(len(level))
        if self._chain.empty:
            return error.reading(level, noise), returns, level
        ranges = slanted(level, beams)
        oblique = self._chain.oblique
        echoes = Echoes(
            stamp=beams.stamp,
            bearings=self._bearings,
            ranges=ranges,
            incidence=incidence(look.ranges, origins, beams.bearings, level) if oblique else np.zeros(len(level)),
            returns=np.where(np.isfinite(level), returns, 1.0),
            mean=error.mean(ranges),
            sd=error.deviation(ranges),
            noise=noise,
            readings=ranges,
            origins=origins,
            known=self.sight.rates(),
            farthest=self._laser.range_max,
        )
        # What the law, without its noise, makes of the range that it means by a reading: rounding and gate are left.
        return error.reading(error.range(self._chain.read(echoes)), np.zeros(len(ranges))), returns, ranges
