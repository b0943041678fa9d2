# SPDX-License-Identifier: BSD-3-Clause
"""States as bytes and as digests. Reading one never runs code: only values of known kinds come out."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import pickle
from typing import Any

import numpy as np

from kurumaisu.errors import Error

_MARK = b"kurumaisu state 1\n"
_PLAIN = {
    ("numpy", "ndarray"),
    ("numpy", "dtype"),
    ("numpy.core.multiarray", "_reconstruct"),
    ("numpy.core.multiarray", "scalar"),
    ("numpy.core.numeric", "_frombuffer"),
    ("pathlib", "PosixPath"),
}
_OURS = ("kurumaisu.world.model", "kurumaisu.sim.robots.population", "kurumaisu.sim.rangers.scans")
_SENSORS = "kurumaisu.sim.sensors."
_MOVED = {  # where classes are whose modules had these names when a state was saved
    "kurumaisu.sim.population": "kurumaisu.sim.robots.population",
    "kurumaisu.sim.scans": "kurumaisu.sim.rangers.scans",
}


def pack(state: dict[str, Any]) -> bytes:
    """Return a state as bytes."""
    return _MARK + pickle.dumps(state, protocol=5)


def unpack(saved: bytes) -> dict[str, Any]:
    """Return the state that pack made bytes of. Raise Error for other bytes."""
    if not saved.startswith(_MARK):
        raise Error(f"state: does not begin with {_MARK!r}")
    try:
        state = _Reader(io.BytesIO(saved[len(_MARK) :])).load()
    except Exception as error:  # pickle raises nearly everything on damaged bytes
        raise Error(f"state: damaged: {error}") from error
    if not isinstance(state, dict):
        raise Error(f"state: holds a {type(state).__name__}")
    return state


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
    elif type(value).__module__.startswith(_SENSORS):
        _feed(sha, vars(value))
    else:
        sha.update(f"{type(value).__name__} {value!r};".encode())


class _Reader(pickle.Unpickler):
    """Makes plain values and the classes of a state, nothing else."""

    def find_class(self, module: str, name: str) -> Any:
        module = _MOVED.get(module, module)
        if (module, name) in _PLAIN or module in _OURS or module.startswith(_SENSORS):
            return super().find_class(module, name)
        raise pickle.UnpicklingError(f"{module}.{name} is not part of a state")
