# SPDX-License-Identifier: BSD-3-Clause
"""What passed, and what it was then: in .ws, so that a clean clone has to pass everything."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import sources
from results import Counts

FOLDER = sources.ROOT / ".ws/passed"


@dataclass(frozen=True)
class Part:
    """What passes or fails by itself; state: a hash of what it depends on, none if it always runs; path: for pytest."""

    name: str
    state: Callable[[], str]
    path: Path | None = None
    quick: bool = False  # without what takes long: passing says little to who asks for all


def counts(part: Part, state: str) -> Counts | None:
    """Return what a part's tests came to when it passed, if that was in this state."""
    for kind in ("all", *(["quick"] if part.quick else [])):
        kept = _read(part.name, kind)
        if state and kept.get("state") == state:
            return Counts(*kept["counts"])
    return None


def keep(part: Part, state: str, found: Counts, took: float) -> None:
    """Note that a part has passed in this state."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    kept = {"state": state, "counts": [found.passed, found.failed, found.skipped], "seconds": took}
    _path(part.name, "quick" if part.quick else "all").write_text(json.dumps(kept))


def seconds(name: str, otherwise: float) -> float:
    """Return how long the tests of a part took when all passed last."""
    return float(_read(name, "all").get("seconds", otherwise))


def _path(name: str, kind: str) -> Path:
    return FOLDER / f"{name}.{kind}.json"


def _read(name: str, kind: str) -> dict[str, Any]:
    try:
        found: dict[str, Any] = json.loads(_path(name, kind).read_text())
    except (OSError, ValueError):
        return {}
    return found
