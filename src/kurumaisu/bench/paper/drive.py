# SPDX-License-Identifier: BSD-3-Clause
"""How often the intervals of equations (1) and (2), found from drives, hold what the chair was made with.

The drives share nothing with the simulator: laws typed from the paper, integrated by the midpoint rule at 1 ms, noise
of the rates as a filter of its own. What is driven is the package's identification drive.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.hidden.generator.laws import STEERING, TRANSLATION
from kurumaisu.bench.table import Table, share
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.experiments import samples
from kurumaisu.paper.chair import drive, law
from kurumaisu.paper.chair.samples import samples_of
from kurumaisu.paper.options import PaperOptions, load_options
from kurumaisu.types import FloatArray

Line = tuple[float, float]  # slope, intercept
Law = tuple[Line, Line]  # positive, negative
_LEFT, _RIGHT = STEERING
CORRECTED: Law = ((_LEFT[0], -_LEFT[1]), (_RIGHT[0], -_RIGHT[1]))
_STEP = 0.001  # [s]
_EVERY = 100  # steps between poses
_TICK = 0.02  # [s] of commands


@dataclass(frozen=True)
class Case:
    """A chair, its floor, and who watches it.

    sd_v [m/s], sd_w [rad/s], tau [s]: noise of the rates; pose_sd [m, rad] of the reference; known: whether somebody
    says so; lag [s]: of first order, of both rates; code [V]: step of the D/A; slips: share of windows in which the
    reference, or the floor, is far off; told: whether the voltages come with the rates they stand for.
    """

    name: str
    steering: Law = STEERING
    sd_v: float = 0.01
    sd_w: float = 0.02
    tau: float = 0.3
    pose_sd: float = 0.005
    known: bool = True
    lag: float = 0.0
    code: float = 0.0
    slips: float = 0.0
    told: bool = True
    translation: Law = TRANSLATION
    base: tuple[Law, Law] | None = None  # by which the base makes voltages of commands; None: that of the chair


CASES = (
    Case("usual"),
    Case("corrected (2)", steering=CORRECTED),
    Case("nobody tells signs", told=False),
    Case("slow noise", sd_v=0.02, sd_w=0.03, tau=2.0),
    Case("slower noise, 6 s", sd_v=0.02, sd_w=0.03, tau=6.0),
    Case("slowest noise, 20 s", sd_v=0.02, sd_w=0.03, tau=20.0),
    Case("poor reference, not told", pose_sd=0.02, known=False),
    Case("12 bits over 5 V", code=5 / 4095),
    Case("lag of 0.2 s", lag=0.2),
    Case("a slip in 2 % of seconds", slips=0.02),
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 1 where the usual case's rate lies clearly off its level."""
    parser = argparse.ArgumentParser(prog="scripts/bench paper", description=__doc__)
    parser.add_argument("--drives", type=int, default=100, help="of each case")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--case", default="", help="only those whose name has this in it")
    options = parser.parse_args(arguments)
    settings = load_options()
    wanted = settings.bootstrap.level
    title = f"{options.drives} drives each: share of intervals ({100 * wanted:.0f} %) that hold the truth, exact 90 %"
    table = Table(title, "case", "all 8", "slopes", "intercepts", "refused", "paper's", "slope sd/half", "bias/half")
    good = True
    for case in (case for case in CASES if options.case in case.name):
        told = [judge(case, options.seed + n, settings) for n in range(options.drives)]
        table.row(case.name, *_row(told))
        if case.name == "usual":
            held = np.mean([hit for one in told for hit in one.held])
            good = abs(held - wanted) < 0.05 + 2 / np.sqrt(options.drives)
    return int(not good)


@dataclass(frozen=True)
class Judged:
    """A drive: whether each of (up to) 8 intervals holds the truth, whether the paper's estimate lies in it; errors.

    held, slope: per coefficient, and whether it is a slope; error: in half widths; paper: of least squares, likewise.
    """

    held: list[bool]
    slope: list[bool]
    error: list[float]
    paper: list[float]
    refused: int


def judge(case: Case, seed: int, options: PaperOptions) -> Judged:
    """Return what the identification of one drive comes to."""
    rng = np.random.default_rng(seed)
    run = make(case, rng)
    found = samples_of([run], (case.pose_sd, case.pose_sd) if case.known else None, options.drive)
    judged = Judged([], [], [], [], 0)
    for axis, truth in zip(law.axes_of(found), (case.translation, case.steering), strict=True):
        own = replace(options, bootstrap=replace(options.bootstrap, seed=seed))
        fit = law.fit_axis(axis, found, own)
        for branch, line in zip((fit.positive, fit.negative), truth, strict=True):
            judged = _add(judged, branch, line)
    return judged


def _add(judged: Judged, branch: law.BranchFit, truth: Line) -> Judged:
    if branch.refused or branch.paper is None or branch.slope is None or branch.intercept is None:
        return replace(judged, refused=judged.refused + 1)
    plain = (branch.paper.slope, branch.paper.intercept)
    for number, (found, true) in enumerate(zip((branch.slope, branch.intercept), truth, strict=True)):
        judged.held.append(found.low <= true <= found.high)
        judged.slope.append(number == 0)
        judged.error.append((found.value - true) / found.half * np.sign(truth[number]))
        judged.paper.append((plain[number] - true) / found.half)
    return judged


def _row(told: list[Judged]) -> tuple[str | float, ...]:
    held = np.array([hit for one in told for hit in one.held])
    slope = np.array([is_slope for one in told for is_slope in one.slope])
    error = np.array([e for one in told for e in one.error])
    paper = np.array([abs(e) <= 1 for one in told for e in one.paper])
    return (
        share(int(held.sum()), len(held)),
        share(int(held[slope].sum()), int(slope.sum())),
        share(int(held[~slope].sum()), int((~slope).sum())),
        sum(one.refused for one in told) / (4 * len(told)),
        f"{paper.mean():.2f}",
        float(np.std(error[slope])),
        float(np.mean(error[slope])),
    )


def make(case: Case, rng: np.random.Generator, file: str = drive.IDENTIFICATION) -> Run:
    """Return a drive of launch/paper on a chair of this case."""
    rows = samples(drive.script(file).phases, _TICK)
    base = case.base or (case.translation, case.steering)
    volts = np.column_stack([_volts(rows[:, 1], base[0]), _volts(rows[:, 2], base[1])])
    if case.code > 0:
        volts = case.code * np.round(volts / case.code)
    per_tick = round(_TICK / _STEP)
    count = per_tick * (len(rows) - 1)
    rates = []
    for column, table, sd in ((0, case.translation, case.sd_v), (1, case.steering, case.sd_w)):
        asked = _rates(volts[:-1, column], rows[:-1, 1 + column], table)
        rates.append(_follow(np.repeat(asked, per_tick), case) + _wander(count, sd, case.tau, rng))
    poses = _path(*rates)[::_EVERY]
    t = _STEP * _EVERY * np.arange(len(poses))
    seen = poses + case.pose_sd * rng.standard_normal(poses.shape) + _slipped(t, case.slips, rng)
    columns = ("v_f", "v_s", "v", "w") if case.told else ("v_f", "v_s")
    values = np.column_stack([volts, rows[:, 1:]])[:, : len(columns)]
    return Run(case.name, voltage=Series(rows[:, 0], values, columns), pose=Series(t, seen, ("x", "y", "theta")))


def _volts(rate: FloatArray, law_: Law) -> FloatArray:
    (a, b), (c, d) = law_
    return np.where(rate > 0, a * rate + b, np.where(rate < 0, c * rate + d, 0.0))


def _rates(volts: FloatArray, commanded: FloatArray, law_: Law) -> FloatArray:
    """Return what the chair does: on the commanded side, as far as that branch goes."""
    (a, b), (c, d) = law_
    ahead, back = np.maximum((volts - b) / a, 0.0), np.minimum((volts - d) / c, 0.0)
    return np.where(commanded > 0, ahead, np.where(commanded < 0, back, 0.0))


def _follow(asked: FloatArray, case: Case) -> FloatArray:
    """Return a rate that follows with a lag, by the exact step of a first-order system."""
    if case.lag == 0:
        return asked
    keep = np.exp(-_STEP / case.lag)
    return np.asarray(lfilter([1 - keep], [1.0, -keep], asked))


def _wander(count: int, sd: float, tau: float, rng: np.random.Generator) -> FloatArray:
    keep = np.exp(-_STEP / tau)
    drive_noise = sd * np.sqrt(1 - keep**2) * rng.standard_normal(count)
    drive_noise[0] = sd * rng.standard_normal()
    return np.asarray(lfilter([1.0], [1.0, -keep], drive_noise))


def _path(v: FloatArray, w: FloatArray) -> FloatArray:
    heading = np.concatenate([[0.0], np.cumsum(w * _STEP)])
    middle = heading[:-1] + 0.5 * w * _STEP
    x, y = (np.concatenate([[0.0], np.cumsum(v * way(middle) * _STEP)]) for way in (np.cos, np.sin))
    return np.column_stack([x, y, heading])


def _slipped(t: FloatArray, chance: float, rng: np.random.Generator) -> FloatArray:
    """Return jumps of the pose that stay: in so many seconds, of 5 cm and 5 degrees."""
    jumps = np.zeros((len(t), 3))
    seconds = np.flatnonzero(rng.random(int(t[-1])) < chance)
    at = np.searchsorted(t, seconds + 0.5)
    jumps[at] = rng.standard_normal((len(at), 3)) * [0.05, 0.05, np.radians(5)]
    return np.cumsum(jumps, axis=0)
