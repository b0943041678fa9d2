# SPDX-License-Identifier: BSD-3-Clause
"""How readings and whole scans err at random: beams, neighbours, scans, and the poses they were taken from."""
