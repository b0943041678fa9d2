# SPDX-License-Identifier: BSD-3-Clause
"""viewer_node: what the viewer's server shows of a simulation or a robot behind ROS."""
