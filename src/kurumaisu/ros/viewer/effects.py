# SPDX-License-Identifier: BSD-3-Clause
"""Every effect of the catalogue as a switch with sliders, by sim_node's dynamic_reconfigure; the model they make."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import yaml
from dynamic_reconfigure.encoding import decode_config, encode_config
from dynamic_reconfigure.srv import Reconfigure
from std_msgs.msg import String

from kurumaisu import effects
from kurumaisu.bounded_files import MOST_TEXT, read_text
from kurumaisu.effects import Mechanism
from kurumaisu.errors import Error
from kurumaisu.names import hint
from kurumaisu.params import EffectSetting, effects_of, read_model
from kurumaisu.ros.sim.effects import NAMESPACE
from kurumaisu.ros.sim.effects_config import key_of, listed
from kurumaisu.ros.viewer.calls import call
from kurumaisu.ros.viewer.topics import Newest
from kurumaisu.settings import Section, parsed
from kurumaisu.viewer.hub import Hub
from kurumaisu.viewer.protocol import Group, Value
from kurumaisu.viewer.source import Outcome


class EffectSwitches:
    """Shows what acts in the hub, and changes it."""

    def __init__(self, hub: Hub, node: str, model: Path) -> None:
        """node: the simulator's name; model: the file that it runs."""
        self._hub = hub
        self._node = node
        self._model = model
        self._topic = Newest(f"{node}/effects", String)
        self._acting: tuple[EffectSetting, ...] = ()
        self._values: dict[str, Mapping[str, float]] = {}  # as they were last, of those that are off, too

    def open(self) -> None:
        """Listen."""
        self._topic.open()

    def close(self) -> None:
        """Listen no longer."""
        self._topic.close()

    def show(self) -> None:
        """Put what acts into the hub, if it has changed."""
        said = self._topic.take()
        if said is None:
            return
        where = f"{self._node}/effects"
        self._acting = effects_of(Section(parsed(said.data, where), where))
        self._values |= {one.id: one.parameters for one in self._acting}
        on = {one.id for one in self._acting}
        self._hub.effects(tuple(self._group(effect, effect.id in on) for effect in effects.ALL))

    def switch(self, effect: str, enabled: bool, values: Mapping[str, float]) -> Outcome:
        """Switch one on, change it, or switch it off. Raise Error where sim_node does not."""
        chosen = next((one for one in effects.ALL if one.id == effect), None)
        if chosen is None:
            near = hint(effect, (one.id for one in effects.ALL), "docs/effects.md")
            raise Error(f"effect: there is no effect {effect!r}; {near}")
        for name in values:
            if name not in {p.name for p in chosen.parameters}:
                raise Error(f"effect: {effect} has no {name!r}")
        chosen.check({**self._of(chosen), **values})
        changes = {
            key_of(effect, "enabled"): enabled,
            **{key_of(effect, name): value for name, value in values.items()},
        }
        answer = call(f"{self._node}/{NAMESPACE}/set_parameters", Reconfigure, encode_config(changes))
        said = decode_config(answer.config)
        if any(said[key] != value for key, value in changes.items()):
            raise Error(f"effect: {self._node} refuses {effect}: its log says why")
        self._values[effect] = {**self._of(chosen), **values}
        return Outcome(f"{effect} {'is on' if enabled else 'is off'}")

    def model(self) -> Outcome:
        """Return the model file with the effects that act, as the simulator reads it."""
        self.show()
        text = with_effects(read_text(self._model, MOST_TEXT), self._acting)
        where = f"{self._model} with the effects that act"
        read_model(Section(parsed(text, where), where))
        return Outcome(f"{self._model.name} with {len(self._acting)} effects", text)

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


def with_effects(text: str, acting: tuple[EffectSetting, ...]) -> str:
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
