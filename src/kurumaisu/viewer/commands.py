# SPDX-License-Identifier: BSD-3-Clause
"""What a client may send, checked before anything hears of it: names, arguments and their kinds."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

from kurumaisu.errors import Error

_LONGEST_NAME = 200  # characters of a body, an effect, a parameter
_LARGEST_SEED = 2**32 - 1


@dataclass(frozen=True)
class Request:
    """A command with its arguments; id: what the client calls it."""

    id: int | str
    name: str
    arguments: Mapping[str, Any]


@dataclass(frozen=True)
class Credential:
    """What a client shows to be allowed to command: a one-time token, or the session that it got for one."""

    kind: str
    secret: str


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise ValueError("must be true or false")
    return value


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError("must be a finite number")
    try:
        number = float(value)
    except OverflowError:  # an integer of hundreds of digits
        number = math.inf
    if not math.isfinite(number):
        raise ValueError("must be a finite number")
    return number


def _seed(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= _LARGEST_SEED:
        raise ValueError(f"must be an integer of 0 to {_LARGEST_SEED}")
    return value


def _word(value: Any) -> str:
    if not isinstance(value, str) or not 0 < len(value) <= _LONGEST_NAME:
        raise ValueError(f"must be a text of 1 to {_LONGEST_NAME} characters")
    return value


def _values(value: Any) -> dict[str, float]:
    if not isinstance(value, dict):
        raise ValueError("must be numbers by their names")
    return {_word(name): _number(number) for name, number in value.items()}


_Kinds = Mapping[str, Callable[[Any], Any]]
COMMANDS: Mapping[str, _Kinds] = {
    "pause": {"on": _flag},
    "step": {},
    "speed": {"value": _number},
    "reset": {},
    "seed": {"value": _seed},
    "set_pose": {"body": _word, "x": _number, "y": _number, "yaw": _number},
    "add": {"kind": _word, "x": _number, "y": _number, "yaw": _number, "length": _number, "width": _number},
    "delete": {"body": _word},
    "restore": {"body": _word},
    "save_world": {},
    "drive": {"v": _number, "w": _number},  # and of several robots, which one
    "estop": {"on": _flag},
    "effect": {"effect": _word, "enabled": _flag, "values": _values},
    "save_model": {},
    "record": {"on": _flag},
    "seek": {"t": _number},
    "play": {"on": _flag},
    "rate": {"value": _number},
    "run": {"run": _word},
    "goal": {"x": _number, "y": _number, "yaw": _number},
    "go": {},
    "forget_goal": {},
    "frames": {},
    "initial_pose": {"x": _number, "y": _number, "yaw": _number},
}
_OPTIONAL: Mapping[str, _Kinds] = {
    "drive": {"body": _word},
    "go": {"body": _word},
    "add": {"to_x": _number, "to_y": _number},  # where a person walks to, and back
}


OPEN = frozenset({"frames"})  # who only looks may give these, too: they change nothing


def read(message: str) -> Request | Credential:
    """Return what a client has sent. Raise Error naming what is wrong with it."""
    try:
        content = json.loads(message, parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise Error(f"message: is not JSON: {error}") from error
    if not isinstance(content, dict):
        raise Error("message: must be an object")
    kind = content.pop("type", None)
    if kind in ("token", "session"):
        secret = content.get(kind)
        if not isinstance(secret, str):
            raise Error(f"{kind}: must be a text")
        return Credential(kind, secret)
    if kind != "command":
        raise Error(f"type: must be token, session or command: {str(kind)[:_LONGEST_NAME]!r}")
    return _command(content)


def number_of(message: str) -> int | str | None:
    """Return the id of a command that makes no sense, if there is one."""
    try:
        content = json.loads(message)
    except (ValueError, RecursionError):
        return None
    number = content.get("id") if isinstance(content, dict) else None
    return number if _is_id(number) else None


def _command(content: dict[str, Any]) -> Request:
    number, name = content.pop("id", None), content.pop("name", None)
    if not _is_id(number):
        raise Error("id: must be an integer or a short text")
    if not isinstance(name, str) or name not in COMMANDS:
        raise Error(f"name: there is no command {str(name)[:_LONGEST_NAME]!r}")
    required, kinds = COMMANDS[name], {**COMMANDS[name], **_OPTIONAL.get(name, {})}
    for key in content:
        if key not in kinds:
            raise Error(f"{name}: has no {key[:_LONGEST_NAME]!r}")
    for key in required:
        if key not in content:
            raise Error(f"{name}: {key} is missing")
    arguments = {}
    for key, check in kinds.items():
        if key not in content:
            continue
        try:
            arguments[key] = check(content[key])
        except ValueError as error:
            raise Error(f"{name}: {key} {error}") from error
    return Request(number, name, arguments)


def _is_id(number: Any) -> bool:
    if isinstance(number, str):
        return len(number) <= _LONGEST_NAME
    return isinstance(number, int) and not isinstance(number, bool) and abs(number) < 2**53


def _refuse(word: str) -> NoReturn:
    raise ValueError(f"{word} is not a number")
