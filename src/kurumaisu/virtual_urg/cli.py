# SPDX-License-Identifier: BSD-3-Clause
"""The command `virtual_urg`: a sensor at a pty or a TCP port until Ctrl-C."""

from __future__ import annotations

import argparse
import contextlib
import math
import signal
import sys
import time
from pathlib import Path

import numpy as np

from kurumaisu import program
from kurumaisu._core import urg_fault_help
from kurumaisu.errors import Error
from kurumaisu.types import FloatArray
from kurumaisu.virtual_urg import feeds
from kurumaisu.virtual_urg.models import Sensor, load_sensor, sensor_names
from kurumaisu.virtual_urg.urg import Pty, Tcp, VirtualUrg

_COUNTED = {
    "clients": "clients connected",
    "commands": "commands heard, of which",
    "refused": "refused",
    "scans": "scans sent, of which",
    "dropped": "dropped: the client left no room",
    "unheard": "without a client",
    "late": "turns skipped: this computer was too busy",
    "bytes_in": "bytes in",
    "bytes_out": "bytes out",
    "garbled": "bytes in or out at the wrong rate",
    "lost_input": "bytes in dropped: line too long, or while booting or stalled",
}


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0, or 1 for bad input, which is told on stderr."""
    parser = _parser()
    options = parser.parse_args(program.words(arguments))
    if options.faults:
        print(urg_fault_help())
        return 0
    if options.pty is None and options.tcp is None:
        parser.error("one of the arguments --pty --tcp is required")
    if (options.world is None) != (options.pose is None):
        parser.error("--world and --pose: give both or neither")
    try:
        sensor = load_sensor(options.sensor)
        feed, changes = _feed(sensor, options)
        at = Pty(options.pty) if options.pty is not None else Tcp(options.tcp, options.host)
        with VirtualUrg(sensor, at, faults=options.fault, drift=options.drift, line_rate=options.line_rate) as urg:
            _serve(urg, feed, changes, options)
    except Error as error:
        print(f"virtual_urg: {error}", file=sys.stderr)
        return 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = program.Parser(prog="virtual_urg", description="Simulate a laser scanner, for any client.")
    names = ", ".join(sensor_names())
    parser.add_argument("--sensor", default="urg_04lx", metavar="NAME", help=f"a file *.yaml or one of {names}")
    place = parser.add_mutually_exclusive_group()
    place.add_argument("--pty", type=Path, metavar="LINK", help="a serial port of that name")
    place.add_argument("--tcp", type=int, metavar="PORT", help="a TCP port; 0: any that is free")
    parser.add_argument("--host", default="127.0.0.1", help="address of --tcp; 0.0.0.0: of all networks (127.0.0.1)")
    sight = parser.add_mutually_exclusive_group()
    sight.add_argument("--range", type=_length, default=1.0, metavar="R", help="walls all around [m] (1.0); inf: none")
    sight.add_argument("--wall", type=_length, metavar="D", help="a wall ahead [m], with noise")
    sight.add_argument("--world", type=Path, metavar="FILE", help="a Stage world, with noise")
    parser.add_argument(
        "--pose", type=float, nargs=3, metavar=("X", "Y", "YAW"), help="pose of the sensor in --world [m, m, rad]"
    )
    parser.add_argument("--intensity", type=float, metavar="I", help="of every step, if the sensor sends it")
    parser.add_argument("--fault", action="append", default=[], metavar="NAME[@SCAN][=VALUE]", help="see --faults")
    parser.add_argument("--faults", action="store_true", help="list the faults and exit")
    parser.add_argument("--drift", type=float, default=0.0, metavar="D", help="drift of its clock, as 1.25e-3 (0)")
    parser.add_argument("--line-rate", action="store_true", help="send bytes as slowly as RS-232 does")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the noise (1)")
    parser.add_argument("--duration", type=float, default=math.inf, metavar="S", help="end after so long [s]")
    return parser


def _length(text: str) -> float:
    value = float(text)
    if not value > 0:
        raise ValueError(text)
    return value


def _feed(sensor: Sensor, options: argparse.Namespace) -> tuple[feeds.Feed, bool]:
    """Return what the sensor sees, and whether it changes from turn to turn."""
    if options.world is not None:
        return feeds.world(sensor, options.world, np.array(options.pose), options.seed), True
    if options.wall is not None:
        return feeds.wall(sensor, options.wall, options.seed), True
    return lambda: np.full(sensor.steps, options.range), False


def _serve(urg: VirtualUrg, feed: feeds.Feed, changes: bool, options: argparse.Namespace) -> None:
    """Show a feed until Ctrl-C or the end of the duration, then say what happened."""
    intensities: FloatArray | None = None
    if options.intensity is not None:
        intensities = np.full(urg.sensor.steps, options.intensity)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends it as Ctrl-C does
    print(f"{urg.sensor.model.name} at {urg.address}", flush=True)
    with contextlib.suppress(KeyboardInterrupt):
        start = due = time.monotonic()
        while due < start + options.duration:
            urg.show(feed(), intensities)
            # What a stopped process missed is not made up for.
            due = max(due + (urg.sensor.scan_time if changes else 1.0), time.monotonic())
            time.sleep(max(min(due, start + options.duration) - time.monotonic(), 0.0))
    counters = urg.counters
    print("\n".join(f"{counters[name]:>12} {meaning}" for name, meaning in _COUNTED.items()), flush=True)
