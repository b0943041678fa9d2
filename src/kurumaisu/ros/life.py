# SPDX-License-Identifier: BSD-3-Clause
"""How every node in Python begins and ends: it waits for a master, and ends in time, whatever it is doing."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import xmlrpc.client
from collections.abc import Callable

import rospy

from kurumaisu import program
from kurumaisu.errors import Error, failed, one_line
from kurumaisu.ros import master

_PATIENCE = 4.0  # [s] from a signal to the end, in order or not
_LAST_WORDS = 2.0  # [s] that topics stay open for a node that is to end
_CLOCK_PERIOD = 5.0  # [s]
_GLANCE = 0.3  # [s] between looks for a master
_SHELL = 128  # exit code of who ends by a signal, with its number added, as shells have it


class Life:
    """A node's life from its registration to its end.

    rospy's own handlers wait for locks that the thread they interrupt may hold, and its registration waits for the
    master without a limit. Here a signal is a byte in a pipe, which a thread waits for: no lock, whatever the main
    thread is doing, and if that does not end in time, the process does.
    """

    def __init__(self) -> None:
        """Take over the signals."""
        self.asked = threading.Event()  # to end, by a signal or by ROS
        self._done = threading.Event()
        self._signal: int | None = None
        reading, writing = os.pipe()
        os.set_blocking(writing, False)
        threading.Thread(target=self._obey, args=(reading,), daemon=True).start()
        signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:  # nohup
                signal.signal(number, lambda *_: None)

    @property
    def code(self) -> int:
        """Exit code of a node that was ended before it was done."""
        return 1 if self._signal is None else _SHELL + self._signal

    def begin(self, name: str, *, anonymous: bool, rostime: bool) -> bool:
        """Register with the master, as soon as there is one; return False when the node is to end instead."""
        if not self._wait_for_master(name):
            return False
        rospy.init_node(name, anonymous=anonymous, disable_rostime=not rostime, disable_signals=True)
        rospy.on_shutdown(self._hold)
        if rostime:
            threading.Thread(target=self._watch_clock, daemon=True).start()
        return not rospy.core.is_shutdown_requested()

    def end(self) -> None:
        """Sign off; the last thing that a node does."""
        self._done.set()
        if not rospy.core.is_initialized():
            return
        rospy.signal_shutdown("the end")
        deadline = time.monotonic() + _PATIENCE
        while not rospy.is_shutdown() and time.monotonic() < deadline:  # another thread may be at it
            time.sleep(0.01)

    def _obey(self, reading: int) -> None:
        self._signal = os.read(reading, 1)[0]
        self.asked.set()
        threading.Thread(target=rospy.signal_shutdown, args=("a signal",), daemon=True).start()
        time.sleep(_PATIENCE)
        os._exit(self.code)

    def _watch_clock(self) -> None:
        """Say why nothing goes on where a simulator that ended has left /use_sim_time behind."""
        while not self.asked.wait(_CLOCK_PERIOD) and not rospy.rostime.is_wallclock() and rospy.get_time() == 0:
            rospy.logerr(
                "CLOCK_SILENT: /use_sim_time is true, but nothing comes on /clock: time stands at 0. "
                "Start a simulator; or rosparam set /use_sim_time false, and start this again"
            )

    def _hold(self) -> None:
        """Keep the topics open for a moment: a node may want to say its last words."""
        self.asked.set()
        self._done.wait(_LAST_WORDS)

    def _wait_for_master(self, name: str) -> bool:
        said = False
        while not self.asked.is_set():
            try:
                master.ask("getPid")
                return True
            except (master.MasterMissingError, master.MasterSlowError) as error:
                if not said:
                    print(f"{name}: {error}", file=sys.stderr, flush=True)
                said = True
                if isinstance(error, master.MasterSlowError):
                    return True
            self.asked.wait(_GLANCE)
        return False


def run(name: str, node: Callable[[Life], int], *, anonymous: bool = False, rostime: bool = True) -> int:
    """Run a node until it returns its exit code, or is told to end; return 1 after an Error, which is logged.

    node: waits for life.asked where it waits. rostime: it hears /clock.
    """
    program.loaded()
    life = Life()
    try:
        return node(life) if life.begin(name, anonymous=anonymous, rostime=rostime) else life.code
    except Error as error:
        if not rospy.core.is_initialized():
            return failed(name, error)
        rospy.logfatal("%s", one_line(error))
        return 1
    except (OSError, rospy.ROSException, xmlrpc.client.Error):
        if not life.asked.is_set():
            raise
        return life.code  # a topic or a service closed under who was using it
    finally:
        life.end()
