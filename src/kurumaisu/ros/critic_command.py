# SPDX-License-Identifier: BSD-3-Clause
"""The command critic: which part of it is meant. Only those that need ROS import it, and only when they are."""

from __future__ import annotations

import os
import sys


def main() -> int:
    """Run a command by its name, or criticise recordings; return the exit code."""
    # The same sums in the same order, however many cores there are and however many recordings run at once.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    name, arguments = (sys.argv[1] if len(sys.argv) > 1 else ""), sys.argv[2:]
    if name == "watch":
        from kurumaisu.ros import critic_watch

        return critic_watch.main(arguments)
    from kurumaisu.critic import cli

    return cli.main()
