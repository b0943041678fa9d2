# SPDX-License-Identifier: BSD-3-Clause
"""Criticise the log of a real robotic wheelchair that Debian's mrpt-common installs."""

from __future__ import annotations

from pathlib import Path

from kurumaisu.critic.app import cli
from kurumaisu.critic.app.job import Job

SENA = Path("/usr/share/mrpt/datasets/2006-01ENE-21-SENA_Telecom Faculty_one_loop_only.rawlog")


def run(folder: Path, seed: int) -> None:
    """Print what the critic says of SENA's odometry. Raise Error where the log is not installed."""
    cli.tell(Job(SENA, folder, seed=seed))
