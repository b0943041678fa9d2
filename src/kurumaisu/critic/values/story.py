# SPDX-License-Identifier: BSD-3-Clause
"""What the report shows beyond the verdict: values only, SI units and radians."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.critic.values.verdict import NORMAL90
from kurumaisu.types import FloatArray, IntArray

_BINS = 15  # at most
_FEWEST = 5  # points of which a mean has an interval
FOLLOWED = 0.3  # share of an effect that means over a covariate must explain, to be drawn over it


@dataclass(frozen=True)
class Overlay:
    """One run from above [m]: measured path (n, 2), simulated paths (m, 2); held_out: no model fitted it.

    restart [s]: after so long the simulation begins again at the measured pose (0: never); a row of nan parts pieces;
    off, off_extended [m]: how far the pieces' ends are from the measured place, rms, None where there is none;
    times (n,) [s] of the measured path, by the run's clock, None where nobody needs to find them again.
    """

    run: str
    measured: FloatArray
    baseline: FloatArray
    extended: FloatArray | None
    held_out: bool
    restart: float
    off: float | None = None
    off_extended: float | None = None
    times: FloatArray | None = None


@dataclass(frozen=True)
class Bins:
    """Means of the residual in bins of the covariate, all (k,), each mean with its 90 % interval."""

    centre: FloatArray
    mean: FloatArray
    lo90: FloatArray
    hi90: FloatArray


@dataclass(frozen=True)
class Moments:
    """When and where samples were taken.

    runs: names; run (n,): index into them; t (n,) [s] by the run's clock; places (n, 2) [m] in the map: of the chair,
    or for a reading, of what the beam met, nan where that is nothing.
    """

    runs: tuple[str, ...]
    run: IntArray
    t: FloatArray
    places: FloatArray


@dataclass(frozen=True)
class Misfit:
    """Measured minus simulated, over the covariate that explains it.

    covariate, residual: (n,) points; channel and covariate_name as a reader says them, with their units;
    explained_by: the id or shape that is blamed; curve: (m, 2) covariate and what the extension adds, if any;
    band: (m, 3) covariate and the ends of the curve's 90 % interval, if known; after: means of what is left with the
    extension in; moments: of the points.
    """

    channel: str
    unit: str
    covariate_name: str
    covariate_unit: str
    covariate: FloatArray
    residual: FloatArray
    bins: Bins
    explained_by: str
    curve: FloatArray | None = None
    band: FloatArray | None = None
    after: Bins | None = None
    moments: Moments | None = None


@dataclass(frozen=True)
class Comparison:
    """Numbers that measured and simulated data have in common, for effects that have no mean: all (k,).

    explained_by: the ids blamed; measured, baseline, extended: the numbers; sd: by which they vary from one
    simulation to the next.
    """

    explained_by: str
    names: tuple[str, ...]
    measured: FloatArray
    baseline: FloatArray
    extended: FloatArray
    sd: FloatArray


@dataclass(frozen=True)
class Alternative:
    """An explanation that was weighed and lost: log evidence over the winner [nat], and why it lost."""

    id: str
    nats: float
    why: str


@dataclass(frozen=True)
class NoiseParameter:
    """One estimated parameter of the noise."""

    name: str
    estimate: float
    unit: str


@dataclass(frozen=True)
class Story:
    """All that the report tells and the verdict does not hold.

    headline: the verdict in one sentence; details: what a reader should know next, one sentence each;
    unexplained: what remains, one sentence each; next_drive: what to drive next and why, or empty;
    paste: lines for the configuration of the robot's own software, or empty;
    pose_source: where the reference pose came from; provenance: seeds, versions, files, by name.
    """

    recording: str
    model: str
    headline: str
    details: tuple[str, ...]
    pose_source: str
    provenance: dict[str, str]
    overlays: tuple[Overlay, ...] = ()
    misfits: tuple[Misfit, ...] = ()
    comparisons: tuple[Comparison, ...] = ()
    rivals: tuple[Alternative, ...] = ()
    noise: tuple[NoiseParameter, ...] = ()
    unexplained: tuple[str, ...] = ()
    next_drive: str = ""
    paste: str = ""


def explained(x: FloatArray, y: FloatArray) -> float:
    """Return the share of the sum of squares of y that means in bins of x explain."""
    means = bins(x, y, 1)
    return 1.0 - float(np.mean((y - np.interp(x, means.centre, means.mean)) ** 2) / max(np.mean(y**2), 1e-300))


def bins(x: FloatArray, y: FloatArray, fewest: int = _FEWEST) -> Bins:
    """Return means of y in bins of x of equal width; bins with fewer points are left out."""
    count = int(np.clip(len(x) // (2 * _FEWEST), 3, _BINS))
    low, high = np.quantile(x, [0.005, 0.995])
    index = np.clip(np.floor((x - low) / max(high - low, 1e-12) * count), 0, count - 1)
    rows = []
    for i in np.unique(index):
        inside = index == i
        if inside.sum() >= fewest:
            error = NORMAL90 * y[inside].std() / np.sqrt(inside.sum())
            rows.append((x[inside].mean(), y[inside].mean(), y[inside].mean() - error, y[inside].mean() + error))
    centre, mean, lo, hi = np.array(rows).reshape(-1, 4).T
    return Bins(centre, mean, lo, hi)
