# SPDX-License-Identifier: BSD-3-Clause
"""Scripted experiments: files of launch/experiments/, the same for the simulator, the chair and the planning."""

from kurumaisu.experiments.script import Box, Limits, Place, Script, base_limits, load_script, names, shipped_script
from kurumaisu.experiments.space import obstructed, reach
from kurumaisu.experiments.timeline import Phase, nominal_path, samples

__all__ = [
    "Box",
    "Limits",
    "Phase",
    "Place",
    "Script",
    "base_limits",
    "load_script",
    "names",
    "nominal_path",
    "obstructed",
    "reach",
    "samples",
    "shipped_script",
]
