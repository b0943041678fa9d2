# SPDX-License-Identifier: BSD-3-Clause
"""States as bytes and as digests. Bytes from outside become values of known kinds, or an Error: nothing in them runs.

A line with version and digest, a line of JSON, then the arrays that it points to. In the JSON a list is a list, and
whatever has no form of its own there is an object of one key, which says what it is.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from kurumaisu.errors import Error, told
from kurumaisu.sim.rangers.scans import Sweep
from kurumaisu.sim.robots.population import Gone, Population
from kurumaisu.world import model

MARK = b"kurumaisu state "
_VERSION = 3
_FIRST_LINE = re.compile(rb"kurumaisu state (\d{1,9})(?: ([0-9a-f]{64}))?\n")
_PLAIN = (bool, int, float, str, type(None))
_NUMBERS = "biuf"  # kinds of arrays
# What a state may be made of beside plain values; whoever adds one adds what is called when a file is read.
_CLASSES: dict[str, type[Any]] = {
    each.__name__: each
    for each in (
        *(Population, Gone, Sweep),
        *(model.Model, model.Place, model.Shape, model.Polygon, model.Hinge, model.Walk),
        *(model.Position, model.Ranger, model.Fan, model.Camera, model.Fiducial, model.Bumper, model.Gripper),
    )
}


def pack(state: dict[str, Any]) -> bytes:
    """Return a state as bytes."""
    arrays = _Arrays()
    body = json.dumps(_said(state, arrays), separators=(",", ":")).encode() + b"\n" + arrays.data
    return MARK + f"{_VERSION} {hashlib.sha256(body).hexdigest()}\n".encode() + body


def unpack(saved: bytes) -> dict[str, Any]:
    """Return the state that pack made bytes of. Raise Error for other bytes, and say what they are."""
    first = _FIRST_LINE.match(saved)
    if first is None:
        raise Error(f"state: does not begin with {MARK.decode()!r} and a version: it is no saved state")
    if int(first[1]) != _VERSION:
        raise Error(f"state: is of version {first[1].decode()}; this program reads and writes version {_VERSION}")
    body = saved[first.end() :]
    if first[2] is None or hashlib.sha256(body).hexdigest().encode() != first[2]:
        raise Error("state: is damaged or cut: it does not have the digest that it begins with")
    text, _, data = body.partition(b"\n")
    try:
        state = _meant(json.loads(text), data)
    except (ValueError, TypeError, LookupError, AttributeError, OverflowError, RecursionError) as error:
        raise Error(f"state: makes no sense: {error}") from error
    if not isinstance(state, dict):
        raise Error(f"state: holds a {type(state).__name__}")
    return state


def restored(
    known: dict[str, Any], now: Callable[[], dict[str, Any]], restore: Callable[[dict[str, Any]], None]
) -> None:
    """Restore a state, or, where it does not come back as it was, the one that there is now. Raise Error then.

    A file may have its digest and still hold what was never saved: nothing in it need be what it should be.
    """
    before = unpack(pack(now()))
    try:
        restore(known)
        if digest(now()) != digest(known):
            raise ValueError("some values have other shapes or kinds than here")
    except Exception as error:
        restore(before)
        raise Error(f"state: makes no sense here: {type(error).__name__}: {error}") from error


def digest(value: Any) -> str:
    """Return a digest of a state: equal for equal values, whatever objects hold them."""
    sha = hashlib.sha256()
    _feed(sha, value)
    return sha.hexdigest()


def _feed(sha: Any, value: Any) -> None:
    if isinstance(value, np.ndarray):
        sha.update(f"{value.dtype.str}{value.shape}".encode())
        sha.update(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, dict):
        for key in sorted(value):
            sha.update(f"{key}:".encode())
            _feed(sha, value[key])
    elif isinstance(value, (tuple, list)):
        sha.update(f"[{len(value)}".encode())
        for item in value:
            _feed(sha, item)
    elif isinstance(value, np.random.Generator):
        _feed(sha, value.bit_generator.state)
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            _feed(sha, getattr(value, field.name))
    else:
        sha.update(f"{type(value).__name__} {value!r};".encode())


class _Arrays:
    """Arrays one after another, each once."""

    def __init__(self) -> None:
        self.data = bytearray()
        self._known: dict[int, tuple[Any, list[Any]]] = {}  # by identity, with the array, which so stays alive

    def place(self, array: Any) -> list[Any]:
        """Return type, shape and where an array begins [bytes]."""
        if id(array) not in self._known:
            if array.dtype.kind not in _NUMBERS:
                raise TypeError(f"an array of {array.dtype} cannot be saved")
            self._known[id(array)] = array, [array.dtype.str, list(array.shape), len(self.data)]
            self.data += np.ascontiguousarray(array).tobytes()
        return self._known[id(array)][1]


def _said(value: Any, arrays: _Arrays) -> Any:
    """Return a value as JSON has it."""
    if type(value) in _PLAIN:
        return value
    if isinstance(value, np.generic):
        return {"number": arrays.place(np.asarray(value))}
    if isinstance(value, np.ndarray):
        return {"array": arrays.place(value)}
    if type(value) is list:
        return [_said(item, arrays) for item in value]
    if type(value) is tuple:
        return {"tuple": [_said(item, arrays) for item in value]}
    if type(value) is dict:
        return {"dict": [[_said(key, arrays), _said(item, arrays)] for key, item in value.items()]}
    if isinstance(value, Path):
        return {"path": str(value)}
    name = type(value).__name__
    if _CLASSES.get(name) is not type(value):
        raise TypeError(f"a {type(value).__module__}.{name} cannot be saved")
    fields = {field.name: _said(getattr(value, field.name), arrays) for field in dataclasses.fields(value)}
    return {name: fields}


def _meant(said: Any, data: bytes) -> Any:
    """Return the value that _said made JSON of. Raise ValueError, TypeError or KeyError for other JSON."""
    if isinstance(said, list):
        return [_meant(item, data) for item in said]
    if not isinstance(said, dict):
        return said
    ((kind, content),) = said.items()
    match kind:
        case "number":
            return _array(content, data)[()]
        case "array":
            return _array(content, data)
        case "tuple":
            return tuple(_meant(item, data) for item in content)
        case "dict":
            return {_meant(key, data): _meant(item, data) for key, item in content}
        case "path":
            return Path(content)
    return _CLASSES[kind](**{name: _meant(item, data) for name, item in content.items()})


def _array(content: Any, data: bytes) -> Any:
    """Return the array of a type, a shape and a place in data."""
    kind, shape, start = content
    dtype = np.dtype(kind)
    if dtype.kind not in _NUMBERS:
        raise ValueError(f"an array of {told(kind)}")
    if not all(type(size) is int and size >= 0 for size in [start, *shape]):
        raise ValueError(f"an array at {told(start)} of shape {told(shape)}")
    end = start + dtype.itemsize * math.prod(shape)
    if end > len(data):
        raise ValueError(f"an array up to byte {told(end)} of {len(data)}")
    return np.frombuffer(data[start:end], dtype).reshape(shape).copy()  # that may be changed
