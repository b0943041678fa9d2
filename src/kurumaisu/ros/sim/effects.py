# SPDX-License-Identifier: BSD-3-Clause
"""Effects switched on, changed and off while sim_node runs: dynamic_reconfigure, and a topic that says what acts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import rospy
from dynamic_reconfigure.server import Server
from std_msgs.msg import String

from kurumaisu.errors import Error, one_line
from kurumaisu.params import EffectSetting
from kurumaisu.ros.sim import effects_config as config
from kurumaisu.viewer.effects import listed

NAMESPACE = "live"  # of its parameters and services below the node's name

_Settings = tuple[EffectSetting, ...]


class LiveEffects:
    """Lets dynamic_reconfigure switch every effect of the catalogue; latched on `~effects`: those that act."""

    def __init__(self, acting: _Settings, switch: Callable[[_Settings], None]) -> None:
        """Advertise; acting: the model's; switch: makes others act, or raises Error and leaves all as it was."""
        kind = config.description(acting)
        known = config.settings_of(kind.defaults)
        ids = {setting.id for setting in known}
        self._others = tuple(setting for setting in acting if setting.id not in ids)  # curves: they stay as they are
        self._acting: _Settings = (*known, *self._others)
        self._switch = switch
        self._topic = rospy.Publisher("~effects", String, queue_size=1, latch=True)
        self._config: Any = None
        self._server = _Server(kind, self._change, NAMESPACE)
        self._say()

    def _change(self, wanted: Any, _level: int) -> Any:
        """Return the configuration that is in force from now on."""
        settings = *config.settings_of(wanted), *self._others
        if self._config is None:  # the server starts
            self._config = wanted
            return wanted
        try:
            if settings != self._acting:
                self._switch(settings)
        except (Error, RuntimeError) as error:  # or the simulation has ended
            rospy.logwarn(f"SIM_EFFECTS_REFUSED {one_line(error)}")
            return self._config
        changed = settings != self._acting
        self._acting, self._config = settings, wanted
        if changed:
            self._say()
        return wanted

    def _say(self) -> None:
        text = listed(self._acting)
        rospy.loginfo(f"SIM_EFFECTS {' '.join(text.split())}")
        self._topic.publish(text)


class _Server(Server):
    """A server that says what it does not do as asked."""

    def update_configuration(self, changes: Mapping[str, Any]) -> Any:
        """Return the configuration after a request."""
        asked = config.sift(changes)
        for complaint in asked.complaints:
            rospy.logwarn(f"SIM_EFFECTS_BOUNDED {complaint}")
        return super().update_configuration(asked.changes)

    def _copy_from_parameter_server(self) -> None:
        """Leave out what an earlier start may have left there: what acts at this one is the model's."""

    def _copy_to_parameter_server(self) -> None:
        """Set all in one call: one for each would take a tenth of a second."""
        rospy.set_param(self.ns.rstrip("/"), {name: self.config[name] for name in self.type.defaults})
