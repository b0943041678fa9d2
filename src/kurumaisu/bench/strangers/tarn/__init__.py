# SPDX-License-Identifier: BSD-3-Clause
"""Simulated recordings of robots in which something is hidden, to measure a program that looks for it."""

from kurumaisu.bench.strangers.tarn.make import make

__all__ = ["make"]
