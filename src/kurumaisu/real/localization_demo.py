# SPDX-License-Identifier: BSD-3-Clause
"""MRPT's localization_demo: a SICK on a chair, 37 scans with long ways between."""

from __future__ import annotations

from pathlib import Path

from kurumaisu.real import sena


def run(data: Path, output: Path) -> None:
    """Print what can be said of it; data is not needed."""
    sena.run(data, output, "localization_demo.rawlog")
