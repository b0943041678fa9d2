# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of robots of laboratories and warehouses, with something hidden in them."""

from __future__ import annotations

from kurumaisu.bench.strangers.scree.case import make

__all__ = ["make"]
