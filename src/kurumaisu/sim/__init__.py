# SPDX-License-Identifier: BSD-3-Clause
"""The simulator, without ROS."""
