# SPDX-License-Identifier: BSD-3-Clause
"""The report: one self-contained HTML page that tells the verdict to a tired engineer."""

from __future__ import annotations

import base64
import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import jinja2
from markupsafe import Markup

from kurumaisu.critic import figures
from kurumaisu.critic.story import Misfit, Overlay, Story
from kurumaisu.critic.verdict import Verdict
from kurumaisu.errors import Error
from kurumaisu.types import FloatArray

MINUS = "\N{MINUS SIGN}"
LABELS = {
    "named": "Cause named",
    "none": "Nothing found",
    "confounded": "Cannot tell which",
    "unknown": "Outside the catalogue",
    "invalid_data": "Data are wrong",
}
# Pictures of runs shown at once; the others can be unfolded.
OVERLAYS_SHOWN = 4
# Units that are read in thousandths when a row's largest number is below a tenth.
_MILLI = {"m": "mm", "s": "ms", "rad": "mrad", "V": "mV", "m/s": "mm/s", "rad/s": "mrad/s"}


@dataclass(frozen=True)
class Picture:
    """A figure of the page: SVG, what it shows for those who cannot see it, caption, and its data as CSV."""

    title: str
    svg: Markup
    alt: str
    caption: str
    file: str
    data: str


def write_report(path: Path, verdict: Verdict, story: Story) -> None:
    """Write report.html with its pictures, tables and data in the one file. Raise Error if it cannot be written."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["quantities"] = quantities
    environment.filters["bare"] = lambda quantity: quantity.split("\N{NO-BREAK SPACE}")[0]
    environment.filters["signed"] = lambda value, form: f"{value:{form}}".replace("-", MINUS)
    # Runs that no model fitted are what the gain was measured on, so they come first.
    runs = sorted(story.overlays, key=lambda overlay: not overlay.held_out)
    overlays = [_overlay(overlay, f"run{i}") for i, overlay in enumerate(runs)]
    gain = verdict.gain.log_density_per_sample.gain if verdict.gain else 0.0
    page = environment.get_template("report.html").render(
        verdict=verdict,
        story=story,
        label=LABELS[verdict.verdict],
        factor=math.exp(min(gain, 50.0)),
        overlays=overlays[:OVERLAYS_SHOWN],
        more_overlays=overlays[OVERLAYS_SHOWN:],
        misfits=[_misfit(misfit, f"misfit{i}") for i, misfit in enumerate(story.misfits)],
    )
    try:
        path.write_text(page, encoding="utf-8")
    except OSError as error:
        raise Error(f"{path}: {error.strerror}") from error


def quantities(values: Sequence[float], unit: str) -> list[str]:
    """Return numbers of one row to three digits, with one unit that suits the largest; nan becomes a dash."""
    finite = [abs(value) for value in values if math.isfinite(value)]
    largest = max(finite, default=0.0)
    factor = 1000.0 if unit in _MILLI and 0 < largest < 0.1 else 1.0
    shown = _MILLI[unit] if factor != 1.0 else unit
    # One digit more than three of the largest would claim precision, one fewer would hide a difference.
    decimals = 2 - math.floor(math.log10(largest * factor)) if largest > 0 else 0
    suffix = f"\N{NO-BREAK SPACE}{shown}" if shown else ""
    return [_number(value * factor, max(0, decimals)) + suffix for value in values]


def _number(value: float, decimals: int) -> str:
    if not math.isfinite(value):
        return "–"
    text = f"{value:.{decimals}f}" if decimals <= 6 else f"{value:.3g}"
    return text.replace("-", MINUS)


def _overlay(overlay: Overlay, name: str) -> Picture:
    ends = {
        name: figures.distance_at_end(overlay.measured, simulated)
        for name, simulated in (("with the model as it was", overlay.baseline), ("extended", overlay.extended))
        if simulated is not None and len(simulated) and len(overlay.measured)
    }
    told = ", ".join(f"{text} {name}" for name, text in zip(ends, quantities(list(ends.values()), "m"), strict=True))
    paths = {"measured": overlay.measured, "baseline": overlay.baseline, "extended": overlay.extended}
    rows = [(which, x, y) for which, path in paths.items() if path is not None for x, y in path]
    return Picture(
        title=f"{overlay.run}{', held out' if overlay.held_out else ''}",
        svg=Markup(figures.overlay_svg(overlay, name)),
        alt=f"Paths of run {overlay.run} from above: measured and simulated. Distance of the ends: {told}.",
        caption=f"Distance from the measured end: {told}.",
        file=f"{name}.csv",
        data=_csv(("path", "x [m]", "y [m]"), rows),
    )


def _misfit(misfit: Misfit, name: str) -> Picture:
    shown = figures.shown_points(misfit)
    caption = ["Misfit: measured minus simulated.", "If the model were right, the means would lie on zero."]
    if misfit.curve is not None:
        caption.append("Where the means lie on the line, the extension explains them.")
    if shown.index.sum() < len(shown.index):
        caption.append(f"{shown.index.sum()} of {len(shown.index)} samples are drawn.")
    rows: list[tuple[str, float, float]] = [("sample", x, y) for x, y in _rows(misfit.covariate, misfit.residual)]
    rows += [("mean", x, y) for x, y in _rows(misfit.bins.centre, misfit.bins.mean)]
    rows += [("mean, lower end", x, y) for x, y in _rows(misfit.bins.centre, misfit.bins.lo90)]
    rows += [("mean, upper end", x, y) for x, y in _rows(misfit.bins.centre, misfit.bins.hi90)]
    rows += [] if misfit.curve is None else [("extension", x, y) for x, y in misfit.curve]
    for i, end in enumerate(("lower", "upper"), 1):
        rows += [] if misfit.band is None else [(f"extension, {end} end", row[0], row[i]) for row in misfit.band]
    return Picture(
        title=f"{misfit.explained_by}: {misfit.channel} over {misfit.covariate_name}",
        svg=Markup(figures.misfit_svg(misfit, shown, name)),
        alt=f"What the model gets wrong in {misfit.channel}, over {misfit.covariate_name}, with binned means.",
        caption=" ".join(caption),
        file=f"{name}.csv",
        data=_csv(("kind", f"covariate [{misfit.covariate_unit}]", f"misfit [{misfit.unit}]"), rows),
    )


def _rows(x: FloatArray, y: FloatArray) -> list[tuple[float, float]]:
    return list(zip(x.tolist(), y.tolist(), strict=True))


def _csv(columns: Sequence[str], rows: Sequence[tuple[str, float, float]]) -> str:
    """Return a table as a data: link, numbers to six digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows((kind, f"{x:.6g}", f"{y:.6g}") for kind, x, y in rows)
    return "data:text/csv;base64," + base64.b64encode(text.getvalue().encode()).decode()
