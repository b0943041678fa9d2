# SPDX-License-Identifier: BSD-3-Clause
"""How often stageros publishes what: by kind, and by a sensor's name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from kurumaisu.errors import Error
from kurumaisu.names import hint
from kurumaisu.settings import Section

KINDS = (
    *("clock", "tf", "odom", "base_pose_ground_truth", "base_scan", "image", "collision"),
    *("bumper", "fiducials"),
)
_ROUNDING = 1e-6  # steps; of a division


@dataclass(frozen=True)
class PublishRates:
    """How often something is published [Hz]; 0: in every step.

    kinds: for each of KINDS; sensors: by a topic's name without its first slash, or by its last part alone.
    """

    kinds: Mapping[str, float]
    sensors: Mapping[str, float]


def read_rates(section: Section) -> PublishRates:
    """Return the rates of a section. Raise Error naming the key."""
    sensors = section.section("sensors")
    by_name = {name.lstrip("/"): sensors.number(name, at_least=0) for name in sensors.names()}
    rates = PublishRates({kind: section.number(kind, at_least=0) for kind in KINDS}, by_name)
    section.end()
    return rates


class Pace:
    """Says what is due in a step."""

    def __init__(self, rates: PublishRates, interval: float) -> None:
        """Note the length of the world's steps [s]. Raise Error for a rate that does not divide that of the steps."""
        self._kinds = {kind: _steps(kind, rate, interval) for kind, rate in rates.kinds.items()}
        self._sensors = {name: _steps(f"sensors.{name}", rate, interval) for name, rate in rates.sensors.items()}

    def every(self, kind: str) -> int:
        """Return how many steps lie between two messages of a kind."""
        return self._kinds[kind]

    def sensor(self, kind: str, topic: str) -> int:
        """Return how many steps lie between two messages of a sensor."""
        name = topic.lstrip("/")
        return self._sensors.get(name, self._sensors.get(name.split("/")[-1], self._kinds[kind]))

    def check(self, topics: Iterable[str]) -> None:
        """Raise Error for a rate of a sensor that none of the topics is of."""
        names = sorted(topic.lstrip("/") for topic in topics)
        known = {*names, *(name.split("/")[-1] for name in names)}
        for name in self._sensors:
            if name not in known:
                raise Error(f"rates: sensors: {name}: there is no sensor of this name; {hint(name, names)}")


def _steps(name: str, rate: float, interval: float) -> int:
    steps = 1.0 if rate == 0 else 1 / (rate * interval)
    if round(steps) < 1 or abs(steps - round(steps)) > _ROUNDING:
        raise Error(f"rates: {name}: must divide the world's {1 / interval:g} Hz: {rate:g}")
    return round(steps)
