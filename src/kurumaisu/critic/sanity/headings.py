# SPDX-License-Identifier: BSD-3-Clause
"""What is wrong with poses can mostly be told from the poses alone: a wheeled robot goes where it looks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.critic.values.recording import Series
from kurumaisu.critic.values.robust import third_difference_sd
from kurumaisu.types import FloatArray

_APART = 0.5  # [s] between the poses whose course is compared with their heading
_LEVER = 0.15  # [m] a marker may be off the axle by about this: slower turns in place say nothing about the course
_AGREES = 0.85  # resultant length from which course and heading agree [1]
WIN = 15.0  # nats by which another reading of the heading must win
_OFF = np.radians(15.0)  # a heading that is off by less than this may be a real misalignment
_TURNS = {
    1.0: "",
    -1.0: "reflected",
    np.pi / 180: "in degrees",
    -np.pi / 180: "in degrees, and reflected",
    1e-3: "in milliradians",
    2 * np.pi: "in turns",
}


@dataclass(frozen=True)
class Course:
    """How heading and direction of travel go together: course = factor * heading + offset (modulo half a turn).

    agreement: resultant length, 1 for perfect; ahead: share of the way driven along the mended heading; plain:
    agreement of the heading as it is.
    """

    factor: float
    offset: float
    agreement: float
    ahead: float
    plain: float

    @property
    def right(self) -> bool:
        """Tell whether the heading is as it should be."""
        return self.factor == 1.0 and abs(self.offset) < _OFF


def course(pose: Series) -> Course | None:
    """Return what the heading says of the direction of travel, None where too little was driven."""
    windows = _windows(pose)
    if windows is None:
        return None
    along, middle, weight = windows
    resultants = {k: np.sum(weight * np.exp(2j * (along - k * middle))) / weight.sum() for k in _TURNS}
    number = _independent(weight)
    best = max(resultants, key=lambda k: abs(resultants[k]))
    if not _clearly(abs(resultants[best]), abs(resultants[1.0]), number):
        best = 1.0
    offset = float(np.angle(resultants[best])) / 2
    ahead = float(np.sum(weight * (np.cos(along - best * middle - offset) > 0)) / weight.sum())
    return Course(best, offset, float(abs(resultants[best])), ahead, float(abs(resultants[1.0])))


def folded(pose: Series) -> str | None:
    """Tell of a heading that agrees with the course now as it is, now with the other sign."""
    windows = _windows(pose)
    if windows is None:
        return None
    along, middle, weight = windows
    cosines = [np.cos(2 * (along - sign * middle)) for sign in (1, -1)]
    each = [float(weight @ cosine / weight.sum()) for cosine in cosines]
    either = float(weight @ np.maximum(*cosines) / weight.sum())
    shares = [float(weight @ (cosines[i] > cosines[1 - i]) / weight.sum()) for i in range(2)]
    if (
        max(each) > _AGREES
        or min(shares) < 0.1
        or not _clearly(either, 0.5 * (1 + max(each)), _independent(weight) / 2)
    ):
        return None
    return (
        f"heading of the reference pose looks folded, its sign lost: it agrees with the course to "
        f"{either:.2f} if its sign may change from place to place, else to {max(each):.2f}; record atan2, not acos"
    )


def _windows(pose: Series) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Return course and heading [rad] and weight of stretches that were driven, None where they are too few."""
    keep = np.unique(np.searchsorted(pose.t, np.arange(pose.t[0], pose.t[-1], _APART)))
    t, xy, theta = pose.t[keep], pose.values[keep, :2], pose.values[keep, 2]
    step, turn = np.diff(xy, axis=0), np.diff(theta)
    way = np.hypot(*step.T)
    noise = position_noise(pose)
    clear = (way > 6 * noise) & (np.diff(t) < 4 * _APART)
    clear &= (way > _LEVER * np.minimum(np.abs(turn), 2.0)) | (np.abs(turn) > 10)
    if clear.sum() < 10:
        return None
    weight = np.minimum(way[clear], np.quantile(way[clear], 0.9))
    return np.arctan2(step[clear, 1], step[clear, 0]), (theta[:-1] + turn / 2)[clear], weight


def _clearly(agreement: float, plain: float, number: float) -> bool:
    gain = number * np.log((1.02 - plain) / (1.02 - agreement))
    return agreement > _AGREES and plain < _AGREES and gain > WIN


def _independent(weight: FloatArray) -> float:
    return float(weight.sum() ** 2 / (weight**2).sum())


def position_noise(pose: Series) -> float:
    """Return a robust sd of the positions' fast noise [m], from third differences."""
    return float(third_difference_sd(pose.values[:, :2], None)) if len(pose.values) > 3 else 0.0


def heading_words(found: Course, turns_agree: bool | None, goes_ahead: bool | None) -> str | None:
    """Return what is wrong with the heading, None when nothing is.

    turns_agree: whether heading and input turn the same way, goes_ahead: whether the robot goes forward along the
    mended heading when it is asked to; None where nobody knows.
    """
    if found.agreement < _AGREES or found.right:
        return None
    share = f"agreement of course and heading: {found.agreement:.2f} then, {found.plain:.2f} as given (1: perfect)"
    if found.factor in (1.0, -1.0):
        mirrored = found.factor < 0
        return f"{_reflected(found, turns_agree, goes_ahead) if mirrored else _turned(found)}: {share}"
    factor = abs(found.factor)
    sign = " and counts clockwise" if found.factor < 0 else ""
    name = _TURNS[factor]
    return f"heading of the reference pose is {name}{sign}: factor {1 / factor:.3g}; try theta * {factor:.4g}; {share}"


def _turned(found: Course) -> str:
    off = f"off the direction of travel by {np.degrees(found.offset):.0f} deg"
    return f"heading of the reference pose is {off}: try theta + {found.offset:.3g}"


def _reflected(found: Course, turns_agree: bool | None, goes_ahead: bool | None) -> str:
    quarter = abs(abs(found.offset) - np.pi / 2) < np.pi / 4
    forward = goes_ahead if goes_ahead is not None else found.ahead > 0.5
    if turns_agree is False:
        name = "from the y axis, as of a compass: try pi/2 - theta" if quarter else ": try -theta"
        return f"heading of the reference pose counts clockwise{' ' * quarter}{name}"
    if quarter:
        name = "x and y of the reference pose are swapped: try (y, x)"
    else:
        name = (
            "y of the reference pose has the wrong sign: try -y"
            if forward
            else "x of the reference pose has the wrong sign: try -x"
        )
    return name if turns_agree else f"{name} (or heading counts clockwise)"
