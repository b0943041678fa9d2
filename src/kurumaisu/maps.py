# SPDX-License-Identifier: BSD-3-Clause
"""Occupancy grids and their files: the pair that map_server reads, and a picture."""

from __future__ import annotations

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kurumaisu.map_file import FREE_BELOW, OCCUPIED_ABOVE, MapFile, map_pair
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class Grid:
    """Occupancy: cells (height, width) from the lower left corner, 0 free to 100 occupied, -1 never seen.

    resolution: edge of a cell [m]; x, y: of the lower left corner [m].
    """

    cells: NDArray[np.int8]
    resolution: float
    x: float
    y: float

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom, top [m]."""
        height, width = self.cells.shape
        return (self.x, self.x + width * self.resolution, self.y, self.y + height * self.resolution)


def grid_pair(grid: Grid, path: Path, suffix: str = ".pgm") -> dict[Path, str | bytes]:
    """Return an image (.pgm or .png) and path.yaml for map_server, in this order, to be written; path has no suffix."""
    written = MapFile(grid.cells, grid.resolution, (grid.x, grid.y, 0.0))
    return map_pair(written, path, suffix, OCCUPIED_ABOVE, FREE_BELOW)


def picture(grid: Grid, trajectory: FloatArray, other: FloatArray | None = None, other_name: str = "") -> bytes:
    """Return a PNG picture of a map and the trajectory (n, 4) of t, x, y, theta.

    other (m, 4), with its name for the legend, is drawn for comparison. Both must be in the map's frame.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    left, right, bottom, top = grid.extent
    wide = (right - left) / max(top - bottom, 1e-9)
    figure = Figure(figsize=(9 * min(wide, 1.6) + 1, 9 / max(wide / 1.6, 1) + 1), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    shades = np.where(grid.cells < 0, 0.8, 1 - grid.cells / 100.0)
    axes.imshow(shades, cmap="gray", vmin=0, vmax=1, origin="lower", extent=grid.extent, interpolation="none")
    if other is not None:
        axes.plot(other[:, 1], other[:, 2], color="tab:orange", linewidth=1, label=other_name)
    axes.plot(trajectory[:, 1], trajectory[:, 2], color="tab:blue", linewidth=1, label="mapped path")
    axes.plot(*trajectory[0, 1:3], "o", color="tab:green", label="start")
    axes.plot(*trajectory[-1, 1:3], "s", color="tab:red", label="end")
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", xlim=(left, right), ylim=(bottom, top))
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, frameon=False)  # above the map, not on it
    drawn = BytesIO()
    figure.savefig(drawn, dpi=130, format="png")
    return drawn.getvalue()
