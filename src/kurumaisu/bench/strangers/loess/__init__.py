# SPDX-License-Identifier: BSD-3-Clause
"""Wheelchairs and hospital robots in corridors, wards and offices, with something hidden in them."""

from __future__ import annotations

from kurumaisu.bench.strangers.loess.making import make

__all__ = ["make"]
