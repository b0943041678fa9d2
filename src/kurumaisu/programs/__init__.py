# SPDX-License-Identifier: BSD-3-Clause
"""Programs that need no ROS: kurumaisu PROGRAM, and critic, of which two parts need it."""
