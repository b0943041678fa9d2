# SPDX-License-Identifier: BSD-3-Clause
"""Which models a body touches; the arena itself says only whether it touches any."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kurumaisu._core import Arena
from kurumaisu.sim.motion.partition import outline
from kurumaisu.sim.robots.machinery import Machinery
from kurumaisu.world.model import Model


def touched(machinery: Machinery, body: int) -> Iterator[Model]:
    """Yield the solid models that a body, by its row, touches where it is; one by one, so this takes a while."""
    models, poses, map_frame = machinery.population.models, machinery.model_poses(), np.zeros(4)
    own = outline(models, poses, np.flatnonzero(machinery.bodies.body_of == body), map_frame)
    root = models[machinery.bodies.heads[body]].root
    for model in models:
        if model.root == root or not model.obstacle_return:
            continue
        its = outline(models, poses, np.array([model.index]), map_frame)
        arena = Arena(its.faces, its.returns, its.solid, its.trees, 1)
        number = np.array([arena.add_body(own.faces, own.returns, own.solid, root)])
        arena.set_poses(number, np.zeros((1, 4)))
        if arena.touches(number)[0]:
            yield model
