# SPDX-License-Identifier: BSD-3-Clause
"""Colours by name: X11's, which Stage reads from rgb.txt. Where CSS has the same colour, Pillow knows it."""

from __future__ import annotations

import colorsys
import re
from collections.abc import Iterable

from kurumaisu.world.values import Values

Color = tuple[float, float, float, float]  # red, green, blue, alpha in [0, 1]

_RED: Color = (1.0, 0.0, 0.0, 1.0)
_DEFAULTS: dict[str, Color] = {  # of types whose bodies are not red if the file does not say so
    "ranger": (0.0, 0.0, 0.5, 1.0),
    "camera": (0.0, 0.0, 0.0, 1.0),
    "gripper": (0.3, 0.3, 0.3, 1.0),
    "blinkenlight": (0.0, 1.0, 0.0, 1.0),
}
_GOLDEN = 0.6180339887498949  # turns of hue between random colours, which keeps neighbours apart

# Names that CSS lacks or has another colour for, and the brightest of four shades (red1 to red4) where it is not
# the colour without a number.
_X11 = """
gray bebebe green 00ff00 grey bebebe lightgoldenrod eedd82 lightslateblue 8470ff maroon b03060 navyblue 000080
purple a020f0 violetred d02090 antiquewhite1 ffefdb brown1 ff4040 burlywood1 ffd39b cadetblue1 98f5ff
chocolate1 ff7f24 coral1 ff7256 darkgoldenrod1 ffb90f darkolivegreen1 caff70 darkorange1 ff7f00 darkorchid1 bf3eff
darkseagreen1 c1ffc1 darkslategray1 97ffff firebrick1 ff3030 goldenrod1 ffc125 hotpink1 ff6eb4 hotpink2 ee6aa7
hotpink3 cd6090 indianred1 ff6a6a khaki1 fff68f lightblue1 bfefff lightgoldenrod1 ffec8b lightpink1 ffaeb9
lightskyblue1 b0e2ff lightsteelblue1 cae1ff maroon1 ff34b3 mediumorchid1 e066ff mediumpurple1 ab82ff
olivedrab1 c0ff3e orchid1 ff83fa palegreen1 9aff9a paleturquoise1 bbffff palevioletred1 ff82ab pink1 ffb5c5
plum1 ffbbff purple1 9b30ff rosybrown1 ffc1c1 royalblue1 4876ff salmon1 ff8c69 seagreen1 54ff9f sienna1 ff8247
skyblue1 87ceff slateblue1 836fff slategray1 c6e2ff steelblue1 63b8ff tan1 ffa54f thistle1 ffe1ff turquoise1 00f5ff
violetred1 ff3e96 wheat1 ffe7ba
"""
_NAMES = dict(zip(_X11.split()[::2], _X11.split()[1::2], strict=True))
_SHADES = {"1": 1.0, "2": 0.932, "3": 0.804, "4": 0.548}  # of the brightest


def named(name: str) -> tuple[float, float, float] | None:
    """Return a colour by its X11 name, blanks and case being ignored; None: there is no such colour."""
    name = name.replace(" ", "").lower()
    level = re.fullmatch(r"gr[ae]y(\d{1,3})", name)
    if level:
        shade = int(int(level[1]) * 2.55 + 0.5) / 255  # as in rgb.txt, where 50 is 127 and 90 is 229
        return (shade, shade, shade) if shade <= 1 else None
    if name in _NAMES:
        return _scaled(bytes.fromhex(_NAMES[name]), 1.0)
    from PIL import ImageColor  # worlds of grey walls need not pay for it

    if name in ImageColor.colormap:
        return _scaled(ImageColor.getrgb(name)[:3], 1.0)
    brightest = named(name[:-1] + "1" * (name[-1] != "1")) if name[-1:] in _SHADES else None
    return _scaled([255 * part for part in brightest], _SHADES[name[-1]]) if brightest else None


def _scaled(parts: Iterable[float], share: float) -> tuple[float, float, float]:
    red, green, blue = (round(part * share) / 255 for part in parts)
    return (red, green, blue)


def color(values: Values, order: int) -> Color:
    """Return a model's colour; order: of the model in the file, from which a random colour is taken."""
    if not values.has("color"):
        default = _DEFAULTS.get(values.entity.type, _RED)
        red, green, blue, alpha = (min(max(v, 0.0), 1.0) for v in values.several("color_rgba", "ffff", default))
        return (red, green, blue, alpha)
    name = values.text("color", "")
    if name == "random":
        return (*colorsys.hsv_to_rgb(order * _GOLDEN % 1, 0.7, 0.9), 1.0)
    found = named(name)
    if found is None:
        values.notes.add(values.entity.properties["color"].name, f"unknown color {name!r}: red is used, as in Stage")
    return (*found, 1.0) if found else _RED
