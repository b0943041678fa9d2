# SPDX-License-Identifier: BSD-3-Clause
"""The simulator of a world file: its robots as arrays, step by step."""
