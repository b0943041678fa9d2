# SPDX-License-Identifier: BSD-3-Clause
"""The paper's wall on the simulator: a laser on a bench before a board 1 m wide, at five distances."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml

from kurumaisu import settings
from kurumaisu.critic.values.recording import Recording
from kurumaisu.experiments import Place, Script
from kurumaisu.experiments.script import Box
from kurumaisu.paper import drawing
from kurumaisu.paper.model_file import ModelFile
from kurumaisu.paper.options import Wall
from kurumaisu.params import load_model, shipped
from kurumaisu.riddles import lab
from kurumaisu.types import FloatArray
from kurumaisu.world import load_world

# A chassis no larger than the laser: it stands 0.2 m before the board, and turns where the laser is.
_WORLD = "board.world"
_SMALL = {"length": "0.06", "width": "0.06", "axle_to_front": "0.03"}


def write_model(model: Path, options: Wall, out: Path) -> None:
    """Write the bench's model: the model's laser alone, its gate where the sensor's is. Raise Error naming the file."""
    file = ModelFile(model)
    for name, value in _SMALL.items():
        file.replace(("chassis", name), value)
    for name in ("x", "y", "yaw"):
        file.replace(("laser", "mount", name), "0.0")
    file.replace(("laser", "error", "range_max"), f"{options.gate:g}")
    file.head(["A bench of docs/paper.md: the laser of a model, and nothing else of it. Its gate is the sensor's."])
    file.write(out)
    load_model(out)


def script(options: Wall) -> Script:
    """Return the experiment: to stand before the board at each distance for so many scans."""
    places = tuple(Place(np.array([lab.WALL - d, 0.0, 0.0]), 0.1 * options.scans + 0.15) for d in options.distances)
    near, far = min(options.distances), max(options.distances)
    return Script("wall", "equation (4)", _WORLD, Box(lab.WALL - near, far - lab.WALL, 0.1, 0.1), None, (), places)


def write_script(options: Wall, out: Path) -> None:
    """Write it as a file for `critic experiment`. Raise Error naming the file."""
    made = script(options)
    rows = [
        {"x": float(place.pose[0]), "y": 0.0, "yaw": 0.0, "seconds": float(round(place.seconds, 3))}
        for place in made.places
    ]
    text = {
        "kind": "places",
        "good_for": made.good_for,
        "world": made.world,
        "box": {name: float(value) for name, value in vars(made.box).items()},
        "places": rows,
    }
    drawing.write(out, yaml.safe_dump(text, sort_keys=False))


def walls() -> FloatArray:
    """Return the simulated board's outline (m, 4), x and y of both ends [m], seen from the middle of its face."""
    return load_world(shipped(f"worlds/{_WORLD}")).segments - [lab.WALL, 0.0, lab.WALL, 0.0]


def simulated(bench: Path, options: Wall, seed: int) -> Recording:
    """Return scans of the board on the simulator alone, a run for each distance, in their order."""
    model = load_model(bench)
    return lab.measured(model, script(options), model.laser, seed)


def resolution(model: Path) -> float:
    """Return what the readings of a model's laser are multiples of [m]. Raise Error naming file and key."""
    error = settings.load(model).section("laser").section("error")
    return error.number("resolution", at_least=0)
