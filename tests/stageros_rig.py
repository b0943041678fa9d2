# SPDX-License-Identifier: BSD-3-Clause
"""A stageros process with a world of its own, and what its tests share."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import tempfile
import unittest
from pathlib import Path

import geometry_msgs.msg
import numpy as np
import PIL.Image
import pytest
import roslib.packages
import rospy
from geometry_msgs.msg import Twist
from kurumaisu.srv import SetPose
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage

from kurumaisu.ros.rotation import quaternion_of, yaw_of
from kurumaisu.ros.testing.nodes import PATIENCE, Topic, wait_for

STEP = 0.1  # [s]
# A room of 10 x 8 m; the beams' plane is 0.3 + 0.05 + 0.01 m high
MODELS = """
resolution 0.02
interval_sim 100
define laser ranger ( sensor ( range [0.1 20] fov 180 samples 5 ) )
define sonar ranger ( sensor ( range [0 4] fov 20 samples 1 ) sensor ( range [0 4] fov 20 samples 1 pose [0 0 0 90] ) )
define eye camera ( resolution [8 6] range [0.2 8] fov [70 40] )
define base position ( size [0.4 0.4 0.3] drive "diff" laser ( pose [0.1 0 0.05 0] ) )
model ( name "room" size [10 8 1] boundary 1 )
"""
ONE = (
    MODELS
    + """
base ( name "era" pose [1 0.5 0 0] )
model ( name "target" pose [3 0.5 0 0] size [0.5 0.5 1] ranger_return 4000 )
model ( name "black" pose [-3 0 0 0] size [0.5 0.5 1] ranger_return 0 )
"""
)


class Stageros:
    """A stageros process with a world of its own."""

    def __init__(self, text: str, *arguments: str, environment: dict[str, str] | None = None) -> None:
        if rospy.has_param("/stageros"):  # of the start before
            rospy.delete_param("/stageros")
        self._folder = tempfile.TemporaryDirectory()
        self.world = Path(self._folder.name) / "a.world"
        self.world.write_text(text)
        pixels = np.full((40, 40), 255, dtype=np.uint8)
        pixels[10:30, 10:30] = 0
        PIL.Image.fromarray(pixels).save(self.world.parent / "square.png")
        (program,) = roslib.packages.find_node("kurumaisu", "stageros")
        self.process = subprocess.Popen(
            [program, *arguments, f"_states:={self.world.parent}", str(self.world)],
            env={**os.environ, **(environment or {})},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def wait(self) -> tuple[int, str]:
        """Return exit code and what it said."""
        try:
            said, _ = self.process.communicate(timeout=PATIENCE)
        finally:
            self.process.kill()  # one that hangs must not go on after the test
            self._folder.cleanup()
        return self.process.returncode, said

    def stop(self) -> tuple[int, str]:
        self.process.send_signal(signal.SIGINT)
        return self.wait()


class Case(unittest.TestCase):
    """Tests of one world, which stands still but for step(); no test of these, only of what is made of it."""

    WORLD = ""
    ARGUMENTS: tuple[str, ...] = ("-g", "_headless_rate:=20")
    TOPICS: tuple[tuple[str, type], ...] = ()
    HAS_TF = True
    SLOW: tuple[str, ...] = ()  # topics that are not published in every step

    @classmethod
    def setUpClass(cls):
        cls.node = Stageros(cls.WORLD, *cls.ARGUMENTS)
        cls.clock = Topic("/clock", Clock)
        cls.tf = Topic("/tf", TFMessage)
        cls.topics = {name: Topic(name, kind) for name, kind in cls.TOPICS}
        cls.ask("pause", SetBool, True)
        cls.all_heard()

    @classmethod
    def tearDownClass(cls):
        for topic in (cls.clock, cls.tf, *cls.topics.values()):
            topic.close()
        code, said = cls.node.stop()
        assert code == 0, said
        assert "Traceback" not in said

    @staticmethod
    def ask(name, kind, *request):
        service = f"/stageros/{name}" if name != "reset_positions" else name
        rospy.wait_for_service(service, PATIENCE)
        return rospy.ServiceProxy(service, kind)(*request)

    @classmethod
    def all_heard(cls):
        """Step until every topic is connected."""

        def heard():
            cls.ask("step", Trigger)
            tf = (cls.tf,) if cls.HAS_TF else ()
            return all(topic.messages for topic in (cls.clock, *tf, *cls.topics.values()))

        wait_for(heard, "a message of every topic")

    def step(self, count=1):
        """Go on so many steps and wait for all that is published of them: of several topics, any may come last."""
        for _ in range(count):
            done = self.ask("step", Trigger)
            assert done.success, done.message
            now = float(done.message.split()[1])
            wait_for(lambda now=now: self.now() >= now - 1e-6, f"clock {now}")
        wait_for(lambda: all(self.stamp(t) == self.now() for t in self.stamped()), "every topic's message")
        if self.HAS_TF:
            robot = lambda: any(child.endswith("base_footprint") for _, child in self.transforms())  # noqa: E731
            wait_for(robot, "transforms of now")

    def now(self):
        return self.clock.last.clock.to_sec()

    def stamped(self):
        return [t for name, t in self.topics.items() if hasattr(t.last, "header") and name not in self.SLOW]

    @staticmethod
    def stamp(topic):
        return topic.last.header.stamp.to_sec()

    def drive(self, topic, v, w=0.0):
        """Send one command."""
        message = Twist()
        message.linear.x, message.angular.z = v, w
        self.send(topic, message)

    def send(self, topic, message):
        """Send one message, and wait until it has come."""
        publisher = rospy.Publisher(topic, type(message), queue_size=1)
        wait_for(lambda: publisher.get_num_connections(), f"a listener on {topic}")
        before = self.heard()
        publisher.publish(message)
        wait_for(lambda: self.heard() > before, f"the message on {topic}")
        publisher.unregister()

    def heard(self):
        """Return how many commands and poses the node has heard."""
        return int(re.search(r"(\d+) commands heard", self.ask("pause", SetBool, True).message)[1])

    def transforms(self):
        """Return the simulator's transforms of now, empty before they have come; the mapper is on the topic, too."""
        return {
            (t.header.frame_id, t.child_frame_id): t.transform
            for message in self.tf.messages
            if message._connection_header["callerid"] == "/stageros"
            for t in message.transforms
            if t.header.stamp.to_sec() == self.now()
        }

    def set_pose(self, name, x, y, heading):
        pose = geometry_msgs.msg.Pose()
        pose.position.x, pose.position.y, pose.orientation = x, y, quaternion_of(heading)
        return self.ask("set_pose", SetPose, name, pose)


def place(message):
    pose = message.pose.pose
    return pytest.approx((pose.position.x, pose.position.y, yaw_of(pose.orientation)), abs=1e-9)


def since(messages, time):
    """Return those stamped after a time [s]."""
    return [m for m in messages if m.header.stamp.to_sec() > time + STEP / 2]
