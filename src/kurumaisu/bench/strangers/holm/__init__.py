# SPDX-License-Identifier: BSD-3-Clause
"""holm: simulated recordings of a wheelchair in which something is hidden, made by the cause."""

from kurumaisu.bench.strangers.holm.cases import make

__all__ = ["make"]
