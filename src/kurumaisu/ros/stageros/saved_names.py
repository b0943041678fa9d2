# SPDX-License-Identifier: BSD-3-Clause
"""What a saved state of stageros begins with: the names under which its robots were published."""

from __future__ import annotations

import json
from collections.abc import Sequence

from kurumaisu.errors import Error
from kurumaisu.ros.stageros.names import Names

_MARK = "kurumaisu stageros 1 "


def packed_names(names: Sequence[Names], numbered: int) -> bytes:
    """Return one line that holds the robots' names, in order, and how many robots there have ever been."""
    return (_MARK + json.dumps({"robots": [each.prefix for each in names], "numbered": numbered}) + "\n").encode()


def unpacked_names(saved: bytes) -> tuple[list[str | None], int, bytes]:
    """Return the front of each robot's names, how many there have been, and the rest. Raise Error for other bytes."""
    line, _, state = saved.partition(b"\n")
    try:
        if not line.startswith(_MARK.encode()):
            raise ValueError(f"does not begin with {_MARK!r}")
        known = json.loads(line[len(_MARK) :])
        robots, numbered = known["robots"], known["numbered"]
        if not isinstance(numbered, int) or any(not isinstance(each, (str, type(None))) for each in robots):
            raise ValueError(f"holds {known}")
    except (ValueError, KeyError, TypeError) as error:
        raise Error(f"state: is not one that stageros saved: {error}") from error
    return list(robots), numbered, state
