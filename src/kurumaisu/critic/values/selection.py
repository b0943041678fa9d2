# SPDX-License-Identifier: BSD-3-Clause
"""Names and patterns that a user gives, against what there is: effects by --only and --without, runs by --runs."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase

from kurumaisu import effects
from kurumaisu.errors import Error
from kurumaisu.names import hint

_PAGE = "docs/effects.md"


def effect_ids(only: Sequence[str], without: Sequence[str]) -> frozenset[str] | None:
    """Return the ids of the effects that may be named, by ids or patterns like base.lag_*; None for all.

    The word smooth stands for what is not in the catalogue.

    Raise Error for a pattern that is none of the catalogue, naming near ones, and when nothing is left.
    """
    if not only and not without:
        return None
    catalogue = sorted(those(None))
    wanted: set[str] = set() if only else set(catalogue)
    for pattern in only:
        wanted |= set(matching("--only", pattern, catalogue, "effect", _PAGE))
    for pattern in without:
        wanted -= set(matching("--without", pattern, catalogue, "effect", _PAGE))
    if not wanted:
        raise Error("--without: leaves no effect to look for")
    return frozenset(wanted)


def beside_odometry(ids: frozenset[str] | None) -> frozenset[str]:
    """Return those of these effects, None for all, that may act between what odometry says and how a robot moves."""
    known = {effect.id for effect in effects.BASE if effect.in_odometry}
    return those(ids) - known


def of_turning(ids: frozenset[str] | None) -> frozenset[str]:
    """Return those of these effects, None for all, that show in how a robot turns by itself.

    Others act on how fast it drives by the same parameter, by which they are told from those that do not.
    """
    timely = (effects.Stage.TRANSPORT, effects.Stage.REFERENCE)
    lost = {each.id for each in effects.BASE if each.shows_in is effects.Rate.V and each.stage not in timely}
    apart = {each.id for each in effects.BASE if each.separable}
    return those(ids) - (lost - apart)


def those(ids: frozenset[str] | None) -> frozenset[str]:
    """Return the ids of these effects, None for all, and the word for what is not in the catalogue."""
    return ids if ids is not None else frozenset((*(effect.id for effect in effects.ALL), effects.SMOOTH))


def matching(option: str, pattern: str, names: Sequence[str], what: str, listed: str = "") -> list[str]:
    """Return the names that a pattern matches. Raise Error, with a hint as names.hint has it, when there is none."""
    found = [name for name in names if fnmatchcase(name, pattern)]
    if found:
        return found
    raise Error(f"{option}: there is no {what} {pattern!r}; {hint(pattern, names, listed)}")
