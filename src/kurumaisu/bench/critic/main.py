# SPDX-License-Identifier: BSD-3-Clause
"""How often the critic names what is hidden, misnames it, or raises a false alarm; and what that costs."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from kurumaisu.bench.critic import by_effect, floors


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table of all that the critic must reach, or with --kind that of one kind, effect by effect."""
    parser = argparse.ArgumentParser(prog="scripts/bench critic", description=__doc__)
    parser.add_argument("--draws", type=int, default=4, help="recordings per effect")
    parser.add_argument("--seed", type=int, default=1000)
    by_effect.options_of(parser)
    options = parser.parse_args(arguments)
    idle = [] if options.kind else by_effect.without_kind(options)
    if idle:
        parser.error(f"{', '.join(idle)}: only with --kind, the table of all kinds has its own")
    return by_effect.run(options) if options.kind else floors.run(options)
