# SPDX-License-Identifier: BSD-3-Clause
"""The table and the picture of docs/experiments.md, from the experiments' own files."""

from __future__ import annotations

import argparse
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kurumaisu.bench.table import MarkdownTable
from kurumaisu.experiments import Script, names, nominal_path, shipped_script
from kurumaisu.whole_files import write_whole

_COLUMNS = 4


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; draw the paths into a file if one is given."""
    parser = argparse.ArgumentParser(prog="scripts/bench experiments_doc", description=__doc__)
    parser.add_argument("--picture", type=Path, help="SVG to write")
    options = parser.parse_args(arguments)
    scripts = [shipped_script(name) for name in names()]
    table = MarkdownTable("", "name", "what it does", "s", "good for")
    for script in scripts:
        b = script.box
        box = f"box {b.ahead:g} x {b.behind:g} x {b.left:g} x {b.right:g}"
        table.row(f"`{script.name}`", f"{_what(script)}; {box}", f"{script.seconds:.0f}", script.good_for)
    if options.picture is not None:
        _draw(scripts, options.picture)
    return 0


def _what(script: Script) -> str:
    if script.kind == "places":
        return f"stands at {len(script.places)} place{'s' * (len(script.places) > 1)}"
    if script.kind == "sweep":
        volts = [phase.target[0] for phase in script.phases]
        return f"V_s between {min(volts):g} and {max(volts):g} V, standing"
    v, w = np.array([phase.target for phase in script.phases]).T
    return f"v {v.min():g} to {v.max():g} m/s, w {w.min():g} to {w.max():g} rad/s"


def _draw(scripts: Sequence[Script], path: Path) -> None:
    import matplotlib as mpl  # half a second to load

    mpl.use("svg")
    from matplotlib import pyplot

    mpl.rcParams.update({"svg.hashsalt": "experiments", "font.size": 8})
    rows = -(-len(scripts) // _COLUMNS)
    figure, axes = pyplot.subplots(
        rows, _COLUMNS, figsize=(10, 1.7 * rows + 0.5), layout="constrained", sharex=True, sharey=True
    )
    for axis in axes.flat[len(scripts) :]:
        axis.set_axis_off()
    for axis, script in zip(axes.flat, scripts, strict=False):
        b = script.box
        corners = np.array([(b.ahead, b.left), (-b.behind, b.left), (-b.behind, -b.right), (b.ahead, -b.right)])
        axis.fill(*corners.T, facecolor="0.93", edgecolor="0.6")
        if script.kind == "drive":
            axis.plot(*nominal_path(script.phases)[:, :2].T, color="tab:blue")
        elif script.kind == "places":
            axis.plot(*np.array([place.pose[:2] for place in script.places]).T, "x", color="tab:blue")
        axis.plot(0, 0, "o", color="tab:red", markersize=3)
        axis.set_title(f"{script.name}, {script.seconds:.0f} s")
        axis.set_aspect("equal")
    figure.supxlabel("x [m] ahead of the start (red), all on one scale; grey: the box; crosses: places to stand at")
    figure.supylabel("y [m] to the left")
    drawn = io.StringIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None})
    write_whole({path: drawn.getvalue()})
