# SPDX-License-Identifier: BSD-3-Clause
"""The report: one self-contained HTML page that tells the verdict to a tired engineer."""

from __future__ import annotations

from pathlib import Path

from kurumaisu.critic.story import Story
from kurumaisu.critic.verdict import Verdict


def write_report(path: Path, verdict: Verdict, story: Story) -> None:
    """Write report.html with its pictures, tables and data in the one file."""
    raise NotImplementedError(path, verdict, story)
