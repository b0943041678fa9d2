# SPDX-License-Identifier: BSD-3-Clause
"""One door to all cases: by kind, ids and seed."""

from __future__ import annotations

from pathlib import Path

from kurumaisu.bench.hidden.base_catalogue import BASE
from kurumaisu.bench.hidden.base_make import make_base
from kurumaisu.bench.hidden.case import Ask, Case
from kurumaisu.bench.hidden.laser_case import make_laser
from kurumaisu.bench.hidden.laser_catalogue import LASER
from kurumaisu.errors import Error


def make(ask: Ask, seed: int, folder: Path | None = None) -> Case:
    """Return the case of a seed; folder: where a laser's world file goes, needed for those.

    Raise Error for an id that is not in the contract, and for a laser without a folder.
    """
    if all(name in BASE for name in ask.ids) and (ask.ids or ask.family == "base"):
        return make_base(ask, seed)
    wrong = [name for name in ask.ids if name not in LASER]
    if wrong:
        raise Error(f"hidden: {wrong[0]!r} is not an id of the {'laser' if wrong[0] in BASE else 'contract'}")
    if folder is None:
        raise Error(f"hidden: {', '.join(ask.ids) or 'a laser'}: needs a folder for its world file")
    return make_laser(ask, seed, folder)
