# SPDX-License-Identifier: BSD-3-Clause
"""The rangers of a world's robots."""
