# SPDX-License-Identifier: BSD-3-Clause
"""Read a recording, whatever it is made of: bags, CSV tables, or an MRPT rawlog."""

from __future__ import annotations

from pathlib import Path

from kurumaisu.critic.recording import Recording


def read_recording(path: Path) -> Recording:
    """Read a folder of runs, one folder of CSV tables, one bag or one rawlog.

    Raise Error naming file, line and column, topic or key for anything that cannot be read.
    """
    raise NotImplementedError(path)
