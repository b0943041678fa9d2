# SPDX-License-Identifier: BSD-3-Clause
"""What the equation of a cause may miss, as a part of the noise: no real lag has one pole.

A cause that acts adds a Gaussian process to the covariance: its signal times smooth functions of the rates, their
changes, the time, the time since a command, the way since a reversal and the heading, and what the same cause would do
with other sizes, as a soft corner or a second pole does. What its own sizes can do is left out of it, so that it moves
no size.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.base.drive import GRID, Drive
from kurumaisu.critic.engine.catalogue import Term, settings_of
from kurumaisu.critic.engine.covariance import without
from kurumaisu.critic.values.criticism import Settings
from kurumaisu.types import FloatArray

if TYPE_CHECKING:
    from kurumaisu.critic.engine.evidence import Problem

SHARES = (0.1, 0.2, 0.4)  # of a signal's norm that its equation may miss, 1 sd: one of these holds for all causes
_SIZES = (0.25, 0.5, 1.5, 2.0, 3.0)  # shares of a size whose signals stand for other forms
_KNOTS = 5  # of a smooth function
_CHANGE = 0.5  # [s] over which a change of the input is taken
_LONG = 3.0  # [s] after a change from which on it is long ago
_FAR = 1.0  # [m] after a reversal from which on it is far back
_BENT = 0.05  # share of a column that must be left of it where sizes have taken theirs, else it is no other form


def form_errors(problem: Problem, terms: Sequence[Term], values: FloatArray, own: FloatArray) -> dict[str, FloatArray]:
    """Return what each cause with these values may miss, whitened, (rows, k): with a share of 1 of its signal's norm.

    own (rows, n): an orthonormal basis of what the causes' sizes do.
    """
    names = [name for name in dict.fromkeys(term.id for term in terms) if not effects.by_id(name).choices]
    blocks: dict[str, FloatArray] = {}
    for name in names:
        whole = np.concatenate([_marks(problem, drive, terms, values, name) for drive in problem.drives])
        signal, marks = whole[:, 0], whole[:, 1:]
        before = np.linalg.norm(marks, axis=0)
        left = without(own, marks)
        after = np.linalg.norm(left, axis=0)
        sized = np.arange(len(before)) >= len(before) - _sized(terms, name)
        # Of what other sizes do, only the form counts, which is as large as a smooth function makes it.
        loud = np.where(sized, after > _BENT * before, after > 0)
        left = left[:, loud] / np.where(sized, np.maximum(after, 1e-12), 1.0)[loud]
        norm = float(np.linalg.norm(signal))
        if sized[loud].any():
            left[:, sized[loud]] *= norm / np.sqrt(sized[loud].sum())
        blocks[name] = left
    return blocks


def _sized(terms: Sequence[Term], name: str) -> int:
    return len(_SIZES) * sum(term.id == name and not term.fixed for term in terms)


def _marks(problem: Problem, drive: Drive, terms: Sequence[Term], values: FloatArray, name: str) -> FloatArray:
    """Return a cause's signal, whitened, with that times smooth functions, and with other sizes, (3 m, k)."""
    own = np.array([term.id == name and not term.shape for term in terms])
    null = np.array([term.null for term in terms])
    here = problem.simulated(drive, settings_of(terms, values))
    signal = here - problem.simulated(drive, settings_of(terms, np.where(own, null, values)))
    smooth = problem.smooth(drive)
    whole = [signal.reshape(-1, 1)]
    for axes in ((True, True, False), (False, False, True)):
        part = np.where(axes, signal, 0.0)
        whole.append((part[:, :, None] * smooth[:, None, :]).reshape(signal.size, -1))
    whole += [(problem.simulated(drive, other) - here).reshape(-1, 1) for other in _other_sizes(terms, values, name)]
    return problem.whitened(drive, np.concatenate(whole, axis=1))


def _other_sizes(terms: Sequence[Term], values: FloatArray, name: str) -> Iterator[Settings]:
    for i, term in enumerate(terms):
        for share in _SIZES if term.id == name and not term.fixed else ():
            value = term.null + share * (values[i] - term.null)
            value = float(np.clip(value, term.parameter.lower, term.parameter.upper))
            yield settings_of(terms, np.where(np.arange(len(values)) == i, value, values))


def smooth_functions(drive: Drive) -> FloatArray:
    """Return hats over what a form may depend on, per increment, (m, k); each row's squares sum to about 1."""
    edges = drive.start + GRID * np.arange(len(drive.v) + 1)
    since, until = drive.times[:-1], drive.times[1:]

    def mean(rate: FloatArray, before: float = 0.0) -> FloatArray:
        integral = np.concatenate([[0.0], np.cumsum(rate) * GRID])
        gained = np.interp(until - before, edges, integral) - np.interp(since - before, edges, integral)
        return np.asarray(gained / (until - since))

    v, w = mean(drive.v), mean(drive.w)
    changed = np.flatnonzero(np.append(True, (np.diff(drive.v) != 0) | (np.diff(drive.w) != 0)))
    at = np.clip(((since + until) / 2 - drive.start) / GRID, 0, len(drive.v) - 1).astype(int)
    last = changed[np.searchsorted(changed, at, side="right") - 1]
    reversed_ago = effects.Follower("since_reversal", 0.0).values(effects.Motion(GRID, drive.v, drive.w))
    quantities = [
        v,
        w,
        v - mean(drive.v, _CHANGE),
        w - mean(drive.w, _CHANGE),
        since - since[0],
        np.minimum((at - last) * GRID, _LONG),
        np.minimum(reversed_ago[at], _FAR),
    ]
    hats = [_hats(values) for values in quantities]
    heading = drive.poses[:-1, 2]
    hats.append(np.stack([np.cos(heading), np.sin(heading)], axis=1))
    return np.asarray(np.concatenate(hats, axis=1))


def _hats(values: FloatArray) -> FloatArray:
    low, high = np.quantile(values, [0.01, 0.99])
    at = np.clip((values - low) / max(high - low, 1e-9), 0.0, 1.0) * (_KNOTS - 1)
    return np.asarray(np.maximum(1 - np.abs(at[:, None] - np.arange(_KNOTS)), 0.0))
