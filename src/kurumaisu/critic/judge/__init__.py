# SPDX-License-Identifier: BSD-3-Clause
"""Here a probability becomes a word: findings of drives and scans become one verdict and the story of the report."""
