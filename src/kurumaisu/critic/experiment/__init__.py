# SPDX-License-Identifier: BSD-3-Clause
"""What to drive next: scripted experiments, rehearsed on the simulator and weighed by what they would tell."""
