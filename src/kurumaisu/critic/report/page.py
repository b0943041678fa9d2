# SPDX-License-Identifier: BSD-3-Clause
"""The report: one self-contained HTML page that tells the verdict to a tired engineer."""

from __future__ import annotations

import math
from pathlib import Path

import jinja2

from kurumaisu import effects
from kurumaisu.critic.report.pictures import comparison_picture, misfit_picture, overlay_picture, thinned
from kurumaisu.critic.values.digits import MINUS, bare, odds, quantities
from kurumaisu.critic.values.story import Story
from kurumaisu.critic.values.verdict import Verdict, grouped

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
