# SPDX-License-Identifier: BSD-3-Clause
"""The catalogue of effects as a description for dynamic_reconfigure, and its configurations as lists of effects."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

from kurumaisu import effects
from kurumaisu.effects import Mechanism, Parameter
from kurumaisu.params import EffectSetting

_ENABLED = "enabled"
_FAMILIES: tuple[tuple[str, tuple[type[Mechanism], ...]], ...] = (
    ("base", effects.BASE),
    ("laser", effects.LASER),
    ("world", effects.WORLD),
)


def key_of(effect: str, parameter: str) -> str:
    """Return the name of an effect's parameter, or of `enabled`: base.lag_w and tau are base_lag_w_tau."""
    return f"{effect}_{parameter}".replace(".", "_")


def description(acting: Sequence[EffectSetting]) -> SimpleNamespace:
    """Return what a Server takes for a type: a group for each effect, whose default is what is acting."""
    root = _group("Default", 0, 0, "")
    number = 0
    for family, members in _FAMILIES:
        number += 1
        tab = _group(family, number, 0, "tab")
        root["groups"].append(tab)
        for effect in members:
            number += 1
            group = _group(effect.id, number, tab["id"], "")
            group["parameters"] = _parameters(effect, acting)
            tab["groups"].append(group)
    every = _leaves(root)
    return SimpleNamespace(
        config_description=root,
        **{
            name: {p["name"]: p[one] for p in every}
            for name, one in (("min", "min"), ("max", "max"), ("defaults", "default"), ("level", "level"))
        },
        type={p["name"]: p["type"] for p in every},
        all_level=1,
    )


def settings_of(config: Mapping[str, Any]) -> tuple[EffectSetting, ...]:
    """Return the effects that a configuration has enabled."""
    return tuple(
        EffectSetting(effect.id, {p.name: float(config[key_of(effect.id, p.name)]) for p in effect.parameters})
        for effect in effects.ALL
        if config[key_of(effect.id, _ENABLED)]
    )


@dataclass(frozen=True)
class Asked:
    """What of a request can be done, and what is to be said of the rest."""

    changes: dict[str, Any] = field(default_factory=dict)
    complaints: list[str] = field(default_factory=list)


def sift(request: Mapping[str, Any]) -> Asked:
    """Return the changes that a request asks for: out of bounds becomes the bound, what is no number is left out."""
    asked = Asked()
    for name, value in request.items():
        if name == "groups":
            asked.changes[name] = value
        elif name in _ENABLERS:
            asked.changes[name] = bool(value)
        elif name not in _NUMBERS:
            asked.complaints.append(f"{name}: is not a parameter of an effect")
        else:
            _bound(asked, name, float(value))
    return asked


def _bound(asked: Asked, name: str, value: float) -> None:
    effect, parameter = _NUMBERS[name]
    limits = f"{parameter.lower:g} to {parameter.upper:g} {parameter.unit}"
    if math.isnan(value):
        asked.complaints.append(f"{effect}: {parameter.name} must be {limits}: nan; it stays as it is")
        return
    held = min(max(value, parameter.lower), parameter.upper)
    if held != value:
        asked.complaints.append(f"{effect}: {parameter.name} must be {limits}: {value:g}; {held:g} is used")
    asked.changes[name] = held


def _parameters(effect: type[Mechanism], acting: Sequence[EffectSetting]) -> list[dict[str, Any]]:
    values = next((one.parameters for one in acting if one.id == effect.id), None)
    switch = _entry(key_of(effect.id, _ENABLED), "bool", f"{effect.sentence}: {effect.formula}")
    switch |= {"default": values is not None, "min": False, "max": True}
    entries = [switch]
    for p in effect.parameters:
        unit = "" if p.unit == "1" else f" {p.unit}"
        about = f"typically {p.null:g} ± {p.scale:g}{unit}" if p.null else f"0: none; typically {p.scale:g}{unit}"
        entry = _entry(key_of(effect.id, p.name), "double", f"{p.name} [{p.unit}]: {about}")
        default = p.null if values is None else values[p.name]
        entries.append(entry | {"default": float(default), "min": float(p.lower), "max": float(p.upper)})
    return entries


def _entry(name: str, kind: str, words: str) -> dict[str, Any]:
    return {"name": name, "type": kind, "level": 1, "description": words, "edit_method": ""}


def _group(name: str, number: int, parent: int, kind: str) -> dict[str, Any]:
    return {
        "name": name,
        "id": number,
        "parent": parent,
        "type": kind,
        "state": True,
        "groups": [],
        "parameters": [],
    }


def _leaves(group: Mapping[str, Any]) -> list[dict[str, Any]]:
    return [*group["parameters"], *(entry for below in group["groups"] for entry in _leaves(below))]


_ENABLERS = frozenset(key_of(effect.id, _ENABLED) for effect in effects.ALL)
_NUMBERS: Mapping[str, tuple[str, Parameter]] = {
    key_of(effect.id, p.name): (effect.id, p) for effect in effects.ALL for p in effect.parameters
}
