# SPDX-License-Identifier: BSD-3-Clause
"""Synthetic recordings of an electric wheelchair in which something is hidden."""

from .make import KINDS, make

__all__ = ["KINDS", "make"]
