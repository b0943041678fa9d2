# SPDX-License-Identifier: BSD-3-Clause
"""The simulator, without ROS: robots of a world file, the chair, its plant, and how both behave."""

from kurumaisu.sim.options import Options, load_options
from kurumaisu.sim.rangers.scans import Scan
from kurumaisu.sim.robots.observation import Observation
from kurumaisu.sim.robots.pool import SimulatorPool
from kurumaisu.sim.robots.simulator import Simulator

__all__ = ["Observation", "Options", "Scan", "Simulator", "SimulatorPool", "load_options"]
