# SPDX-License-Identifier: BSD-3-Clause
"""The topics `~world` and `~view` of sim_node and stageros: what the viewer draws of a simulation."""
