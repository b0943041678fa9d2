# SPDX-License-Identifier: BSD-3-Clause
"""A reference pose where nobody measured one: the particle filter's trajectory through the scans."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from kurumaisu.critic.recording import Recording


def with_reference(recording: Recording, settings: Path, seed: int, progress: Callable[[str], None]) -> Recording:
    """Return the recording with a pose for every run; settings: the mapping node's file.

    Raise Error for a run that has neither a pose nor scans and odometry to find one from.
    """
    runs = tuple(
        run if run.pose is not None else _mapped(recording, run, settings, seed, progress) for run in recording.runs
    )
    return replace(recording, runs=runs)
