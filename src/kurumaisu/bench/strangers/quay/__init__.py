# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of robots in which something is hidden."""
from kurumaisu.bench.strangers.quay.cases import make

__all__ = ["make"]
