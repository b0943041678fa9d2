# SPDX-License-Identifier: BSD-3-Clause
"""The page's switches of effects, by sim_node's dynamic_reconfigure."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from dynamic_reconfigure.encoding import decode_config, encode_config
from dynamic_reconfigure.srv import Reconfigure
from std_msgs.msg import String

from kurumaisu.errors import Error
from kurumaisu.params import effects_of
from kurumaisu.ros.sim.effects import NAMESPACE
from kurumaisu.ros.sim.effects_config import key_of
from kurumaisu.ros.viewer.calls import call
from kurumaisu.ros.viewer.topics import Newest
from kurumaisu.settings import Section, parsed
from kurumaisu.viewer.effects import Switches
from kurumaisu.viewer.hub import Hub
from kurumaisu.viewer.source import Outcome


class EffectSwitches:
    """Shows what acts in the hub, and changes it."""

    def __init__(self, hub: Hub, node: str, model: Path) -> None:
        """node: the simulator's name; model: the file that it runs."""
        self._hub = hub
        self._node = node
        self._model = model
        self._topic = Newest(f"{node}/effects", String)
        self._switches = Switches()

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
        self._hub.effects(self._switches.set(effects_of(Section(parsed(said.data, where), where))))

    def switch(self, effect: str, enabled: bool, values: Mapping[str, float]) -> Outcome:
        """Switch one on, change it, or switch it off. Raise Error where sim_node does not."""
        setting = self._switches.asked(effect, values)
        changes = {
            key_of(effect, "enabled"): enabled,
            **{key_of(effect, name): value for name, value in values.items()},
        }
        answer = call(f"{self._node}/{NAMESPACE}/set_parameters", Reconfigure, encode_config(changes))
        said = decode_config(answer.config)
        if any(said[key] != value for key, value in changes.items()):
            raise Error(f"effect: {self._node} refuses {effect}: its log says why")
        self._switches.remember(setting)
        return Outcome(f"{effect} {'is on' if enabled else 'is off'}")

    def model(self) -> Outcome:
        """Return the model file with the effects that act, as the simulator reads it."""
        self.show()
        return self._switches.model(self._model)
