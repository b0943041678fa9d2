# SPDX-License-Identifier: BSD-3-Clause
"""Strict reader of YAML settings: every key is read exactly once, so a misspelt one cannot survive."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from kurumaisu.bounded_files import MOST_TEXT, read_text
from kurumaisu.errors import Error, told

_LARGEST = 2**32 - 1  # of integers that have no bound of their own
_MOST_VALUES = 100_000  # of a document, anchors written out; more is made to fill memories


class Section:
    """A mapping of a settings file whose keys are taken one by one; errors name the file and the key."""

    def __init__(self, values: Any, where: str, path: str = "") -> None:
        self._where = where
        self._path = path
        if not isinstance(values, dict):
            raise self.error("", f"must be a mapping, not {_kind(values)}")
        self._values = dict(values)

    def error(self, key: str, message: str) -> Error:
        """Return an Error that names the file and the key."""
        name = ".".join(part for part in (self._path, key) if part) or "the file"
        return Error(f"{self._where}: {name}: {message}")

    def __contains__(self, key: str) -> bool:
        return key in self._values

    def take(self, key: str) -> Any:
        """Return the value of a required key."""
        if key not in self._values:
            raise self.error(key, "is missing")
        return self._values.pop(key)

    def number(self, key: str, at_least: float = -math.inf, above: float = -math.inf) -> float:
        """Return a required finite number, at_least and above being its bounds."""
        given = self.take(key)
        if isinstance(given, bool) or not isinstance(given, (int, float)):
            raise self.error(key, f"must be a number, not {_kind(given)} (YAML wants 1.0e-3, not 1e-3)")
        value = _float(given)
        if not math.isfinite(value) or value < at_least or value <= above:
            bound = f" above {above:g}" if above > -math.inf else f" of at least {at_least:g}"
            bound = bound if max(above, at_least) > -math.inf else ""
            raise self.error(key, f"must be a finite number{bound}: {told(given)}")
        return value

    def integer(self, key: str, at_least: int, at_most: int = _LARGEST) -> int:
        """Return a required integer."""
        value = self.take(key)
        if isinstance(value, bool) or not isinstance(value, int) or not at_least <= value <= at_most:
            too_large = isinstance(value, int) and value > at_most
            bounds = f"{at_least} to {at_most}" if too_large or at_most < _LARGEST else f"at least {at_least}"
            raise self.error(key, f"must be an integer of {bounds}: {told(value)}")
        return value

    def text(self, key: str, choices: Sequence[str] = ()) -> str:
        """Return a required string, one of the choices if there are any."""
        value = self.take(key)
        if not isinstance(value, str) or not value:
            raise self.error(key, f"must be a string, not {_kind(value)}")
        if choices and value not in choices:
            raise self.error(key, f"must be one of {', '.join(choices)}: {told(value)}")
        return value

    def flag(self, key: str) -> bool:
        """Return a required true or false."""
        value = self.take(key)
        if not isinstance(value, bool):
            raise self.error(key, f"must be true or false: {told(value)}")
        return value

    def numbers(self, key: str, count: int) -> tuple[float, ...]:
        """Return a required list of so many finite numbers."""
        value = self.take(key)
        if not isinstance(value, list) or len(value) != count:
            raise self.error(key, f"must be a list of {count} numbers")
        items = Section({f"{key}[{i}]": item for i, item in enumerate(value)}, self._where, self._path)
        return tuple(items.number(f"{key}[{i}]") for i in range(count))

    def items(self, key: str) -> list[Section]:
        """Return a required list of mappings."""
        value = self.take(key)
        if not isinstance(value, list):
            raise self.error(key, f"must be a list, not {_kind(value)}")
        return [Section(item, self._where, f"{self._path}.{key}[{i}]".lstrip(".")) for i, item in enumerate(value)]

    def section(self, key: str) -> Section:
        """Return a required mapping."""
        return Section(self.take(key), self._where, f"{self._path}.{key}".lstrip("."))

    def text_or_section(self, key: str, name: str) -> Section:
        """Return a required mapping, or a string as the mapping that has it under a name."""
        value = self.take(key)
        values = {name: value} if isinstance(value, str) else value
        return Section(values, self._where, f"{self._path}.{key}".lstrip("."))

    def names(self) -> list[str]:
        """Return the keys not yet taken."""
        return [key if isinstance(key, str) else told(key) for key in self._values]

    def end(self) -> None:
        """Raise unless every key has been taken."""
        if self._values:
            raise self.error(self.names()[0], "is not a known key")


def load(path: Path) -> Section:
    """Read a YAML file. Raise Error naming file and line when it cannot be read."""
    return Section(parsed(read_text(path, MOST_TEXT), str(path)), str(path))


def parsed(text: str, where: str) -> Any:
    """Return the value of a YAML document. Raise Error naming where, and the line, when it makes no sense."""
    try:
        loader = yaml.SafeLoader(text)
        try:
            node = loader.get_single_node()
            if node is None:
                return None
            _count(node, {}, where)
            return loader.construct_document(node)
        finally:
            loader.dispose()
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 0
        raise Error(f"{where}:{line}: {error.problem}") from error
    except (yaml.YAMLError, ValueError, OverflowError) as error:  # a number or a date that is none
        raise Error(f"{where}: {error}") from error
    except RecursionError as error:
        raise Error(f"{where}: has too many levels") from error


def _count(node: yaml.Node, known: dict[int, int], where: str) -> int:
    """Return how many values a node has with all anchors written out. Raise Error for too many."""
    if id(node) in known:
        return known[id(node)]
    known[id(node)] = _MOST_VALUES  # of an anchor inside itself
    parts = node.value if isinstance(node, yaml.CollectionNode) else []
    children = [child for part in parts for child in (part if isinstance(part, tuple) else (part,))]
    count = 1
    for child in children:
        count += _count(child, known, where)
        if count > _MOST_VALUES:
            line = node.start_mark.line + 1
            raise Error(f"{where}:{line}: has more than {_MOST_VALUES} values, with what its anchors stand for")
    known[id(node)] = count
    return count


def _float(value: int | float) -> float:
    """Return a number as a float, infinite for an integer that is too large for one."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def _kind(value: Any) -> str:
    return f"{type(value).__name__} {told(value)}" if value is not None else "nothing"
