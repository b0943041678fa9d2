# SPDX-License-Identifier: BSD-3-Clause
"""Faults 1 to 17 of the base: master, commander, base_node, guard and a virtual D/A board."""
