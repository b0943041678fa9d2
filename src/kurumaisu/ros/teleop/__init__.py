# SPDX-License-Identifier: BSD-3-Clause
"""The nodes for driving by hand: joystick, teleop_joy and teleop_keyboard."""
