# SPDX-License-Identifier: BSD-3-Clause
"""Figures 3 to 6 and equations (1), (2): from a recording of a drive to the law of the chair."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from kurumaisu._core import AxisLaw
from kurumaisu.critic.data.reference import with_reference
from kurumaisu.critic.values.recording import Recording
from kurumaisu.errors import Error
from kurumaisu.paper.chair import figures, law
from kurumaisu.paper.chair.correlation import Correlations, correlations
from kurumaisu.paper.chair.law import AxisFit, BranchFit
from kurumaisu.paper.chair.samples import Samples, samples_of
from kurumaisu.paper.options import PaperOptions
from kurumaisu.params import Model

# What was commanded is not looked at: what the D/A put out counts.
_COMMAND = ("cmd_vel", "experiment_vel", "command.csv")
Progress = Callable[[str], None]


@dataclass(frozen=True)
class Identification:
    """What a drive says of a chair. source: of the reference pose."""

    name: str
    samples: Samples
    fits: tuple[AxisFit, AxisFit]
    correlations: Correlations
    source: str
    warnings: tuple[str, ...]

    @property
    def refused(self) -> list[str]:
        """Return which branches are not determined, and why."""
        return [why for fit in self.fits for why in fit.refused]


def identify(recording: Recording, options: PaperOptions, progress: Progress) -> Identification:
    """Return what a recording says; the reference pose is the particle filter's where none was measured.

    Raise Error when it has no voltages, no way to a pose, or is wrong data, as the critic's reader says.
    """
    wrong = [words for words in recording.invalid if not any(name in words.split(": ")[0] for name in _COMMAND)]
    if wrong:
        raise Error(f"{recording.name}: {'; '.join(wrong)}")
    whole = with_reference(recording, options.bootstrap.seed, progress)
    runs = [run for run in whole.runs if run.voltage is not None and run.pose is not None]
    if not runs:
        raise Error(f"{recording.name}: no run has voltages; record the topic voltages, or voltage.csv")
    samples = samples_of(runs, recording.truth, options.drive)
    first, second = (law.fit_axis(axis, samples, options) for axis in law.axes_of(samples))
    found = correlations(samples)
    sources = sorted({run.pose_source for run in runs})
    return Identification(
        recording.name,
        samples,
        (first, second),
        found,
        "; ".join(sources),
        tuple(_warnings((first, second), found, options)),
    )


def _warnings(fits: Sequence[AxisFit], found: Correlations, options: PaperOptions) -> list[str]:
    words = []
    if abs(found.drive) > options.drive.mixed:
        words.append(
            f"V_f and V_s of this drive are correlated ({found.drive:+.2f}): it cannot tell whether V_f turns "
            "the chair, or V_s drives it"
        )
    for fit in fits:
        for side, branch in fit.branches().items():
            if not branch.refused and abs(branch.curvature) > options.drive.bent:
                words.append(
                    f"{fit.name}.{side} is not straight: its square term is {branch.curvature:+.1f} standard errors"
                )
        if not fit.refused and fit.overlap:
            words.append(
                f"{fit.name}: both branches cover voltages around 0, as in (2) as printed: base_node does not start "
                "with such a law as `custom`"
            )
    return words


def lines(found: Identification, nominal: Sequence[AxisLaw]) -> list[str]:
    """Return it as text, beside the model's own law."""
    c = found.correlations
    steady = int(found.samples.steady.sum())
    rows = [
        f"{found.name}: {steady} steady samples of {len(found.samples)}; reference pose: {found.source}",
        f"correlation: v with V_f {c.v_with_f:+.4f}, with V_s {c.v_with_s:+.4f}; "
        f"yaw rate with V_f {c.w_with_f:+.4f}, with V_s {c.w_with_s:+.4f}",
        f"{'branch':22s}{'slope':>10s} {'interval':>18s}{'model':>10s}"
        f"{'intercept':>12s} {'interval':>18s}{'model':>10s}",
    ]
    for fit, law_ in zip(found.fits, nominal, strict=True):
        rows += [_row(f"{fit.name}.{side}", branch, getattr(law_, side)) for side, branch in fit.branches().items()]
        if not fit.refused:
            rows.append(f"{fit.name}: {dead_zone(fit)}")
    return rows + [f"note: {words}" for words in found.warnings]


def _row(name: str, branch: BranchFit, own: object) -> str:
    if branch.refused or branch.slope is None or branch.intercept is None:
        return f"{name:22s}refused: {branch.refused}"
    words = f"{name:22s}"
    for key, coefficient in (("slope", branch.slope), ("intercept", branch.intercept)):
        span = f"{coefficient.low:.4f} to {coefficient.high:.4f}"
        words += f"{coefficient.value:{10 if key == 'slope' else 12}.4f} {span:>18s}{getattr(own, key):10.4f}"
    return words


def dead_zone(fit: AxisFit) -> str:
    """Return where no branch answers, in words."""
    ends = sorted(branch.intercept.value for branch in fit.branches().values() if branch.intercept is not None)
    if fit.overlap:
        return f"no dead zone: both branches answer from {ends[0]:+.4f} to {ends[1]:+.4f} V"
    return f"dead zone from {ends[0]:+.4f} to {ends[1]:+.4f} V"


def write(found: Identification, model: Model, folder: Path) -> None:
    """Write figures_3_to_6.svg and the data beside it. Raise Error naming the file that cannot be written."""
    nominal = model.translation, model.steering
    figures.draw(folder / "figures_3_to_6.svg", found.samples, found.fits, nominal, found.correlations)
    figures.data(folder / "figures_3_to_6.csv", found.samples)
    figures.coefficients(folder / "equations_1_2.csv", found.fits, nominal)
