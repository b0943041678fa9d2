# SPDX-License-Identifier: BSD-3-Clause
"""The simulator, without ROS."""

from kurumaisu.sim.observation import Observation
from kurumaisu.sim.options import Options, load_options
from kurumaisu.sim.pool import SimulatorPool
from kurumaisu.sim.scans import Scan
from kurumaisu.sim.simulator import Simulator

__all__ = ["Observation", "Options", "Scan", "Simulator", "SimulatorPool", "load_options"]
