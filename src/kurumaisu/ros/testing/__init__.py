# SPDX-License-Identifier: BSD-3-Clause
"""For tests and benchmarks of nodes: topics waited for, a room that is scanned, commands to base_node."""
