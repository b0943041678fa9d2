# SPDX-License-Identifier: BSD-3-Clause
"""The report's pictures as SVG that takes its colours from the page, so that it reads in light, dark and print."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from kurumaisu.critic.values.digits import MINUS, scaled
from kurumaisu.critic.values.story import Bins, Comparison, Misfit, Overlay
from kurumaisu.critic.values.verdict import NORMAL90
from kurumaisu.types import BoolArray

# Stand-ins that the page's style sheet replaces; the names are its variables.
INK, FAINT, BASELINE, EXTENDED = "#010101", "#020202", "#030303", "#040404"
_VARIABLES = {INK: "currentColor", FAINT: "var(--faint)", BASELINE: "var(--baseline)", EXTENDED: "var(--extended)"}
_PATH = re.compile(r'\bd="[^"]*"')
_LONG = re.compile(r"\d+\.\d\d\d+")
_USES = re.compile(r"(?:<use [^>]*/>\s*){100,}")  # samples, rather than means
_AT = re.compile(r'\bx="([\d.]+)" y="([\d.]+)"')
_LAYERS = 8  # dots of different layers darken each other where they lie close
_STYLE = {
    "svg.fonttype": "none",  # text stays text: small, found by searches, and in any script that the reader's fonts have
    "text.parse_math": False,  # names come from recordings: a dollar is a dollar
    "font.size": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.linewidth": 0.8,
    "grid.color": FAINT,
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
}
# More points than this are a blot in a picture of this size, and megabytes of SVG.
MOST_POINTS = 1500
_LONGEST_LABEL = 46  # characters that fit beside the picture
_LONGEST_ROW = 30  # characters that leave a comparison's picture room
MOST_NUMBERS = 12  # of a comparison in its picture
# Left, bottom, width, height of what the legend leaves, as shares of the picture.
_BELOW_LEGEND = (0.0, 0.0, 1.0, 0.925)
# Share of the points that a picture's height is made for; the rest would squeeze it.
_SHOWN_QUANTILES = (0.005, 0.995)


@dataclass(frozen=True)
class Shown:
    """A misfit's points in the picture: which, and the limits of its ordinate."""

    index: BoolArray
    low: float
    high: float


def overlay_svg(overlay: Overlay, name: str) -> str:
    """Return the run from above; name: prefix of the ids inside, unique in the page."""
    with _drawn(name) as (figure, axes):
        axes.plot(*overlay.measured.T, color=INK, linewidth=2.6, alpha=0.55, label="measured")
        axes.plot(*overlay.baseline.T, color=BASELINE, linewidth=1.5, linestyle=(0, (4, 1.5)), label="original model")
        if overlay.extended is not None:
            axes.plot(*overlay.extended.T, color=EXTENDED, linewidth=1.3, label="extended model")
        if len(overlay.measured):
            axes.plot(*overlay.measured[0], marker="o", markersize=7, color=INK, linestyle="none", label="start")
        axes.set_aspect("equal", adjustable="datalim")
        axes.grid(visible=True)
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        _legend(figure, columns=4)
        return _placed(_svg(figure, name), axes, (1.0, 1.0))


def misfit_svg(misfit: Misfit, shown: Shown, name: str) -> str:
    """Return measured minus simulated over the covariate; name as in overlay_svg."""
    finite = misfit.covariate[np.isfinite(misfit.covariate)]
    x, x_unit = _axis(float(np.abs(finite).max(initial=0.0)), misfit.covariate_unit)
    y, y_unit = _axis(max(abs(shown.low), abs(shown.high)), misfit.unit)
    with _drawn(name) as (figure, axes):
        points = x * misfit.covariate[shown.index], y * misfit.residual[shown.index]
        axes.plot(*points, ".", color=INK, alpha=0.25, markersize=4.5, markeredgewidth=0, label="samples")
        axes.axhline(0.0, color=INK, linewidth=0.8)
        if misfit.band is not None:
            at, low, high = misfit.band.T
            axes.fill_between(x * at, y * low, y * high, color=EXTENDED, alpha=0.25, linewidth=0, label="90 % band")
        if misfit.curve is not None:
            at, curve = misfit.curve.T
            axes.plot(x * at, y * curve, color=EXTENDED, linewidth=2.0, label="effect")
        _means(axes, misfit.bins, (x, y), "o", BASELINE, "before")
        if misfit.after is not None:
            _means(axes, misfit.after, (x, y), "D", EXTENDED, "after")
        axes.set_ylim(y * shown.low, y * shown.high)
        axes.grid(visible=True)
        axes.set_xlabel(_label(misfit.covariate_name, x_unit))
        axes.set_ylabel(_label(f"misfit of {misfit.channel}", y_unit))
        for line in _legend(figure, columns=5).get_lines():
            line.set_alpha(1.0)
        return _placed(_svg(figure, name), axes, (x, y))


def comparison_svg(comparison: Comparison, name: str) -> str:
    """Return by how much simulations with and without the extension miss the measured numbers; name as above."""
    most = np.argsort(-np.abs(comparison.measured - comparison.baseline) / comparison.sd)[:MOST_NUMBERS][::-1]
    rows = np.arange(len(most))
    with _drawn(name) as (figure, axes):
        axes.axvspan(-NORMAL90, NORMAL90, color=FAINT, linewidth=0)
        axes.axvline(0.0, color=INK, linewidth=0.8)
        for simulated, marker, colour, said in (
            (comparison.baseline, "o", BASELINE, "original model"),
            (comparison.extended, "D", EXTENDED, "extended model"),
        ):
            off = ((comparison.measured - simulated) / comparison.sd)[most]
            axes.plot(off, rows, marker, color=colour, markersize=5, label=said)
        axes.set_yticks(rows, [_short(comparison.names[i], _LONGEST_ROW) for i in most], fontsize=9)
        axes.set_xscale("symlog", linthresh=5.0)
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}".replace("-", MINUS))
        axes.margins(x=0.08)
        axes.grid(visible=True, axis="x")
        axes.set_xlabel(f"measured {MINUS} simulated [sd]")
        _legend(figure, columns=2)
        return _svg(figure, name)


@contextmanager
def _drawn(name: str) -> Iterator[tuple[Figure, Any]]:
    """Yield a figure and its axes, in the page's style; name as above."""
    with mpl.rc_context({**_STYLE, "svg.hashsalt": name}):
        figure = Figure(figsize=(5.0, 4.1))
        figure.set_layout_engine("constrained", rect=_BELOW_LEGEND)
        yield figure, figure.subplots()


def _means(axes: Any, bins: Bins, scale: tuple[float, float], marker: str, colour: str, label: str) -> None:
    x, y = scale
    reach = y * np.abs(np.stack([bins.mean - bins.lo90, bins.hi90 - bins.mean]))
    bars: dict[str, Any] = {"fmt": marker, "markersize": 4, "capsize": 2.0, "elinewidth": 1.1, "color": colour}
    axes.errorbar(x * bins.centre, y * bins.mean, yerr=reach, **bars, label=label)


def _axis(largest: float, unit: str) -> tuple[float, str]:
    """Return the factor and the unit of an axis: angles in degrees, small quantities in thousandths."""
    return (float(np.degrees(1.0)), "°") if unit == "rad" else scaled(largest, unit)


def shown_points(misfit: Misfit) -> Shown:
    """Return which points a picture shows: evenly thinned, within limits that also hold means and curve."""
    finite = np.isfinite(misfit.covariate) & np.isfinite(misfit.residual)
    drawn = [misfit.residual[finite]]
    low, high = np.quantile(drawn[0], _SHOWN_QUANTILES) if finite.any() else (0.0, 0.0)
    ends = [low, high, 0.0, *misfit.bins.lo90, *misfit.bins.hi90]
    ends += [] if misfit.after is None else [*misfit.after.lo90, *misfit.after.hi90]
    ends += [] if misfit.curve is None else list(misfit.curve[:, 1])
    ends += [] if misfit.band is None else list(misfit.band[:, 1:].ravel())
    bounds = np.array(ends)[np.isfinite(ends)]
    margin = 0.05 * (np.ptp(bounds) or 1.0)
    low, high = float(bounds.min() - margin), float(bounds.max() + margin)
    inside = np.flatnonzero(finite & (misfit.residual >= low) & (misfit.residual <= high))
    index = np.zeros(len(misfit.residual), dtype=bool)
    index[inside[:: max(1, -(-len(inside) // MOST_POINTS))]] = True
    return Shown(index, low, high)


def _dots(uses: re.Match[str]) -> str:
    """Return many small markers as a few paths of dots, which take a fifth of the room."""
    at = [f"M{float(x):.1f} {float(y):.1f}h0" for x, y in _AT.findall(uses[0])]
    style = "fill: none; stroke: currentColor; stroke-width: 3; stroke-linecap: round; stroke-opacity: 0.3"
    return "".join(f'<path d="{"".join(at[i::_LAYERS])}" style="{style}"/>' for i in range(_LAYERS))


def _legend(figure: Figure, columns: int) -> Any:
    """Put the legend above the picture, where it hides nothing."""
    legend = figure.legend(loc="upper left", ncols=columns, fontsize=9, columnspacing=1.0, handletextpad=0.4)
    legend.set_in_layout(False)
    return legend


def _placed(svg: str, axes: Any, scale: tuple[float, float]) -> str:
    """Return a picture that tells where in it things are; scale: of its axes, as they are drawn over SI units.

    data-at="a b c d": what is x, y in SI units lies at a + b x, c + d y of the picture's own coordinates.
    """
    width, height = (72 * inches for inches in axes.figure.get_size_inches())
    box, (x0, x1), (y0, y1) = axes.get_position(), axes.get_xlim(), axes.get_ylim()
    across, down = width * box.width / (x1 - x0), -height * box.height / (y1 - y0)
    left, top = width * box.x0 - across * x0, height * (1 - box.y0) - down * y0
    at = f"{left:.6g} {across * scale[0]:.6g} {top:.6g} {down * scale[1]:.6g}"
    return svg.replace("<svg ", f'<svg data-at="{at}" ', 1)


def _label(name: str, unit: str) -> str:
    return f"{_short(name)} [{unit}]" if unit else _short(name)


def _short(name: str, most: int = _LONGEST_LABEL) -> str:
    return name if len(name) <= most else f"{name[: most - 1]}…"


def _svg(figure: Figure, name: str) -> str:
    buffer = io.StringIO()
    with warnings.catch_warnings():
        # Only its measure is taken from matplotlib's own font; the reader's shows what that one lacks.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    text = buffer.getvalue().replace("'DejaVu Sans'", "'DejaVu Sans', 'Noto Sans', Arial, sans-serif")
    text = text[text.index("<svg") :]
    text = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r"(href=\"|url\()#", rf"\1#{name}-", text)
    for stand_in, variable in _VARIABLES.items():
        text = text.replace(stand_in, variable)
    # A coordinate to a hundredth of a point: nobody sees more, and it is half of the page.
    text = _PATH.sub(lambda path: _LONG.sub(lambda number: f"{float(number[0]):.2f}", path[0]), text)
    text = _USES.sub(_dots, text)
    # The page sets the size; the picture itself is hidden from screen readers, which get the figure's label.
    return re.sub(r'<svg (.*?)height="[^"]*"(.*?)width="[^"]*"', r'<svg aria-hidden="true" \1\2', text, count=1)
