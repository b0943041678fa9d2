# SPDX-License-Identifier: BSD-3-Clause
"""sim_node: the simulated chair behind the chair's topics."""
