# SPDX-License-Identifier: BSD-3-Clause
"""How wrong a scan's stamp is: the driver's clock, the arrival, and MRPT's method, on the same made-up sensors."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kurumaisu.bench.table import Table
from kurumaisu.errors import Error

_PARTS = ("the first second", "1 to 5 s", "5 to 20 s", "20 to 60 s")  # and what comes after them
_WAYS = {
    "tcp": "Ethernet",
    "usb": "USB, 1 ms frames",
    "polled": "serial converter, 16 ms",
    "busy": "USB, a busy host",
}
_METHODS = {"envelope": "ours", "calibrated": "ours, calibrated", "arrival": "arrival", "mrpt": "MRPT"}


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table. Return 1 if another method is better than ours at the end of a run."""
    parser = argparse.ArgumentParser(prog="scripts/bench laser_clock", description=__doc__)
    parser.add_argument("--seeds", type=int, default=50, help="sensors, each with a drift of its own up to 0.2 %%")
    parser.add_argument("--seconds", type=float, default=600.0, help="of each run")
    parser.add_argument(
        "--start", type=float, default=0.0, help="first reading of the clock [ms]; it wraps at 16777216"
    )
    options = parser.parse_args(arguments)
    command = [_simulator(), *map(str, (options.seeds, options.seconds, options.start))]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    rows = [line.split() for line in output.splitlines()]
    title = f"Error of stamps from 60 s on, {options.seeds} sensors for each way; and the worst before [ms]"
    table = Table(title, "way, method", "bias", "sd", "worst", *(f"worst, {part}" for part in _PARTS))
    for way, method, *numbers in rows:
        errors = np.array(numbers, dtype=float).reshape(len(_PARTS) + 1, 3)  # bias, sd, worst in each part of a run
        table.row(f"{_WAYS[way]}: {_METHODS[method]}", *errors[-1], *errors[:-1, 2])
    worst = {(way, method): float(numbers[-1]) for way, method, *numbers in rows}
    return int(any(worst[way, "envelope"] > min(worst[way, "arrival"], worst[way, "mrpt"]) for way in _WAYS))


def _simulator() -> str:
    """Return the path of the program that tests/CMakeLists.txt builds."""
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        path = Path(prefix) / "share/kurumaisu/tests/laser_clock_sim"
        if path.exists():
            return str(path)
    raise Error("laser_clock_sim: is not built: it comes with the tests (target test_laser_clock_sim)")


if __name__ == "__main__":
    sys.exit(main())
