# SPDX-License-Identifier: BSD-3-Clause
"""python -m kurumaisu.demo: the three parts, one after the other, and where to look."""

from __future__ import annotations

import secrets
import sys
import time
from pathlib import Path

from kurumaisu import program
from kurumaisu.demo import hidden, real, round_trip
from kurumaisu.errors import Error


def main() -> int:
    """Run the demonstration; return 0, or 1 when a part failed."""
    parser = program.Parser(prog="scripts/demo", description="The whole idea in five minutes.")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/demo"), help="folder to write into")
    parser.add_argument("--gui", action="store_true", help="show the drive and its map in rviz")
    parser.add_argument("--seed", type=int, help="seed of the drive and of the hidden effect (default: random)")
    options = parser.parse_args()
    seed = options.seed if options.seed is not None else secrets.randbelow(10_000)
    folder = options.output.resolve()
    start = time.monotonic()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _title("1/3  a chair drives a round in a simulated building; a particle filter maps it")
        round_trip.run(folder / "round", seed, gui=options.gui)
        _title("2/3  something is wrong with the next chair; the critic has to say what")
        hidden.run(folder / "hidden", seed)
        _title("3/3  a real robotic wheelchair (SENA, University of Malaga); what does its odometry get wrong?")
        real.run(folder / "sena", seed)
    except OSError as error:
        print(f"demo: {error.filename}: {error.strerror}", file=sys.stderr)
        return 1
    except Error as error:
        print(f"demo: {error}", file=sys.stderr)
        return 1
    _title(f"done in {time.monotonic() - start:.0f} s; look at")
    for what, path in (
        ("map and trajectory", "round/map.png"),
        ("bag of the drive", "round/round.bag"),
        ("report, hidden effect", "hidden/report.html"),
        ("report, real wheelchair", "sena/report.html"),
    ):
        print(f"  {what:24} {folder / path}")
    return 0


def _title(text: str) -> None:
    print(f"\n== {text}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
