# SPDX-License-Identifier: BSD-3-Clause
"""The report: one self-contained HTML page that tells the verdict to a tired engineer."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import repeat
from pathlib import Path

import jinja2
import numpy as np
from markupsafe import Markup

from kurumaisu import effects
from kurumaisu.critic.data.csv_reader import csv_text
from kurumaisu.critic.report import figures
from kurumaisu.critic.values.digits import MINUS, bare, odds, quantities
from kurumaisu.critic.values.story import Bins, Comparison, Misfit, Overlay, Story
from kurumaisu.critic.values.verdict import Verdict, grouped
from kurumaisu.types import BoolArray, FloatArray

LABELS = {
    "named": "Cause named",
    "none": "Nothing found",
    "confounded": "Cannot tell which",
    "unknown": "Outside the catalogue",
    "invalid_data": "Data are wrong",
}
# Pictures of runs shown at once; the others can be unfolded, and those beyond are not drawn.
OVERLAYS_SHOWN = 4
OVERLAYS_DRAWN = 12
LARGEST = 100  # samples of a misfit in its data though the picture leaves them out: where to look first
MOST_PLACES = 3000  # of all measured paths of a page together: more are megabytes that nobody reads
_MOMENT = ("run", "t [s]", "x [m]", "y [m]")
_NO_MOMENT = ("",) * len(_MOMENT)


def report_page(verdict: Verdict, story: Story) -> str:
    """Return report.html with its pictures, tables and data in the one file."""
    # Runs that no model fitted are what the gain was measured on, so they come first.
    runs = sorted(story.overlays, key=lambda overlay: not overlay.held_out)
    drawn = thinned(runs[:OVERLAYS_DRAWN])
    overlays = [overlay_picture(overlay, f"run{i}") for i, overlay in enumerate(drawn)]
    gain = verdict.gain.log_density_per_sample.gain if verdict.gain else 0.0
    misfits = [misfit_picture(misfit, f"misfit{i}") for i, misfit in enumerate(story.misfits)]
    return (
        _environment()
        .get_template("report.html")
        .render(
            verdict=verdict,
            story=story,
            label=LABELS[verdict.verdict],
            factor=math.exp(min(gain, 50.0)),
            overlays=overlays[:OVERLAYS_SHOWN],
            more_overlays=overlays[OVERLAYS_SHOWN:],
            undrawn=len(runs) - len(drawn),
            restart=max((overlay.restart for overlay in drawn), default=0.0),
            misfits=misfits + [comparison_picture(each, f"numbers{i}") for i, each in enumerate(story.comparisons)],
            problems=grouped(verdict.problems),
        )
    )


def meaning(name: str) -> str:
    """Return what an effect of the catalogue does, in words; nothing for another name."""
    return next((effect.sentence for effect in effects.ALL if effect.id == name), "")


def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["quantities"] = quantities
    environment.filters["bare"] = bare
    environment.filters["odds"] = odds
    environment.filters["meaning"] = meaning
    environment.filters["signed"] = lambda value, form: f"{value:{form}}".replace("-", MINUS)
    return environment


@dataclass(frozen=True)
class Picture:
    """A figure of the page: SVG, what it shows for those who cannot see it, caption, and its data as CSV."""

    title: str
    svg: Markup
    alt: str
    caption: str
    file: str
    data: str


def thinned(overlays: Sequence[Overlay]) -> list[Overlay]:
    """Return overlays whose paths have few enough points for a page, ends and gaps kept."""
    step = -(-sum(len(overlay.measured) for overlay in overlays) // MOST_PLACES)
    if step <= 1:
        return list(overlays)
    return [
        replace(
            overlay,
            measured=overlay.measured[_kept(step, overlay.measured)],
            baseline=overlay.baseline[_kept(step, overlay.baseline)],
            extended=None if overlay.extended is None else overlay.extended[_kept(step, overlay.extended)],
            times=None if overlay.times is None else overlay.times[_kept(step, overlay.measured)],
        )
        for overlay in overlays
    ]


def overlay_picture(overlay: Overlay, name: str) -> Picture:
    """Return a run from above; name: of the file of its data, and prefix of ids."""
    offs = {
        said: off
        for said, off in (("with the original model", overlay.off), ("with the extended one", overlay.off_extended))
        if off is not None
    }
    told = ", ".join(f"{text} {said}" for said, text in zip(offs, quantities(list(offs.values()), "m"), strict=True))
    told = f"Error after {overlay.restart:g} s: {told} (rms)." if told else ""
    paths = {"measured": overlay.measured, "baseline": overlay.baseline, "extended": overlay.extended}
    return Picture(
        title=f"{overlay.run}{', held out' if overlay.held_out else ''}",
        svg=Markup(figures.overlay_svg(overlay, name)),
        alt=f"Paths of run {overlay.run} from above: measured and simulated. {told}",
        caption=told,
        file=f"{name}.csv",
        data=_csv(("path", "piece", "x [m]", "y [m]", "run", "t [s]"), _places(overlay, paths)),
    )


def misfit_picture(misfit: Misfit, name: str) -> Picture:
    """Return measured minus simulated; name as in overlay_picture."""
    shown = figures.shown_points(misfit)
    caption = ["Misfit: measured minus simulated. Before: without this effect, but with the others found."]
    if misfit.after is not None:
        caption.append("After: with it; the means should be zero. Bars: 90 % intervals.")
    count = len(misfit.residual)
    if shown.index.sum() < count:
        caption.append(f"{shown.index.sum()} of {count} samples are drawn.")
    return Picture(
        title=f"{misfit.explained_by}: {misfit.channel} over {misfit.covariate_name}",
        svg=Markup(figures.misfit_svg(misfit, shown, name)),
        alt=f"Error of the model in {misfit.channel}, over {misfit.covariate_name}, with binned means.",
        caption=" ".join(caption),
        file=f"{name}.csv",
        data=_csv(
            ("kind", f"covariate [{misfit.covariate_unit}]", f"misfit [{misfit.unit}]", *_MOMENT),
            _misfit_rows(misfit, shown),
        ),
    )


def comparison_picture(comparison: Comparison, name: str) -> Picture:
    """Return numbers of the measured and of simulated data; name as in overlay_picture."""
    shown = min(len(comparison.names), figures.MOST_NUMBERS)
    columns = [comparison.measured, comparison.baseline, comparison.extended, comparison.sd]
    rows = [(said, *values) for said, *values in zip(comparison.names, *(c.tolist() for c in columns), strict=True)]
    return Picture(
        title=f"{comparison.explained_by}: how the readings scatter",
        svg=Markup(figures.comparison_svg(comparison, name)),
        alt="Difference of simulated and measured scatter, with the original model and the extended one.",
        caption=(
            "Each number describes the scatter of the readings, measured and simulated; sd: its "
            "standard deviation between simulations. In the grey band, chance explains the difference. "
            f"The {shown} with the largest differences are shown."
        ),
        file=f"{name}.csv",
        data=_csv(("number", "measured", "original model", "extended model", "standard deviation"), rows),
    )


def _kept(step: int, path: FloatArray) -> BoolArray:
    """Return which rows of a path are kept: every so manyth, first and last of each piece among them."""
    gap = np.isnan(path[:, 0])
    beside = gap | np.roll(gap, 1) | np.roll(gap, -1)
    index = np.arange(len(path))
    return np.asarray(beside | (index % step == 0) | (index == len(path) - 1))


def _places(overlay: Overlay, paths: dict[str, FloatArray | None]) -> Iterable[tuple[str | float, ...]]:
    for which, path in paths.items():
        piece = 1
        timed = which == "measured" and overlay.times is not None
        times = overlay.times.tolist() if timed and overlay.times is not None else repeat(None)
        for (x, y), t in zip([] if path is None else path.tolist(), times, strict=False):
            if x != x:  # nan parts the pieces
                piece += 1
            else:
                yield which, f"{piece}", x, y, *(("", "") if t is None else (overlay.run, _seconds(t)))


def _misfit_rows(misfit: Misfit, shown: figures.Shown) -> Iterable[tuple[str | float, ...]]:
    """Yield the samples that are drawn and those that are furthest off, with their moments."""
    size = np.where(np.isfinite(misfit.residual), np.abs(misfit.residual), -1.0)
    index = np.union1d(np.flatnonzero(shown.index), np.argsort(-size, kind="stable")[:LARGEST])
    moments: Iterable[tuple[str | float, ...]] = repeat(_NO_MOMENT)
    if (at := misfit.moments) is not None:
        rows = zip(at.run[index].tolist(), at.t[index].tolist(), at.places[index].tolist(), strict=True)
        moments = ((at.runs[run], _seconds(t), x, y) for run, t, (x, y) in rows)
    samples = zip(misfit.covariate[index].tolist(), misfit.residual[index].tolist(), strict=True)
    for (x, y), moment in zip(samples, moments, strict=False):
        yield "sample", x, y, *moment
    for which, bins in (("mean before", misfit.bins), ("mean after", misfit.after)):
        yield from () if bins is None else _bins_rows(which, bins)
    for x, y in [] if misfit.curve is None else misfit.curve.tolist():
        yield "extension adds", x, y, *_NO_MOMENT
    for x, low, high in [] if misfit.band is None else misfit.band.tolist():
        yield "extension, lower end", x, low, *_NO_MOMENT
        yield "extension, upper end", x, high, *_NO_MOMENT


def _seconds(t: float) -> str:
    """Return a time that finds its row again: five digits would not do for a date."""
    return f"{t:.3f}"


def _bins_rows(which: str, bins: Bins) -> Iterable[tuple[str | float, ...]]:
    for end, values in (("", bins.mean), (", lower end", bins.lo90), (", upper end", bins.hi90)):
        for x, y in zip(bins.centre.tolist(), values.tolist(), strict=True):
            yield f"{which}{end}", x, y, *_NO_MOMENT


def _csv(columns: Sequence[str], rows: Iterable[tuple[str | float, ...]]) -> str:
    """Return a table as a data: link, numbers to five digits."""
    text = csv_text(columns, ([cell if isinstance(cell, str) else f"{cell:.5g}" for cell in row] for row in rows))
    return "data:text/csv;charset=utf-8;base64," + base64.b64encode(text.encode()).decode()
