# SPDX-License-Identifier: BSD-3-Clause
"""What to say of a name that there is not."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

_NEAR = 0.6  # share of letters in common from which a name is suggested
_MOST = 3  # suggestions
_FEW = 8  # names that are all told where none is near; of more, the first ones, unless a page lists them


def nearest(name: str, names: Iterable[str]) -> list[str]:
    """Return the names that a mistyped one may stand for, the likeliest first; at most three."""
    known = list(dict.fromkeys(names))
    lower = {one.lower(): one for one in reversed(known)}
    close = [lower[one] for one in get_close_matches(name.lower(), lower, _MOST, _NEAR)]
    return close or [one for one in known if name and name.lower() in one.lower()][:_MOST]


def hint(name: str, names: Iterable[str], listed: str = "") -> str:
    """Return a hint for a name that there is not: near names, all of a few, or where they are listed."""
    known = list(dict.fromkeys(names))
    if near := nearest(name, known):
        return f"did you mean {' or '.join(near)}?"
    if not known:
        return "there is none"
    if len(known) <= _FEW:
        return f"there are: {', '.join(known)}"
    return f"there are {len(known)}: {listed or ', '.join([*known[:_MOST], '...'])}"
