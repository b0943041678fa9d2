# SPDX-License-Identifier: BSD-3-Clause
"""Autonomous electric wheelchair: simulator, SLAM and the critic of its own simulation."""
