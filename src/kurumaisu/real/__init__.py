# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of other people's robots: what the critic says of them, next to what a line of algebra says."""
