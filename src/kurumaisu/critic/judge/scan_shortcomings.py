# SPDX-License-Identifier: BSD-3-Clause
"""What scans lack to tell effects apart, and which drive supplies it."""

from __future__ import annotations

import numpy as np

from kurumaisu.critic.ranges.search.normal_equations import Assembly
from kurumaisu.types import FloatArray

_FLAT = 0.02  # [m] what the ends of beams on one wall scatter by across it
_MOVED = 0.05  # [m] between the places of a laser, at least
_DISTANCES = 1.2  # ratio of the farthest to the nearest reading, at least


def shortcomings(assembly: Assembly) -> list[str]:
    """Return sentences about what the scans did not see, with the scripted drive that shows it."""
    seen, trust = assembly.marks.seen, assembly.geometry
    if not trust.any():
        return ["laser: no beam hits a mapped wall away from its ends; record room_poses in a mapped room."]
    bearings = np.array([each.bearings for each in seen.beams])
    angle = seen.origins[..., 2] + bearings
    reach = np.where(trust, seen.level, 0.0)[..., np.newaxis]
    ends = seen.origins[..., :2] + reach * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    out = []
    if _across(ends[trust]) < _FLAT:
        out.append(
            "laser: only one wall was seen, so that range offset, mounting and position of the wall cannot be told "
            "apart; record room_poses, which sees more walls."
        )
    if np.ptp(seen.origins[..., :2].reshape(-1, 2), axis=0).max() < _MOVED:
        out.append("laser: all scans are from one place; record room_poses or wall_five_distances.")
    ranges = seen.ranges[trust]
    if float(np.quantile(ranges, 0.98)) < _DISTANCES * float(np.quantile(ranges, 0.02)):
        out.append("laser: all walls are equally far, so effects of the range do not show; drive wall_five_distances.")
    return out


def _across(points: FloatArray) -> float:
    """Return the rms distance [m] of points (n, 2) from the line through them."""
    centred = points - points.mean(axis=0)
    return float(np.sqrt(max(np.linalg.eigvalsh(centred.T @ centred / len(points))[0], 0.0)))
