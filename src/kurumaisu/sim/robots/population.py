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

_MOST_GONE = 100  # deleted trees that can come back


@dataclass(frozen=True)
class Population:
    """Models, parents before children, with the poses (n, 4) in the map where they began.

    keys (n,): number that a model keeps for life; born (n,): step in which it came; home: models that the world file
    has; fresh: key of the next newcomer; gone: trees that were deleted, oldest first, which may come back.
    """

    models: tuple[Model, ...]
    poses: FloatArray
    keys: IntArray
    born: IntArray
    home: int
    fresh: int
    gone: tuple[Gone, ...] = ()

    @classmethod
    def first(cls, models: Sequence[Model], poses: FloatArray) -> Population:
        """Return the models of a world."""
        count = len(models)
        born = np.zeros(count, dtype=np.int64)
        return cls(tuple(models), np.array(poses).reshape(-1, 4), np.arange(count), born, home=count, fresh=count)

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
        numbers = {model.index for model in models}
        if sum(m.parent < 0 for m in models) != 1 or any(m.parent not in numbers | {-1} for m in models):
            raise Error(f"{models[0].place if models else 'spawn'}: must be one model with all that stands on it")
        keys = self.fresh + np.arange(len(models))
        return replace(self._with(models, poses, keys, -1, step), fresh=self.fresh + len(models))

    def without(self, index: int, now: FloatArray) -> Population:
        """Return a population without a model and all that stand on it, which may come back to where they are now.

        now (n, 4): poses in the map of all models.
        """
        family = self.with_descendants(index)
        stay = np.setdiff1d(np.arange(len(self.models)), family)
        shift = {-1: -1} | {int(old): new for new, old in enumerate(stay)}
        kept = [self.models[i] for i in stay]
        parent = self.models[index].parent
        gone = Gone(
            models=tuple(self.models[i] for i in family),
            poses=now[family],
            keys=self.keys[family],
            on=int(self.keys[parent]) if parent >= 0 else -1,
        )
        return replace(
            self,
            models=tuple(replace(m, index=shift[m.index], parent=shift[m.parent], root=shift[m.root]) for m in kept),
            poses=self.poses[stay],
            keys=self.keys[stay],
            born=self.born[stay],
            gone=(*self.gone, gone)[-_MOST_GONE:],
        )

    def restored(self, name: str, step: int) -> Population:
        """Return a population with a deleted tree, given by `#` and key or by name, where it was when it was deleted.

        Raise Error if there is none, or no room for its name, or if it stood on a model that is not there.
        """
        found = [i for i, gone in enumerate(self.gone) if name in (f"#{gone.keys[0]}", gone.models[0].name)]
        if not found:
            raise Error(f"model {name}: was not deleted, or is one of more than {_MOST_GONE}")
        gone = self.gone[found[-1]]
        taken = {model.name for model in self.models if model.name} & {model.name for model in gone.models}
        if taken:
            raise Error(f"name {min(map(str, taken))!r}: there is a model of this name")
        ground = np.flatnonzero(self.keys == gone.on).tolist() if gone.on >= 0 else [-1]
        if not ground:
            raise Error(f"model {name}: stood on model #{gone.on}, which is not there")
        rest = (*self.gone[: found[-1]], *self.gone[found[-1] + 1 :])
        return replace(self._with(gone.models, gone.poses, gone.keys, ground[0], step), gone=rest)

    def _with(self, models: Sequence[Model], poses: FloatArray, keys: IntArray, on: int, step: int) -> Population:
        """Return a population with one more tree, whose first model stands on another's place, -1: on the ground."""
        offset = len(self.models)
        shift = {model.index: offset + i for i, model in enumerate(models)}
        root = offset if on < 0 else self.models[on].root
        new = [replace(m, index=shift[m.index], parent=shift.get(m.parent, on), root=root) for m in models]
        return replace(
            self,
            models=(*self.models, *new),
            poses=np.concatenate([self.poses, poses]),
            keys=np.concatenate([self.keys, keys]),
            born=np.concatenate([self.born, np.full(len(models), step)]),
        )


@dataclass(frozen=True)
class Gone:
    """A tree that was deleted, as it was: poses (k, 4) in the map; on: key of what it stood on, -1: the ground."""

    models: tuple[Model, ...]
    poses: FloatArray
    keys: IntArray
    on: int
