# SPDX-License-Identifier: BSD-3-Clause
"""critic watch (to come)."""

from __future__ import annotations

from collections.abc import Sequence


def main(arguments: Sequence[str]) -> int:
    """Watch."""
    raise NotImplementedError
