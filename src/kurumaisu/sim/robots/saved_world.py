# SPDX-License-Identifier: BSD-3-Clause
"""A simulated world as a world file, which says what there is now, and where."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu.errors import Error
from kurumaisu.types import FloatArray
from kurumaisu.whole_files import write_whole
from kurumaisu.world import load_world
from kurumaisu.world.model import Model
from kurumaisu.world.writing import Setting, written

_OFF = 1e-9  # [m], and share of a turn that a file's digits may be off


@dataclass(frozen=True)
class Scene:
    """What there is at a moment: models, parents before children, and their poses (n, 4) in the map."""

    setting: Setting
    models: Sequence[Model]
    poses: FloatArray


def world_file(scene: Scene) -> str:
    """Return the text of a file of a scene, which was read once as a check. Raise Error if that is another scene."""
    text = written(scene.setting, scene.models, scene.poses)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "saved.world"
        write_whole({path: text})
        read = load_world(path, image_extents=scene.setting.image_extents)
    there = {m.name: pose for m, pose in zip(scene.models, scene.poses, strict=True) if m.name}
    for model, pose in zip(read.models, read.poses, strict=True):
        known = there.pop(model.name, pose) if model.name else pose
        if not np.allclose(_flat(known), _flat(pose), rtol=_OFF, atol=_OFF):
            raise Error(f"save_world: {model.name} would be read at {pose.tolist()}, but is at {known.tolist()}")
    if there or len(read.models) != len(scene.models):
        raise Error(f"save_world: {len(read.models)} of {len(scene.models)} models would be read")
    return text


def _flat(pose: FloatArray) -> FloatArray:
    """Return a pose (4,) as numbers that do not jump at half a turn."""
    return np.array([*pose[:3], np.cos(pose[3]), np.sin(pose[3])])
