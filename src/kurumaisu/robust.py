# SPDX-License-Identifier: BSD-3-Clause
"""Spreads that outliers do not move."""

SIGMA_PER_MAD = 1.4826  # standard deviation of a normal distribution over its median absolute deviation
