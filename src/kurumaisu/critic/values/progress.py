# SPDX-License-Identifier: BSD-3-Clause
"""Who is told how far the critic is."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str], None]
