# SPDX-License-Identifier: BSD-3-Clause
"""A world as a drawing to scale: SVG, in metres."""

from __future__ import annotations

from collections.abc import Iterator
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from kurumaisu.geometry import PLANAR
from kurumaisu.types import FloatArray
from kurumaisu.world.model import Model, Polygon, Position
from kurumaisu.world.world import World

_MARGIN = 0.05  # of the larger side, around the world
_LARGE = 1200  # [px] of the longer side
_NOSE = 0.35  # of a robot's size: the triangle that shows where it looks


def to_svg(world: World) -> str:
    """Return the world as an SVG document: models in their colours, robots with a nose, a scale bar and names."""
    x0, y0, x1, y1 = world.bounds
    margin = _MARGIN * max(x1 - x0, y1 - y0)
    left, bottom, right, top = x0 - margin, y0 - margin, x1 + margin, y1 + margin
    width, height = right - left, top - bottom
    scale = _LARGE / max(width, height)
    line = max(width, height) / 1500
    shapes = "\n".join(part for model in world.models for part in _model(world, model))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width * scale:.0f}" height="{height * scale:.0f}" '
        f'viewBox="{left:.3f} {-top:.3f} {width:.3f} {height:.3f}" font-family="sans-serif">\n'
        f"<title>{escape(world.name)}</title>\n"
        f'<rect x="{left:.3f}" y="{-top:.3f}" width="{width:.3f}" height="{height:.3f}" fill="white"/>\n'
        f'<g transform="scale(1,-1)" stroke="black" stroke-width="{line:.4f}" stroke-linejoin="round">\n'
        f"{shapes}\n</g>\n{_scale_bar(left, bottom, margin)}\n</svg>\n"
    )


def _model(world: World, model: Model) -> Iterator[str]:
    """Yield the elements of one model, in map coordinates, y upwards."""
    x, y, theta = world.poses[model.index][PLANAR]
    place = f'<g transform="translate({x:.4f},{y:.4f}) rotate({np.degrees(theta):.4f})"'
    parts = [_polygon(polygon) for polygon in model.shape.polygons]
    if not parts and len(model.shape.segments):
        parts = [_segments(model.shape.segments)]
    if isinstance(model.device, Position):
        parts.append(_nose(model))
    if not parts:
        return
    name = f"<title>{escape(model.name)}</title>" if model.name else ""
    yield f"{place} id={quoteattr(f'model-{model.index}')}>{name}{''.join(parts)}</g>"


def _polygon(polygon: Polygon) -> str:
    points = " ".join(f"{x:.4f},{y:.4f}" for x, y in polygon.corners)
    red, green, blue, alpha = polygon.color
    fill = f"rgb({round(255 * red)},{round(255 * green)},{round(255 * blue)})"
    return f'<polygon points="{points}" fill="{fill}" fill-opacity="{alpha:.3g}"/>'


def _segments(segments: FloatArray) -> str:
    path = "".join(f"M{ax:.3f} {ay:.3f}L{bx:.3f} {by:.3f}" for ax, ay, bx, by in segments)
    return f'<path d="{path}" fill="none"/>'


def _nose(model: Model) -> str:
    x, y = model.origin[0], model.origin[1]
    length, half = model.size[0] / 2, _NOSE * model.size[1] / 2
    points = f"{x + length:.4f},{y:.4f} {x:.4f},{y + half:.4f} {x:.4f},{y - half:.4f}"
    return f'<polygon points="{points}" fill="white"/>'


def _scale_bar(left: float, bottom: float, margin: float) -> str:
    """Return a bar of 1, 2 or 5 times a power of ten [m], in the lower left corner of the margin."""
    longest = 2 * margin
    power = 10.0 ** np.floor(np.log10(longest))
    length = max(step * power for step in (1, 2, 5) if step * power <= longest)
    x, y, thick = left + margin, -bottom - 0.3 * margin, margin / 15
    return (
        f'<rect x="{x:.3f}" y="{y - thick:.3f}" width="{length:.3f}" height="{thick:.3f}"/>\n'
        f'<text x="{x + length + 2 * thick:.3f}" y="{y:.3f}" font-size="{5 * thick:.3f}">{length:g} m</text>'
    )
