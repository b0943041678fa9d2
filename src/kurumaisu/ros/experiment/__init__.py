# SPDX-License-Identifier: BSD-3-Clause
"""critic experiment: scripted experiments on the chair or the simulator."""
