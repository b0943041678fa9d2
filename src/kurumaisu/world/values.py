# SPDX-License-Identifier: BSD-3-Clause
"""The values of an entity's properties as numbers in SI and as strings, read as leniently as Stage does."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from kurumaisu.errors import Error
from kurumaisu.world.notes import Notes
from kurumaisu.world.syntax import Entity, Property
from kurumaisu.world.tokens import Kind, Token

_LARGEST = 2.0**31  # of a number: what C's int holds
_PREFIX = re.compile(r"\s*[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")  # what C's atof takes of a string
_LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
_ANGLES = {"degrees": math.pi / 180, "radians": 1.0}
UNITS = ("unit_length", "unit_angle")  # properties of a world
_WHOLE = re.compile(r"\s*[+-]?\d+")


@dataclass(frozen=True)
class Units:
    """What the file's lengths and angles are to be multiplied with [m], [rad]."""

    length: float = 1.0
    angle: float = math.pi / 180


@dataclass(frozen=True)
class Values:
    """Reads an entity's properties. A missing one is the default; all methods raise Error with the place."""

    entity: Entity
    units: Units
    notes: Notes

    def has(self, name: str) -> bool:
        """Return whether the property is there."""
        return name in self.entity.properties

    def error(self, name: str, message: str) -> Error:
        """Return an Error at a property, or at the entity if it has none of that name."""
        given = self.entity.properties.get(name)
        return (given.name if given else self.entity.name).error(message)

    def number(self, name: str, default: float) -> float:
        """Return a number in the file's own unit."""
        given = self.entity.properties.get(name)
        return default if given is None else self._number(given, self._first(given))

    def length(self, name: str, default: float) -> float:
        """Return a length [m]."""
        return self.number(name, default / self.units.length) * self.units.length

    def angle(self, name: str, default: float) -> float:
        """Return an angle [rad]."""
        return self.number(name, default / self.units.angle) * self.units.angle

    def whole(self, name: str, default: int) -> int:
        """Return a whole number: what stands before the first character that is no digit, as C's atoi takes it."""
        given = self.entity.properties.get(name)
        if given is None:
            return default
        token = self._first(given)
        value, match = self._number(given, token), _WHOLE.match(token.string)
        return int(value) if token.kind is Kind.NUMBER else int(match[0]) if match else 0

    def text(self, name: str, default: str) -> str:
        """Return a string."""
        given = self.entity.properties.get(name)
        return default if given is None else self._first(given).string

    def several(self, name: str, form: str, default: Sequence[float]) -> list[float]:
        """Return a tuple, more values being ignored; form, a letter each: l length, a angle, f as it is."""
        given = self.entity.properties.get(name)
        if given is None:
            return list(default)
        if len(given.values) < len(form):
            raise given.name.error(f"{name} needs {len(form)} numbers, not {len(given.values)}")
        factor = {"l": self.units.length, "a": self.units.angle, "f": 1.0}
        return [self._number(given, token) * factor[letter] for token, letter in zip(given.values, form, strict=False)]

    def _first(self, given: Property) -> Token:
        if not given.values:
            raise given.name.error(f"{given.name.text} needs a value")
        return given.values[0]

    def _number(self, given: Property, token: Token) -> float:
        """Return a token's number. Of '1.2.3' Stage reads 1.2, and 0 of what does not begin with a number."""
        try:
            value = float(token.text)
        except ValueError:
            value = self._lenient(given, token)
        if not abs(value) <= _LARGEST:
            raise token.error(f"{given.name.text} needs a number of at most {_LARGEST:g}, not {token.string}")
        return value

    def _lenient(self, given: Property, token: Token) -> float:
        match = _PREFIX.match(token.string)
        value = float(match[0]) if match else 0.0
        if token.kind is Kind.NUMBER or not match or match[0] != token.string:
            self.notes.add(token, f"{given.name.text}: {token.string!r} is read as {value:g}, as Stage does")
        return value


def units_of(top: Entity, notes: Notes, known: Units) -> Units:
    """Return the units that a world's entity says; known: what holds where it says nothing."""
    said = Values(top, known, notes)
    if said.whole("test", 0):
        raise said.error("test", "this is a test file, which Stage refuses to run")
    chosen = []
    for name, units, otherwise in zip(UNITS, (_LENGTHS, _ANGLES), (known.length, known.angle), strict=True):
        word = said.text(name, "")
        if said.has(name) and word not in units:
            notes.add(top.properties[name].name, f"{name} must be one of {', '.join(units)}, not {word!r}")
        chosen.append(units.get(word, otherwise))
    return Units(*chosen)
