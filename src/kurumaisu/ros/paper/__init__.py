# SPDX-License-Identifier: BSD-3-Clause
"""The command paper, and the experiments of the paper that need ROS."""
