# SPDX-License-Identifier: BSD-3-Clause
"""A process for test_base_master.py: repeats the command of its last line of input, prints every change of voltages."""

from __future__ import annotations

import sys
import threading

import rospy
from kurumaisu.msg import Voltages

from kurumaisu.ros.testing import Commander

lock, last = threading.Lock(), [(float("nan"), float("nan"))]


def tell(message: Voltages) -> None:
    rates = (message.v, message.w)
    with lock:
        if rates != last[0]:
            last[0] = rates
            print(*rates, flush=True)


rospy.init_node("peer", anonymous=True, disable_signals=True)
commander = Commander("cmd_vel")
rospy.Subscriber("voltages", Voltages, tell, queue_size=None, tcp_nodelay=True)
for line in sys.stdin:
    commander.say(*map(float, line.split()))
