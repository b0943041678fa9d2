# SPDX-License-Identifier: BSD-3-Clause
"""viewer_node: the page of a simulation or a robot, at an address that it prints."""

from __future__ import annotations

import rospy
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from kurumaisu import program
from kurumaisu.ros import life
from kurumaisu.ros.viewer.settings import read_settings
from kurumaisu.ros.viewer.source import RosSource
from kurumaisu.viewer.hub import Hub
from kurumaisu.viewer.server import Server

_HELP = """
Serve a page that shows a simulation or a robot in the browser, and print its
address. viewer.launch starts it: roslaunch kurumaisu viewer.launch

It subscribes only while a page is open.

subscribes to:
  sim_node/world, sim_node/view, sim_node/effects
  stageros/world, stageros/view
  scan, tf, /clock                   of a robot
  odom, voltages, cmd_vel_out, active_input, diagnostics
  map, particlecloud, amcl_pose      of mapping or localization
  /rosout                            warnings
  tf, tf_static                      when a page lists the frames
publishes, if the page may command:
  viewer_vel                         commands for base_node; stageros: cmd_vel
  initialpose, move_base_simple/goal
services:
  ~new_token                         a new address, which allows commands
  ~clients                           the pages that are open
parameters:
  launch/viewer.yaml, and the arguments of launch/viewer.launch

More: docs/viewer.md
"""


def main() -> int:
    """Run the node; return 1 after one line for bad configuration or a port that is taken."""
    program.no_arguments("viewer", _HELP)
    # rostime stays off: it would hear every /clock of a simulator, though nobody looks
    return life.run("viewer_node", _serve, rostime=False)


def _serve(own: life.Life) -> int:
    settings = read_settings(rospy.get_param("~", {}), rospy.get_name())
    hub = Hub()
    source = RosSource(hub, settings)
    server = Server(settings.server, hub, source, settings.control)
    server.start()

    def new_token(_request: TriggerRequest) -> TriggerResponse:
        # Who reaches this service can publish commands, too: nothing is given away.
        return TriggerResponse(settings.control, server.new_address() if settings.control else server.address)

    def clients(_request: TriggerRequest) -> TriggerResponse:
        accounts, stalled = server.accounts()
        lines = [
            f"{one.address}: {one.seconds:.0f} s, {one.shown} frames, {one.missed} more dropped because it was slow"
            for one in accounts
        ]
        return TriggerResponse(True, "\n".join([*lines, f"disconnected so far because they did not read: {stalled}"]))

    services = [rospy.Service("~new_token", Trigger, new_token), rospy.Service("~clients", Trigger, clients)]
    # to the terminal only, for the log and /rosout are read by others
    if settings.control:
        print(f"viewer, with control (the link works once): {server.new_address()}")
    print(f"viewer, view only: {server.address}", flush=True)
    try:
        source.run(settings.server.rate, own.asked)
    finally:
        source.close()
        server.close()
        for service in services:
            service.shutdown()
    return 0
