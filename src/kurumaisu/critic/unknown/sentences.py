# SPDX-License-Identifier: BSD-3-Clause
"""What is outside the catalogue, in words."""

from __future__ import annotations

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.unknown.curves import Curve
from kurumaisu.critic.unknown.joint_fit import FitWithCurve
from kurumaisu.critic.unknown.shapes import DrawnCurve, Shape, grid, shape_of

# How a reader calls them, and their units.
CHANNEL_NAMES = {
    "v": "forward speed",
    "lateral": "sideways speed",
    "w": "yaw rate",
    "v_gain": "forward speed",
    "w_gain": "yaw rate",
    "curvature": "curvature of the path",
    "speed": "absolute forward speed",
    "reference_x": "reference's x",
    "reference_y": "reference's y",
    "reference_heading": "reference's heading",
}
_SHARES = {"v_gain": "of the forward speed", "w_gain": "of the yaw rate"}  # in place of a unit
COVARIATES = {
    "v": ("v", "forward speed", "m/s"),
    "abs_v": ("|v|", "speed", "m/s"),
    "w": ("w", "yaw rate", "rad/s"),
    "abs_w": ("|w|", "absolute yaw rate", "rad/s"),
    "v_times_w": ("vw", "product of speed and yaw rate", "m/s^2"),
    "acceleration": ("acceleration", "acceleration", "m/s^2"),
    "yaw_acceleration": ("yaw_acceleration", "yaw acceleration", "rad/s^2"),
    "wheel_left": ("wheel_left", "speed of the left wheel", "m/s"),
    "wheel_right": ("wheel_right", "speed of the right wheel", "m/s"),
    "time": ("time", "time since the start", "s"),
    effects.RECORDING_TIME: (effects.RECORDING_TIME, "time since the first run began", "s"),
    "since_command": ("time_since_command", "time since the command changed", "s"),
    "since_rest": ("time_since_rest", "time since the chair last rested", "s"),
    "since_reversal": ("distance_since_reversal", "distance since the last reversal", "m"),
    "heading": ("heading", "heading", "rad"),
    "distance": ("distance", "distance travelled", "m"),
    "x": ("x", "x in the map", "m"),
    "y": ("y", "y in the map", "m"),
    effects.MOVING: ("constant", "time since the start", "s"),
    "v_f": ("v_f mod step", "translation voltage within one D/A step", "V"),
    "v_s": ("v_s mod step", "steering voltage within one D/A step", "V"),
}


def covariate(curve: Curve) -> tuple[str, str, str]:
    """Return a covariate's name in the verdict, as a reader calls it, and its unit; another column is its own name."""
    name = curve.basis.covariate
    return COVARIATES.get(name, (name, name, ""))


def channel(curve: Curve) -> str:
    """Return the channel as the verdict has it."""
    of_reference = curve.channel in effects.REFERENCE_CHANNELS
    return curve.channel.replace("_", ".") if of_reference else f"base.{effects.CHANNELS[curve.channel].rate}"


def followed(curve: Curve) -> str:
    """Return what a curve follows: over a covariate, or nothing."""
    return "constant" if curve.basis.covariate == effects.MOVING else f"over {covariate(curve)[0]}"


def unit_of(channel: str) -> str:
    """Return the unit of a channel's curves; in words where it is a share."""
    if channel in effects.REFERENCE_CHANNELS:
        return effects.REFERENCE_CHANNELS[channel][1]
    return _SHARES.get(channel, effects.CHANNELS[channel].unit)


def shape(extension: FitWithCurve, *, intervals: bool = True) -> str:
    """Return the curve's shape with place and size, each with its unit and, if asked for, its 90 % interval."""
    unit, rate = covariate(extension.curve)[2], unit_of(extension.curve.channel)
    return shape_over(extension.drawn, unit, rate, intervals=intervals)


def shape_over(curve: DrawnCurve, unit: str, of: str, *, intervals: bool = True) -> str:
    """Return the same of any curve; units: of its covariate, and of itself."""
    found = shape_of(curve)
    size = _quantity(found, "size", of, intervals)
    if found.kind == "periodic":
        times = round(curve.basis.constants["period"] / found.place[0])
        turn = np.isclose(curve.basis.constants["period"], 2 * np.pi) and unit == "rad"
        period = f"2 pi{f'/{times}' if times > 1 else ''}" if turn else f"{found.place[0]:.3g} {unit}"
        return f"periodic, period {period}, amplitude {size}"
    at = grid(curve)
    span = f"from {at[0]:.3g} to {at[-1]:.3g} {unit}".rstrip()
    if found.kind == "line":
        return f"monotone, {'rises' if found.size[0] > 0 else 'falls'} by {size} {span}"
    if found.kind == "irregular":
        return f"irregular, within {size} {span}"
    place = _quantity(found, "place", unit, intervals)
    if found.kind == "constant":
        return f"constant, {size} while the chair moves"
    if found.kind == "jump":
        return f"it jumps at {place} by {size}"
    what = {"step": f"of {size}", "bump": f"of {size}", "threshold": f"; beyond it a change of up to {size}"}
    return f"{found.kind} at {place} {what[found.kind]}".replace(" ;", ";")


def headline(extension: FitWithCurve) -> str:
    """Return the finding in one sentence."""
    name = "no known quantity" if followed(extension.curve) == "constant" else f"the {covariate(extension.curve)[1]}"
    return (
        f"No effect in the catalogue explains the error of the {CHANNEL_NAMES[extension.curve.channel]}. "
        f"It follows {name}: {shape(extension, intervals=False)}."
    )


def _quantity(found: Shape, which: str, unit: str, interval: bool) -> str:
    estimate, low, high = np.abs(found.size) if which == "size" and found.kind == "line" else getattr(found, which)
    if not interval:
        return f"{estimate:.3g} {unit}".rstrip()
    low, high = min(low, high), max(low, high)
    return f"{estimate:.3g} {unit} (90 %: {low:.3g} to {high:.3g})".replace("  ", " ")
