# SPDX-License-Identifier: BSD-3-Clause
"""quay: simulated recordings of many robots, lasers and references, in which something is hidden."""

from kurumaisu.bench.strangers.quay.cases import make

__all__ = ["make"]
