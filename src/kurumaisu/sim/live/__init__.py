# SPDX-License-Identifier: BSD-3-Clause
"""Running a simulation that people look at: its pace, and what they ask of it between two steps."""
