# SPDX-License-Identifier: BSD-3-Clause
"""Every effect of the catalogue as a switch with sliders, and the model file that those that act make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import yaml

from kurumaisu import effects
from kurumaisu.bounded_files import MOST_TEXT, read_text
from kurumaisu.effects import Mechanism
from kurumaisu.errors import Error
from kurumaisu.names import hint
from kurumaisu.params import EffectSetting, read_model
from kurumaisu.settings import Section, parsed
from kurumaisu.viewer.protocol import Group, Value
from kurumaisu.viewer.source import Outcome


class Switches:
    """Knows what acts, and the values that the others had last."""

    def __init__(self) -> None:
        """Nothing acts."""
        self.acting: tuple[EffectSetting, ...] = ()
        self._values: dict[str, Mapping[str, float]] = {}  # as they were last, of those that are off, too

    def set(self, acting: Sequence[EffectSetting]) -> tuple[Group, ...]:
        """Take what acts now; return what a page shows of it."""
        self.acting = tuple(acting)
        self._values |= {one.id: one.parameters for one in self.acting}
        on = {one.id for one in self.acting}
        return tuple(self._group(effect, effect.id in on) for effect in effects.ALL)

    def asked(self, effect: str, values: Mapping[str, float]) -> EffectSetting:
        """Return an effect with some values changed. Raise Error for what is not there, or out of bounds."""
        chosen = next((one for one in effects.ALL if one.id == effect), None)
        if chosen is None:
            near = hint(effect, (one.id for one in effects.ALL), "docs/effects.md")
            raise Error(f"effect: there is no effect {effect!r}; {near}")
        for name in values:
            if name not in {p.name for p in chosen.parameters}:
                raise Error(f"effect: {effect} has no {name!r}")
        setting = EffectSetting(effect, {**self._of(chosen), **values})
        chosen.check(setting.parameters)
        return setting

    def remember(self, setting: EffectSetting) -> None:
        """Keep the values of an effect that was changed, on or off."""
        self._values[setting.id] = setting.parameters

    def model(self, file: Path) -> Outcome:
        """Return a model file with the effects that act, as the simulator reads it."""
        text = with_effects(read_text(file, MOST_TEXT), self.acting)
        where = f"{file} with the effects that act"
        read_model(Section(parsed(text, where), where))
        return Outcome(f"{file.name} with {len(self.acting)} effects", text)

    def _of(self, effect: type[Mechanism]) -> Mapping[str, float]:
        return self._values.get(effect.id) or {p.name: p.null for p in effect.parameters}

    def _group(self, effect: type[Mechanism], on: bool) -> Group:
        values = self._of(effect)
        return Group(
            id=effect.id,
            title=f"{effect.sentence}: {effect.formula}",
            enabled=on,
            parameters=tuple(
                Value(
                    name=p.name,
                    description=f"typically {p.scale:g}",
                    unit=p.unit,
                    min=p.lower,
                    max=p.upper,
                    value=float(values[p.name]),
                    neutral=p.null,
                    typical=p.scale if p.null == 0 else p.null,  # of a form that has a middle, the middle
                )
                for p in effect.parameters
            ),
        )


def listed(settings: Sequence[EffectSetting]) -> str:
    """Return effects as a file of them has it."""
    lines = [f"  - {{id: {one.id}, parameters: {{{_values(one.parameters)}}}}}" for one in settings]
    return "\n".join(["effects:", *lines]) if lines else "effects: []"


def with_effects(text: str, acting: Sequence[EffectSetting]) -> str:
    """Return a model file's text, comments and all, with these effects in place of its own."""
    top = yaml.compose(text)
    pairs = top.value if isinstance(top, yaml.MappingNode) else []
    found = [(key, value) for key, value in pairs if key.value == "effects"]
    if not found:
        raise Error("model: effects: is missing")
    key, value = found[0]
    old = text[key.start_mark.index : value.end_mark.index]
    end = "\n" if old.endswith("\n") else ""
    return text[: key.start_mark.index] + listed(acting) + end + text[value.end_mark.index :]


def _values(parameters: Mapping[str, float]) -> str:
    return ", ".join(f"{name}: {float(value)!r}" for name, value in parameters.items())
