# SPDX-License-Identifier: BSD-3-Clause
"""The other programs: calibrate, critic, map, replay_odometry, odom_to_tf, waypoint_node."""
