# SPDX-License-Identifier: BSD-3-Clause
"""marl: recordings of invented robots with hidden causes."""

from kurumaisu.bench.strangers.marl.cases import make

__all__ = ["make"]
