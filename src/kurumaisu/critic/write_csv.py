# SPDX-License-Identifier: BSD-3-Clause
"""Write a run as the CSV tables that read_csv reads."""

from __future__ import annotations

from pathlib import Path

from kurumaisu.critic.recording import Run


def write_csv_run(folder: Path, run: Run) -> None:
    """Write a run into folder, which is made; reading it back gives the same arrays to the last bit."""
    raise NotImplementedError(folder, run)
