# SPDX-License-Identifier: BSD-3-Clause
"""Which models there are at a time; a world's at first, then others come and go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.errors import Error
from kurumaisu.geometry import attached, relative
from kurumaisu.names import hint
from kurumaisu.types import FloatArray, IntArray
from kurumaisu.world.layout import family
from kurumaisu.world.model import Model


@dataclass(frozen=True)
class Population:
    """Models in depth-first order with the poses (n, 4) in the map where they began.

    keys (n,): number that a model keeps for life; born (n,): step in which it came.
    """

    models: tuple[Model, ...]
    poses: FloatArray
    keys: IntArray
    born: IntArray

    @classmethod
    def first(cls, models: Sequence[Model], poses: FloatArray) -> Population:
        """Return the models of a world."""
        count = len(models)
        return cls(tuple(models), np.array(poses).reshape(-1, 4), np.arange(count), np.zeros(count, dtype=np.int64))

    def index(self, model: str | int | Model) -> int:
        """Return the place of a model given by name, `#` and key, place or itself.

        Raise Error if there is none, or several.
        """
        if isinstance(model, str):
            found = [m.index for m in self.models if m.name == model]
            if not found and model[:1] == "#" and model[1:].isdecimal():
                found = np.flatnonzero(self.keys == int(model[1:])).tolist()
        else:
            number = model.index if isinstance(model, Model) else model
            found = [number] if 0 <= number < len(self.models) else []
            model = f"number {number}"
        if len(found) != 1:
            near = "" if found else f"; {hint(str(model), [m.name for m in self.models if m.name])}"
            raise Error(f"model {model}: there {'are several' if found else 'is none'} of this name{near}")
        return found[0]

    def with_descendants(self, index: int) -> IntArray:
        """Return the places of a model and of all that stand on it."""
        return np.array(family(self.models, index), dtype=np.int64)

    def moved(self, index: int, pose: FloatArray) -> Population:
        """Return a population in which a model, with all on it, began at a pose (4,)."""
        those = self.with_descendants(index)
        poses = self.poses.copy()
        poses[those] = attached(pose, relative(self.poses[index], self.poses[those]))
        models = list(self.models)
        if (parent := models[index].parent) >= 0:
            top = models[parent].size[2] if models[parent].stack_children else 0.0
            on_parent = relative(poses[parent], pose) - np.array([0.0, 0.0, top, 0.0])
            models[index] = replace(models[index], pose=on_parent)
        return replace(self, models=tuple(models), poses=poses)

    def joined(self, models: Sequence[Model], poses: FloatArray, step: int) -> Population:
        """Return a population with one more tree of models, parents before children, poses (k, 4) in the map."""
        offset, count = len(self.models), len(models)
        shift = {-1: -1} | {model.index: offset + i for i, model in enumerate(models)}
        if any(model.parent not in shift for model in models) or sum(model.parent < 0 for model in models) != 1:
            raise Error(f"{models[0].place if models else 'spawn'}: must be one model with all that stands on it")
        new = [replace(m, index=shift[m.index], parent=shift[m.parent], root=offset) for m in models]
        fresh = int(self.keys.max(initial=-1)) + 1
        return Population(
            models=(*self.models, *new),
            poses=np.concatenate([self.poses, poses]),
            keys=np.concatenate([self.keys, fresh + np.arange(count)]),
            born=np.concatenate([self.born, np.full(count, step)]),
        )

    def without(self, index: int) -> Population:
        """Return a population without a model and all that stand on it."""
        stay = np.setdiff1d(np.arange(len(self.models)), self.with_descendants(index))
        shift = {-1: -1} | {int(old): new for new, old in enumerate(stay)}
        kept = [self.models[i] for i in stay]
        return Population(
            models=tuple(replace(m, index=shift[m.index], parent=shift[m.parent], root=shift[m.root]) for m in kept),
            poses=self.poses[stay],
            keys=self.keys[stay],
            born=self.born[stay],
        )
