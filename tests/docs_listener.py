#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Listens for test_docs.py: commands on standard input, an answer in JSON for each on standard output."""

import json
import math
import sys
import threading
import time
from itertools import pairwise

import rospy
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Log
from std_msgs.msg import Bool


class Ear:
    """What is heard, by the name of the question."""

    def __init__(self) -> None:
        self._errors: list[str] = []
        rospy.Subscriber("/rosout", Log, self._log, queue_size=None)

    def _log(self, message: Log) -> None:
        if message.level >= Log.ERROR:
            self._errors.append(f"{message.name}: {message.msg}")

    def topic(self, name: str, patience: str) -> bool:
        """Tell whether a message comes on a topic within so many seconds; TOPIC@NODE: from a node of that name."""
        came = threading.Event()
        name, _, node = name.partition("@")

        def hear(message: rospy.AnyMsg) -> None:
            if node in message._connection_header["callerid"]:
                came.set()

        subscriber = rospy.Subscriber(name, rospy.AnyMsg, hear)
        heard = came.wait(float(patience))
        subscriber.unregister()
        return heard

    def errors(self) -> list[str]:
        """Return what nodes logged as an error since the last question."""
        told, self._errors[:] = list(self._errors), []
        return told

    def drive(self, seconds: str, patience: str) -> dict[str, float]:
        """Watch the simulated chair for so long, by its own clock: how far it gets and turns, and whether it hits."""
        poses: list[Odometry] = []
        hits: list[bool] = []
        kinds = (("/ground_truth", Odometry, poses.append), ("/collision", Bool, lambda m: hits.append(m.data)))
        heard = [rospy.Subscriber(name, kind, act, queue_size=None) for name, kind, act in kinds]
        deadline = time.monotonic() + float(patience)

        def passed() -> float:
            stamps = [pose.header.stamp.to_sec() for pose in (*poses[:1], *poses[-1:])]
            return stamps[-1] - stamps[0] if stamps else 0.0

        while passed() < float(seconds) and time.monotonic() < deadline:
            time.sleep(0.05)
        for subscriber in heard:
            subscriber.unregister()
        places = [(p.pose.pose.position.x, p.pose.pose.position.y) for p in poses]
        turns = [2 * math.atan2(p.pose.pose.orientation.z, p.pose.pose.orientation.w) for p in poses]
        return {
            "seconds": passed(),
            "way": sum(math.dist(a, b) for a, b in pairwise(places)),
            "turn": sum(abs(math.remainder(b - a, math.tau)) for a, b in pairwise(turns)),
            "hits": float(sum(hits)),
        }


def main() -> None:
    rospy.init_node("docs_listener", anonymous=True, disable_signals=True)
    ear = Ear()
    print("ready", flush=True)
    for line in sys.stdin:
        name, *arguments = line.split()
        print(json.dumps(getattr(ear, name)(*arguments)), flush=True)


if __name__ == "__main__":
    main()
