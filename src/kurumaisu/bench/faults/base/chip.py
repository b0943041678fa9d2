# SPDX-License-Identifier: BSD-3-Clause
"""Faults 3 to 6 with a chip behind Linux's IIO in place of the board: nothing about them is the board's."""

from __future__ import annotations

import signal

from kurumaisu.bench.faults.base.board import AWAY, RETURN, unplugged
from kurumaisu.bench.faults.base.cases import Case
from kurumaisu.bench.faults.base.chain import Setup
from kurumaisu.bench.faults.base.ends import dies, guard_dies, stops
from kurumaisu.bench.faults.base.owners import second_guard

_CHIP = Setup(chip=True)
_LET_GO = "then neutral until the stick is let go"

CASES = (
    Case(
        "3",
        "chip: base_node dies",
        "SIGKILL",
        f"neutral within 10 ms; {_LET_GO}",
        dies(signal.SIGKILL),
        _CHIP,
        repeated=True,
    ),
    Case("3", "chip: base_node hangs", "SIGSTOP", f"neutral within the silence + 20 ms; {_LET_GO}", stops, _CHIP),
    Case("4", "chip: guard dies", "SIGKILL", f"neutral within 20 ms; {_LET_GO}", guard_dies, _CHIP, repeated=True),
    Case("5", "chip: gone", f"for {AWAY:g} s", f"held; back, {RETURN}", unplugged, _CHIP),
    Case("6", "chip: two owners", "a second guard", "refused; the first is not disturbed", second_guard, _CHIP),
)
