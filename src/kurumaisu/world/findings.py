# SPDX-License-Identifier: BSD-3-Clause
"""What may not be what the author of a world meant, and how it is told: alike things once."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from kurumaisu.world.model import Place

_MOST_NAMES = 3  # that are told one by one
_NUMBER = re.compile(r"\d+(\.\d+)?")


@dataclass(frozen=True)
class Finding:
    """Something that may not be what its author meant, said of a subject; routine: most worlds have it."""

    place: Place
    subject: str
    words: str
    routine: bool = False

    def __str__(self) -> str:
        return f"{self.place}: {self.subject}: {self.words}"


def told(findings: Iterable[Finding]) -> Iterator[str]:
    """Yield a line for findings that differ in subjects and numbers only, by the first of them."""
    alike: dict[str, list[Finding]] = {}
    for finding in findings:
        alike.setdefault(_NUMBER.sub("#", finding.words), []).append(finding)
    for group in alike.values():
        first = group[0]
        about = "" if all(finding.words == first.words for finding in group) else ", of the first"
        yield f"{first.place}: {_subjects([finding.subject for finding in group])}{about}: {first.words}"


def _subjects(names: list[str]) -> str:
    several = list(dict.fromkeys(names))
    if len(several) > _MOST_NAMES:
        return f"{several[0]} ... {several[-1]} ({len(names)})"
    return ", ".join(several) + (f" ({len(names)})" if len(names) > len(several) else "")
