# SPDX-License-Identifier: BSD-3-Clause
"""Strict reader of YAML settings: every key is read exactly once, so a misspelt one cannot survive."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from kurumaisu.errors import Error


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
        value = self.take(key)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.error(key, f"must be a number, not {_kind(value)} (YAML wants 1.0e-3, not 1e-3)")
        if not math.isfinite(value) or value < at_least or value <= above:
            bound = f" above {above:g}" if above > -math.inf else f" of at least {at_least:g}"
            raise self.error(
                key, f"must be a finite number{bound if max(above, at_least) > -math.inf else ''}: {value}"
            )
        return float(value)

    def integer(self, key: str, at_least: int) -> int:
        """Return a required integer."""
        value = self.take(key)
        if isinstance(value, bool) or not isinstance(value, int) or value < at_least:
            raise self.error(key, f"must be an integer of at least {at_least}: {value!r}")
        return value

    def text(self, key: str, choices: Sequence[str] = ()) -> str:
        """Return a required string, one of the choices if there are any."""
        value = self.take(key)
        if not isinstance(value, str) or not value:
            raise self.error(key, f"must be a string, not {_kind(value)}")
        if choices and value not in choices:
            raise self.error(key, f"must be one of {', '.join(choices)}: {value!r}")
        return value

    def flag(self, key: str) -> bool:
        """Return a required true or false."""
        value = self.take(key)
        if not isinstance(value, bool):
            raise self.error(key, f"must be true or false: {value!r}")
        return value

    def numbers(self, key: str, count: int) -> tuple[float, ...]:
        """Return a required list of so many finite numbers."""
        value = self.take(key)
        if not isinstance(value, list) or len(value) != count:
            raise self.error(key, f"must be a list of {count} numbers")
        items = Section({str(i): item for i, item in enumerate(value)}, self._where, f"{self._path}.{key}")
        return tuple(items.number(str(i)) for i in range(count))

    def items(self, key: str) -> list[Section]:
        """Return a required list of mappings."""
        value = self.take(key)
        if not isinstance(value, list):
            raise self.error(key, f"must be a list, not {_kind(value)}")
        return [Section(item, self._where, f"{self._path}.{key}[{i}]".lstrip(".")) for i, item in enumerate(value)]

    def section(self, key: str) -> Section:
        """Return a required mapping."""
        return Section(self.take(key), self._where, f"{self._path}.{key}".lstrip("."))

    def names(self) -> list[str]:
        """Return the keys not yet taken."""
        return [str(key) for key in self._values]

    def end(self) -> None:
        """Raise unless every key has been taken."""
        if self._values:
            raise self.error(self.names()[0], "is not a known key")


def load(path: Path) -> Section:
    """Read a YAML file. Raise Error naming file and line when it cannot be read."""
    try:
        with path.open(encoding="utf-8") as stream:
            return Section(yaml.safe_load(stream), str(path))
    except OSError as error:
        raise Error(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise Error(f"{path}: is not UTF-8 text") from error
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 0
        raise Error(f"{path}:{line}: {error.problem}") from error
    except yaml.YAMLError as error:
        raise Error(f"{path}: {error}") from error


def _kind(value: Any) -> str:
    return f"{type(value).__name__} {value!r}" if value is not None else "nothing"
