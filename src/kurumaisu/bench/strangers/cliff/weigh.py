# SPDX-License-Identifier: BSD-3-Clause
"""How large the hidden causes are: z, and what is left beside every other effect."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from .hidden import BASE, REFERENCE, UNKNOWN, tops, variants
from .record import EXTRA_MEAN, EXTRA_SCATTER, Draft, gate, ideal, scans_of, seen
from .room import other_map
from .scanner import CAST, MEANS, SCATTER, Scans, information, spread, steady
from .values import Array, Cause
from .whiten import Filter, deviations, left_beside

FIT = range(3)


def is_base(c: Cause) -> bool:
    """True of what shows in the poses."""
    return c.id.startswith("base.") or c.id in UNKNOWN or c.id in REFERENCE


def is_scatter(c: Cause) -> bool:
    """True of what shows in the spread of the readings."""
    return c.id in SCATTER or c.id in EXTRA_SCATTER


class BaseScale:
    """Weighs signals in the poses of the runs to fit."""

    def __init__(self, draft: Draft) -> None:
        self.draft = draft
        self.null = []
        for k in FIT:
            s, path = ideal(draft, k, [])
            self.null.append((s, path, seen(path, s, draft.rows[k], [])))
        self.filters = [self._filter(k) for k in FIT]
        last = self.filters[-1].after[-1]
        both = last[:3, :3] + last[3:6, 3:6] + last[:3, 3:6] + last[3:6, :3]
        self.pose_var = np.maximum(0.5 * np.diag(both), 1e-8)
        self.groups: dict[str, list[int]] = {}
        listed: list[Cause] = []
        for name in BASE:
            group = variants(name, tops(draft.runs[:3]))
            self.groups[name] = list(range(len(listed), len(listed) + len(group)))
            listed += group
        self.listed = listed

    @cached_property
    def catalogue(self) -> Array:
        """Whitened signals of all effects, one column for each variant."""
        return self.weigh([([c], []) for c in self.listed])

    def _filter(self, k: int) -> Filter:
        """About the model's path."""
        draft, (s, path, _) = self.draft, self.null[k]
        return Filter(
            draft.rows[k], lambda t: seen(path, s, t, []), lambda t: gate(draft, s, t), draft.noise, draft.jitter
        )

    def weigh(self, pairs: list[tuple[list[Cause], list[Cause]]]) -> Array:
        """Whitened signals, one column for each pair: with less without."""
        out = []
        for k in FIT:
            s, path, model = self.null[k]
            t = self.draft.rows[k]
            have = []
            for pair in pairs:
                for causes in pair:
                    a, p = ideal(self.draft, k, causes) if causes else (s, path)
                    have.append(seen(p, a, t, causes))
            y = deviations(have, model)
            white, _ = self.filters[k].run(y[:, :, 0::2] - y[:, :, 1::2])
            out.append(white.reshape(-1, white.shape[2]))
        return np.concatenate(out)

    def measure(self, causes: list[Cause], all_causes: list[Cause]) -> Array:
        """The whitened signal of each cause, all others acting, beside the catalogue's: S' C^-1 S."""
        pairs = [(all_causes, [o for o in all_causes if o is not c]) for c in causes]
        every = np.hstack([self.weigh(pairs), self.catalogue])
        return np.asarray(every.T @ every)


class LaserScale:
    """Weighs signals in the readings of the runs to fit."""

    def __init__(self, draft: Draft, pose_var: Array, causes: list[Cause]) -> None:
        self.draft, self.pose_var = draft, pose_var
        base = [c for c in causes if is_base(c)]
        self.paths = [ideal(draft, k, base) for k in FIT]
        self.scans = [scans_of(draft, k, *self.paths[k], []) for k in FIT]
        self.ok = [steady(s) for s in self.scans]
        self.groups: dict[str, list[int]] = {}
        self.listed: list[Cause] = []
        for name in MEANS:
            group = variants(name, (1.0, 1.0))
            self.groups[name] = list(range(len(self.listed), len(self.listed) + len(group)))
            self.listed += group
        n = len(self.listed)
        self.groups["world.map_error"] = [n, n + 1]
        self.fixed = [self._catalogue(s, ok) for s, ok in zip(self.scans, self.ok, strict=True)]

    def _catalogue(self, s: Scans, ok: Array) -> Array:
        """Signals of all effects in the mean; the map's: shifted boxes, and a scale."""
        columns = [MEANS[c.id][0](s, c.size, c) for c in self.listed]
        h, boxes = s.slopes(), self.draft.room.boxes
        moved = other_map(self.draft.room, 0.001, np.zeros(len(boxes)))
        a = boxes[:, 2]
        each = h[..., 0] * -np.sin(a)[s.extra["box"]] + h[..., 1] * np.cos(a)[s.extra["box"]]
        columns.append(-each * (0.003 * np.random.default_rng(1).standard_normal(len(boxes)))[s.extra["box"]])
        d = (moved.boxes - boxes)[:, :2][s.extra["box"]]
        columns.append(-(h[..., 0] * d[..., 0] + h[..., 1] * d[..., 1]))
        return np.where(ok[:, :, None], np.stack(columns, axis=2), 0.0)

    def _hidden(self, k: int, c: Cause) -> Array:
        s, ok = self.scans[k], self.ok[k]
        if c.id in CAST:
            moved = scans_of(self.draft, k, *self.paths[k], [c])
            with np.errstate(invalid="ignore"):
                d = moved.r - s.r
            return np.where(ok & (moved.side == s.side), d, 0.0)
        read = MEANS[c.id][0] if c.id in MEANS else EXTRA_MEAN[c.id]
        with np.errstate(invalid="ignore"):
            return np.where(ok, read(s, c.size, c), 0.0)

    def measure(self, causes: list[Cause]) -> Array:
        """S' C^-1 S of the causes' signals in the mean, beside the catalogue's."""
        total = np.zeros((0, 0))
        for k in FIT:
            own = np.stack([self._hidden(k, c) for c in causes], axis=2)
            every = np.concatenate([own, self.fixed[k]], axis=2)
            part = information(self.scans[k], every, self.draft.noise, self.pose_var, self.ok[k])
            total = part if not total.size else total + part
        return total

    def scatter(self, causes: list[Cause]) -> tuple[Array, dict[str, list[int]]]:
        """The same for the spread: Fisher's information, (ln q)^2 / 2 per reading of variance ratio q."""
        listed = [
            *causes,
            *(Cause(n, 0.05) for n in ("laser.range_noise", "laser.incidence_noise", "laser.beam_correlation")),
        ]
        columns = []
        for s, ok in zip(self.scans, self.ok, strict=True):
            column = [np.log(spread(s, [c], EXTRA_SCATTER)[ok]) * np.sqrt(2.0) for c in listed]
            columns.append(np.array(column))
        signals = np.concatenate(columns, axis=1)
        gram = signals @ signals.T
        for i, c in enumerate(listed):  # correlation: rho^2 per reading, beside nothing
            if c.id == "laser.beam_correlation":
                gram[i, :], gram[:, i] = 0.0, 0.0
                gram[i, i] = signals.shape[1] * c.size**2
        return gram, {"laser.range_noise": [0], "laser.incidence_noise": [1], "laser.beam_correlation": [2]}


def beside(gram: Array, causes: list[Cause], groups: dict[str, list[int]], shift: int) -> list[dict[str, float]]:
    """What is left of each cause beside each other effect, and beside each other cause."""
    out = []
    for i, c in enumerate(causes):
        left = {}
        for name, group in groups.items():
            if name != c.id:
                left[name] = left_beside(gram, i, [shift + j for j in group])
        for j, o in enumerate(causes):
            if j != i:
                left[o.id] = min(left.get(o.id, np.inf), left_beside(gram, i, [j]))
        out.append(left)
    return out
