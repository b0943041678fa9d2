# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of a robot wheelchair in which something is wrong, by somebody who used to repair them."""

from kurumaisu.bench.strangers.loch.build import make

__all__ = ["make"]
