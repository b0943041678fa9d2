# SPDX-License-Identifier: BSD-3-Clause
"""fell: simulated recordings of the mechanics of robots, in which something is hidden."""

from kurumaisu.bench.strangers.fell.cases import make

__all__ = ["make"]
