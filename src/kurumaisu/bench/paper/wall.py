# SPDX-License-Identifier: BSD-3-Clause
"""How often the intervals of equation (4), found from scans of a wall, hold what the scans were made with.

The scans share nothing with the simulator: a flat wall by hand, readings by the paper's numbers, rounded.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.bench.hidden.generator.laws import LASER_OFFSET, LASER_SCALE, LASER_SIGMA
from kurumaisu.bench.table import Table, share
from kurumaisu.critic.values.recording import LaserMount, Recording, Run, Series
from kurumaisu.paper.laser import law as laser_law
from kurumaisu.paper.laser.wall import ahead_of, places_of
from kurumaisu.paper.options import PaperOptions, load_options
from kurumaisu.params import load_model, shipped

FOUR = (LASER_SCALE, LASER_OFFSET, *LASER_SIGMA)  # equation (4): of mu, of sigma
RESOLUTION = 0.001  # [m]
_STEP = 2 * np.pi / 1024  # [rad] between beams
_BEAMS = 41  # to either side of straight ahead: 14 degrees


@dataclass(frozen=True)
class Case:
    """How a wall is measured: scans at each distance, sd [m] of the tape, the most that it is turned [rad]."""

    name: str
    scans: int = 50
    tape: float = 0.0
    turned: float = 0.0


CASES = (
    Case("as in the paper"),
    Case("20 scans", scans=20),
    Case("taped to 1 mm, which is told", tape=0.001),
    Case("turned by up to 1.5 degrees", turned=np.radians(1.5)),
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 1 where the paper's case lies clearly off its level."""
    parser = argparse.ArgumentParser(prog="scripts/bench paper_wall", description=__doc__)
    parser.add_argument("--walls", type=int, default=200, help="of each case")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(arguments)
    settings = load_options()
    level = settings.bootstrap.level
    title = f"{options.walls} walls each: share of intervals ({100 * level:.0f} %) that hold the truth, exact 90 %"
    table = Table(title, "case                        ", *laser_law.NAMES)
    good = True
    for case in CASES:
        rows = np.array([judge(case, options.seed + n, settings) for n in range(options.walls)])
        table.row(case.name, *(share(int(column.sum()), len(column)) for column in rows.T))
        if case is CASES[0]:
            good = bool((np.abs(rows.mean(axis=0) - level) < 0.05 + 2 / np.sqrt(options.walls)).all())
    return int(not good)


def judge(case: Case, seed: int, options: PaperOptions) -> list[bool]:
    """Return whether each coefficient's interval holds the truth, of one wall."""
    rng = np.random.default_rng(seed)
    distances = options.wall.distances
    runs = tuple(_run(f"place_{n}", case, distance, rng) for n, distance in enumerate(distances))
    mount = LaserMount(0.0, 0.0, 0.0, -_BEAMS * _STEP, _STEP, 2 * _BEAMS + 1)
    recording = Recording("wall", runs, train=tuple(run.name for run in runs), laser=mount)
    laser = load_model(shipped("launch/md100.yaml")).laser
    ahead = [ahead_of(place, options.wall) for place in places_of(recording, distances, laser, options.wall)]
    own = replace(options.bootstrap, seed=seed)
    law = laser_law.fit(ahead, RESOLUTION, case.tape, own)
    return [c.low <= true <= c.high for c, true in zip(law.coefficients, FOUR, strict=True)]


def _run(name: str, case: Case, taped: float, rng: np.random.Generator) -> Run:
    """Return scans of a wall that is where the tape says, within its error."""
    distance = taped + case.tape * rng.standard_normal()
    bearings = _STEP * np.arange(-_BEAMS, _BEAMS + 1)
    r = distance / np.cos(bearings - rng.uniform(-1, 1) * case.turned)
    sigma = FOUR[2] + FOUR[3] * r + FOUR[4] * r**2
    readings = FOUR[0] * r + FOUR[1] + sigma * rng.standard_normal((case.scans, len(r)))
    columns = tuple(f"r{n}" for n in range(len(r)))
    return Run(name, scan=Series(0.1 * np.arange(case.scans), RESOLUTION * np.round(readings / RESOLUTION), columns))
