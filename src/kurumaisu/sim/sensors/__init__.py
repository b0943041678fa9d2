# SPDX-License-Identifier: BSD-3-Clause
"""The sensors: each gets what it needs as arguments and knows nothing of the simulator."""
