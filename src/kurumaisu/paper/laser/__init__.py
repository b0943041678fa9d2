# SPDX-License-Identifier: BSD-3-Clause
"""Figures 7 to 9, 11 and 12, equation (4): from scans of a wall to the law of the laser."""
