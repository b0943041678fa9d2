# SPDX-License-Identifier: BSD-3-Clause
"""What scans are to read with one model after another, some of them at a time, worked out once for all of them."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

from kurumaisu import effects
from kurumaisu.critic.predict.scan import Expected, expected_from, shifted_hits, without_random
from kurumaisu.critic.ranges.scans.beams import BeamHits, Shots
from kurumaisu.critic.values.settings import Settings
from kurumaisu.params import EffectSetting
from kurumaisu.types import IntArray

_MOST = 24  # models whose expectations are kept: 3 MB each for 60 scans
_PLACES = 2  # likewise of what beams meet: 18 MB


class Expectations:
    """Expected readings of some shots; no scan's depend on which others there are."""

    def __init__(self, shots: Shots) -> None:
        self.shots = shots
        self._own = {setting.id for setting in shots.own}
        self._plain: dict[Hashable, Settings] = {}
        self._known: dict[Hashable, Expected] = {}
        self._looks: dict[Hashable, list[BeamHits]] = {}

    def of(self, settings: Settings) -> Expected:
        """Return what the shots are to read with these effects."""
        asked = _key(settings)
        if asked not in self._plain:
            self._plain[asked] = tuple(without_random(self.shots, settings))
        plain = self._plain[asked]
        key = _key(plain)
        if key not in self._known:
            found = expected_from(self.shots, plain, self._seen(plain))
            _forget(self._known, _MOST)
            self._known[key] = found
        return self._known[key]

    def rows(self, settings: Settings, rows: IntArray) -> Expected:
        """Return the same of some of the scans."""
        what = self.of(settings)
        return Expected(what.mean[rows], what.parts[:, rows], what.shared[rows], what.place[rows])

    def _seen(self, settings: Settings) -> list[BeamHits]:
        """Return looks, which effects that act on readings alone do not change."""
        placing = [each for each in settings if each.id in self._own or not _reads(each.id)]
        key = _key(placing)
        if key not in self._looks:
            around = shifted_hits(self.shots, settings)
            _forget(self._looks, _PLACES)
            self._looks[key] = around
        return self._looks[key]


def _reads(name: str) -> bool:
    return issubclass(effects.by_id(name), effects.ReadingEffect)


def _forget(known: dict[Hashable, Expected] | dict[Hashable, list[BeamHits]], most: int) -> None:
    """Leave room for one more: the first stays, for it is that without effects, to which all are compared."""
    if len(known) >= most:
        del known[list(known)[1]]


def _key(settings: Sequence[EffectSetting]) -> Hashable:
    return tuple((each.id, tuple(sorted(each.parameters.items()))) for each in settings)
