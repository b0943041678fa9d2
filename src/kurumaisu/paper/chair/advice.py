# SPDX-License-Identifier: BSD-3-Clause
"""What a calibration needs of a drive: said before, and while it is being recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from kurumaisu.critic.values.recording import Run
from kurumaisu.errors import Error
from kurumaisu.paper.chair import law
from kurumaisu.paper.chair.correlation import correlations
from kurumaisu.paper.chair.law import AxisFit
from kurumaisu.paper.chair.samples import samples_of
from kurumaisu.paper.options import PaperOptions

_QUICK = 99  # resamples, while it is being recorded
WAYS = {
    "translation.positive": "ahead",
    "translation.negative": "backwards",
    "steering.positive": "turning left",
    "steering.negative": "turning right",
}


def plan(options: PaperOptions) -> list[str]:
    """Return which drive to do."""
    o = options.drive
    hold = o.settle + o.window
    return [
        "The law of the chair: every speed with every yaw rate, both ways, each held.",
        "",
        "By script, in 5 x 5 m, nobody aboard; the second is the held-out drive:",
        '  cd "$(rospack find kurumaisu)"',
        "  critic experiment identification --file launch/paper/identification.yaml --bag ~/train.bag",
        "  critic experiment held_out --file launch/paper/held_out.yaml --bag ~/test.bag",
        "By hand, robot.launch's joystick, while `calibrate record train.bag` watches and says what is missing; then",
        "  the same again as test.bag, by another way:",
        f"  hold the stick still for {hold:g} s or more, its voltages within {o.steady:g} V, then another position;",
        f"  at least {o.least_blocks} times each ahead, backwards, left and right, slow ones and fast ones;",
        "  do not always turn the same way at high speed: the two voltages must not be correlated.",
        "Needed: the topics voltages and ground_truth (or scan and odom: the particle filter finds the way).",
        "Then: calibrate drive train.bag --test test.bag --out DIR",
        "",
        f"The laser: a flat wall, at least 1 m wide, square to it; {len(options.wall.distances)} distances "
        f"({', '.join(f'{d:g}' for d in options.wall.distances)} m), {options.wall.scans} scans each,",
        "  not in order; a bag each, named so that they sort as their distances are given:",
        "  rosbag record -O a.bag --duration 6 scan",
        "Then: calibrate laser a.bag b.bag c.bag d.bag e.bag --distances 1 0.2 4 0.5 2 --out DIR",
        "  Every other scan is held out; an error of the tape shows only on a wall set up again: --test f.bag ...",
        "Whether near walls are noisier by range or by incidence: the same bags in a folder with their poses and world",
        "  (docs/recording.md), beams from straight ahead to 70 degrees, so no nearer than 0.2 m to a board of 1 m:",
        "  paper conjecture DIR --distances 1 0.2 4 0.5 2 --out OUT",
    ]


def missing(runs: Sequence[Run], options: PaperOptions) -> list[str]:
    """Return what a drive that is being recorded does not determine yet; empty: enough, and all of it."""
    quick = replace(options, bootstrap=replace(options.bootstrap, resamples=_QUICK))
    try:
        samples = samples_of(runs, None, options.drive)
    except Error as error:
        return [str(error)]
    words = [why for axis in law.axes_of(samples) for why in _of_axis(law.fit_axis(axis, samples, quick))]
    mixed = correlations(samples).drive
    if abs(mixed) > options.drive.mixed:
        words.append(f"the voltages are correlated ({mixed:+.2f}): turn the other way, too, at such speeds")
    return words


def _of_axis(fit: AxisFit) -> list[str]:
    return [f"{WAYS[f'{fit.name}.{side}']}: {b.refused}" for side, b in fit.branches().items() if b.refused]
