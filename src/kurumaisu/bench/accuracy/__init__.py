# SPDX-License-Identifier: BSD-3-Clause
"""How right the simulator, odometry and stamps are."""
