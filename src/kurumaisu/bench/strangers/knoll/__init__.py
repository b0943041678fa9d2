# SPDX-License-Identifier: BSD-3-Clause
"""knoll: simulated recordings of robots in rooms, in which something is hidden."""

from kurumaisu.bench.strangers.knoll.cases import make

__all__ = ["make"]
