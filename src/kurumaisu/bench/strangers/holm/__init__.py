# SPDX-License-Identifier: BSD-3-Clause
"""holm: simulated recordings of a wheelchair in which something is hidden, made by the cause."""
from .cases import make

__all__ = ["make"]
