# SPDX-License-Identifier: BSD-3-Clause
"""Criticise the log of a real robotic wheelchair that Debian's mrpt-common installs."""

from __future__ import annotations

from pathlib import Path

from kurumaisu.critic.app import cli
from kurumaisu.critic.app.job import Job
from kurumaisu.real import sena


def run(folder: Path, seed: int) -> None:
    """Print what the critic says of SENA's odometry. Raise Error where the log is not installed."""
    cli.tell(Job(sena.FOLDER / sena.LOG, folder, seed=seed))
