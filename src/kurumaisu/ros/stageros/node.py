# SPDX-License-Identifier: BSD-3-Clause
"""stageros: a world of Stage behind the topics, frames and services of stage_ros 1.8.0."""

from __future__ import annotations

import argparse
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import rospy

from kurumaisu import program
from kurumaisu.errors import Error
from kurumaisu.ros import life
from kurumaisu.ros.stageros.services import StagerosServices
from kurumaisu.ros.stageros.session import Session
from kurumaisu.ros.stageros.settings import StagerosSettings, read_settings
from kurumaisu.sim.live.pacing import Pacer
from kurumaisu.sim.live.requests import Requests
from kurumaisu.world import World, load_world

_USAGE = "usage: stageros [-g] [-u] FILE.world"
_HELP = """
Simulate a Stage world with the topics, frames and services of stage_ros 1.8.0.

With several robots the names below begin with /robot_0/, /robot_1/, ...

subscribes to:
  cmd_vel                     drives a robot
  cmd_pose, cmd_pose_stamped  move it to a pose
publishes:
  odom, base_pose_ground_truth
  base_scan                   of a robot with several lasers: /base_scan_0, ...
  image, depth, camera_info   while something subscribes
  /clock, /tf
  ~world, ~view               what a page draws
  base_sonar, collision, bumper, fiducials: see launch/stageros.yaml
services:
  reset_positions             all back to the start, as in stage_ros
  ~reset, ~seed               the same, with the same or another seed
  ~pause, ~step, ~speed       pause, advance one step, change the speed
  ~set_pose, ~spawn, ~delete  move a model, add one, remove one
  ~restore                    bring back one that was removed
  ~save_world                 the world as it is now, as the text of a file
  ~save, ~load                the whole state, to a file and back
parameters:
  launch/stageros.yaml, which the node reads itself

More: docs/stageros.md
"""


@dataclass(frozen=True)
class Arguments:
    """The command line: headless (-g) runs as fast as possible, use_model_names (-u) in topics and frames."""

    world: Path
    headless: bool
    use_model_names: bool


def parse(arguments: Sequence[str]) -> Arguments | None:
    """Return what the arguments say; None without a file, which is the last of them, as in 1.8.0.

    End the program for --help, and with 2 for an unknown option.
    """
    if not arguments or arguments[-1] in ("-g", "-u"):
        return None
    options = _parser().parse_args(arguments)
    return Arguments(Path(options.world[-1]), options.g, options.u)


def _parser() -> argparse.ArgumentParser:
    parser = program.node_parser("stageros", _HELP)
    parser.usage = _USAGE.removeprefix("usage: ")
    parser.add_argument("-g", action="store_true", help="as fast as possible, instead of at the world's speedup")
    parser.add_argument("-u", action="store_true", help="topics and frames begin with the models' names")
    parser.add_argument("world", nargs="+", metavar="FILE.world", help="a Stage world, or a map_server YAML")
    return parser


def main() -> int:
    """Run the node; return what the process exits with."""
    arguments = parse(program.words())
    if arguments is None:
        print(_USAGE)
        return 255
    # rostime stays off: with /use_sim_time rospy would read back every /clock that we send
    return life.run("stageros", partial(_simulate, arguments), rostime=False)


def _simulate(arguments: Arguments, own: life.Life) -> int:
    settings = read_settings(rospy.get_param("~", {}), rospy.get_name())
    values = {name: str(value) for name, value in settings.parameters.items()}
    world = load_world(arguments.world, image_extents=settings.image_extents, values=values)
    speed = _speed(world, settings, arguments.headless)
    pacer = Pacer(speed)
    session = Session(world, settings, arguments.use_model_names)
    for warning in (*settings.unknown, *session.warnings):
        rospy.logwarn(f"STAGEROS_WORLD {warning}")
    rospy.set_param("/use_sim_time", True)
    requests = Requests()
    StagerosServices(session, requests, pacer, settings.states)
    _run(session, requests, pacer, world, own.asked)
    return 0


def _speed(world: World, settings: StagerosSettings, headless: bool) -> float:
    """Return simulated seconds per second; 0: as fast as possible."""
    if headless:
        return settings.headless_rate
    if settings.headless_rate > 0:
        raise Error(
            f"headless_rate: {settings.headless_rate:g}: works only with -g; otherwise the world's speedup is used"
        )
    rospy.logwarn(
        "STAGEROS_NO_WINDOW without -g the world runs at its speedup, but this program has no window; for a page: "
        "roslaunch kurumaisu viewer.launch simulator:=stageros base:=none drive:=cmd_vel control:=true"
    )
    return max(world.speedup, 0.0)


def _run(session: Session, requests: Requests, pacer: Pacer, world: World, stopped: threading.Event) -> None:
    """Simulate until it is stopped, or the world's quit_time has come."""
    while not stopped.is_set():
        if requests:
            requests.serve()
            session.show(pacer.speed)
        if session.paused:
            session.show(pacer.speed)
            requests.wait(0.1)
            continue
        if not pacer.wait(requests):
            continue
        session.step()
        session.show(pacer.speed)  # before the pause: a step that is due when its scans are noted is due when shown
        if 0 < world.quit_time <= session.time:
            rospy.loginfo(f"{world.path}: quit_time {world.quit_time:g} s is reached")
            break
        pacer.step(world.interval)
    requests.close()
