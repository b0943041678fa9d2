# SPDX-License-Identifier: BSD-3-Clause
"""A topic that one of our nodes publishes for another has a reader, as the launch files ship, and the other way round.

A name that two files must share is else joined by nobody: the lock `dead_man` was one that no base ever read.
"""

import contextlib
import subprocess
import time
import xmlrpc.client

import pytest

from kurumaisu.bench.processes import master, running

PATIENCE = 90.0  # [s] for all nodes of the launch files to register

# Outputs that rviz, programs of others, or people read: docs name them.
FOR_PEOPLE = {
    "active_input",
    "base_pose_ground_truth",
    "base_scan",
    "battery_state",
    "clock",
    "cmd_vel_out",
    "collision",
    "diagnostics",
    "diagnostics_agg",
    "diagnostics_toplevel_state",
    "ground_truth",
    "initialpose",
    "joint_states",
    "laser_status",
    "map",
    "map_metadata",
    "move_base_simple/goal",
    "mapping_node/entropy",
    "mapping_node/pose",
    "mapping_node/trajectory_with_covariance",
    "odom",
    "particlecloud",
    "rosout",
    "rosout_agg",
    "sim_node/effects",
    "sim_node/view",
    "sim_node/world",
    "stageros/view",
    "stageros/world",
    "tf",
    "tf_static",
    "trajectory",
    "voltages",
}
# Inputs that others publish, if anybody does: navigation, buttons, rviz, drivers.
FROM_PEOPLE = {
    "clock",
    "cmd_pose",
    "cmd_pose_stamped",
    "cmd_vel",
    "dead_man",
    "diagnostics",
    "e_stop",
    "experiment_vel",
    "hold",
    "imu",
    "initialpose",
    "joint_states",
    "joy",
    "joy_vel",
    "key_vel",
    "passenger_holds",
    "set_pose",
    "speed_cap",
    "syscommand",
    "viewer_vel",
}
SETS = {
    "robot": (
        ["robot.launch", "joystick:=topic", "viewer:=true", "viewer_port:=0", "viewer_control:=true", "imu:=true",
         "laser_port:=/nowhere"],
        ["slam.launch"],
    ),
    "simulator": (["sim.launch", "viewer:=true", "viewer_port:=0"], ["teleop.launch", "device:=none"], ["slam.launch"]),
    "stage": (["stageros.launch", "viewer:=true", "viewer_port:=0"],),
}  # fmt: skip
MUST_BE_JOINED = {
    "robot": {"dead_man", "joy_vel", "viewer_vel", "scan"},
    "simulator": {"dead_man", "joy_vel", "voltages"},
}


def nodes_of(launch):
    text = subprocess.run(
        ["roslaunch", "--nodes", "kurumaisu", *launch], capture_output=True, text=True, check=True
    ).stdout
    return set(text.split())


def state(uri):
    """Return publishers and subscribers, {topic: nodes}, and all nodes."""
    with xmlrpc.client.ServerProxy(uri) as proxy:
        _, _, (publishers, subscribers, services) = proxy.getSystemState("/test")
    named = {node for side in (publishers, subscribers, services) for _, nodes in side for node in nodes}
    return dict(publishers), dict(subscribers), named


def bare(topic):
    return topic.lstrip("/")


@pytest.mark.parametrize("name", SETS)
def test_every_topic_has_its_other_end(name, tmp_path):
    nodes = set()
    with master() as environment, contextlib.ExitStack() as stack:
        for i, launch in enumerate(
            SETS[name]
        ):  # one after the other: two that start at once quarrel about who was first
            log = tmp_path / f"{i}.log"
            stack.enter_context(running(["roslaunch", "kurumaisu", *launch], log, environment))
            nodes |= nodes_of(launch) - {"/launch_watch"}  # it registers nothing
            deadline = time.monotonic() + PATIENCE
            while missing := nodes - state(environment["ROS_MASTER_URI"])[2]:
                assert time.monotonic() < deadline, (missing, log.read_text()[-2000:])
                time.sleep(0.2)
        time.sleep(3.0)  # a node registers its topics one after the other
        publishers, subscribers, _ = state(environment["ROS_MASTER_URI"])
    own = {topic: set(by) & nodes for topic, by in publishers.items()}
    unread = {t for t, by in own.items() if by and not subscribers.get(t)}
    unspoken = {t for t, by in subscribers.items() if set(by) & nodes and not publishers.get(t)}
    spare = {t for t in unread if bare(t) not in FOR_PEOPLE and "parameter_" not in t}
    assert sorted(spare) == [], "nobody reads what our nodes publish"
    assert sorted(t for t in unspoken if bare(t) not in FROM_PEOPLE) == [], "nobody publishes what our nodes read"
    for topic in MUST_BE_JOINED.get(name, ()):
        assert own.get(f"/{topic}"), topic
        assert set(subscribers.get(f"/{topic}", ())) & nodes, topic
