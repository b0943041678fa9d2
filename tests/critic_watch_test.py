#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""critic watch hears a chair drive: what is hidden in it appears on /diagnostics, and nothing else does."""

import itertools
import re
import sys
import time
import unittest

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from kurumaisu.ros.testing.nodes import Commander, Topic, wait_for

# v [m/s], w [rad/s]: spins and arcs at several rates, and back again, so that the chair stays where there is room.
MOVES = [(0.0, 1.2), (0.3, 0.0), (0.0, -0.6), (0.0, -1.2), (0.3, 0.0), (0.0, 0.6), (0.2, 0.9), (0.2, -0.9)]
DRIVEN = 40.0  # [s] of simulated time


def values(status):
    return {item.key: item.value for item in status.values}


def right(status, hidden):
    """Tell whether a status says what is hidden; of a hundred windows three may say something else."""
    told = values(status)
    if hidden == "none":
        return told["verdict"] == "none" and status.level == DiagnosticStatus.OK
    named = told["verdict"] == "named" and status.level == DiagnosticStatus.WARN
    return named and re.fullmatch(rospy.get_param("/told"), told["causes"]) is not None


class CriticWatch(unittest.TestCase):
    def test_the_verdict_on_a_chair_that_drives(self):
        hidden = rospy.get_param("/hidden")
        diagnostics = Topic("/diagnostics", DiagnosticArray)

        def status():
            found = [s for m in diagnostics.messages for s in m.status if s.name == "critic: verdict"]
            return found[-1] if found else None

        wait_for(status, "a first message, before anything can be judged")
        assert status().level == DiagnosticStatus.WARN
        commander = Commander("cmd_vel")
        commander.release()
        moves = itertools.cycle(MOVES)

        def drive_a_window():
            start = rospy.get_time()
            done = None  # criticisms when there was a whole window to judge; the one under way may have begun before
            deadline = time.monotonic() + 300.0  # two others of its kind run beside it; less than its time-limit
            while done is None or int(values(status())["criticisms"]) < done + 2:
                assert time.monotonic() < deadline, f"no verdict: {status()}"
                v, w = next(moves)
                commander.say(rospy.get_param("/forward") * v, w)
                until = rospy.get_time() + 2.0
                wait_for(lambda until=until: rospy.get_time() >= until, "the clock to run")
                if done is None and until - start > DRIVEN:
                    done = int(values(status())["criticisms"])

        drive_a_window()
        if not right(status(), hidden):
            rospy.logwarn(f"judged again, by another window: {status()}")
            drive_a_window()
        assert right(status(), hidden), status()
        told = values(status())
        assert told["/battery"] == "never heard"
        assert re.match(r"\d+\.\d Hz", told["/scan"]), status()
        commander.close()


if __name__ == "__main__":
    import rostest

    rospy.init_node("critic_watch_test")
    rostest.rosrun("kurumaisu", "critic_watch_test", CriticWatch, sys.argv)
