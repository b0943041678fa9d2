# SPDX-License-Identifier: BSD-3-Clause
"""How readings err at random: beams, neighbours, whole scans and the poses they were taken from (scan_noise.py)."""
