# SPDX-License-Identifier: BSD-3-Clause
"""The simulated chair: voltages in, poses and scans out."""

from kurumaisu.sim.chair.data import Command, Observation
from kurumaisu.sim.chair.simulator import NEUTRAL, ChairSimulator

__all__ = ["NEUTRAL", "ChairSimulator", "Command", "Observation"]
