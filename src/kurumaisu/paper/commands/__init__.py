# SPDX-License-Identifier: BSD-3-Clause
"""The commands of scripts/paper and scripts/calibrate that need no ROS."""
