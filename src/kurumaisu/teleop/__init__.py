# SPDX-License-Identifier: BSD-3-Clause
"""Driving by hand, with a dead-man: a joystick or keys to commands. No ROS; time is an argument."""

from kurumaisu.teleop.command import ALLOW, REST, HandCommand

__all__ = ["ALLOW", "REST", "HandCommand"]
