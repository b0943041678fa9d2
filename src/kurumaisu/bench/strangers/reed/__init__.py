# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of a wheelchair in which something is wrong, by a stranger to the critic."""

from kurumaisu.bench.strangers.reed.generate import make

__all__ = ["make"]
