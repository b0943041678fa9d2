# SPDX-License-Identifier: BSD-3-Clause
"""Rows of a reference that are off for a moment: they are set aside, and the rest is judged.

Even a poor model says of the next moment how far the chair goes: what it gets wrong lasts, and does not come back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.sanity import imu_match
from kurumaisu.critic.sanity.contacts import TOPIC, contacts
from kurumaisu.critic.sanity.displaced_rows import NEAR, Spans, displaced_rows
from kurumaisu.critic.sanity.pose_jumps import asked
from kurumaisu.critic.sanity.rows import stale
from kurumaisu.critic.values.digits import moment, quantities
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.errors import Error
from kurumaisu.params import Model
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import BoolArray, FloatArray

_MOST = 0.05  # share of a run's rows that may be set aside
_FAR = 8.0  # sds of what a model leaves between two rows
_LONGEST = 1.0  # [s]
_RETURN = 0.4  # share of the way out, of which the way back may differ
_QUIET = 0.35  # the same, that another row near by may be off
# Of a normal vector's components, by the number of them, over the median of its norm.
_SD = {1: SIGMA_PER_MAD, 2: 0.8493}


def set_aside(recording: Recording, model: Model) -> Recording:
    """Return a recording without what tells nothing of the chair, with notes of that.

    That are rows of its references that are off for a moment, and times in which the chair was held.
    """
    runs, notes = [], []
    for run in recording.runs:
        kept, words = _masked(run, model)
        held = contacts(kept, model)
        turned, odd = imu_match.odd(kept)
        others = {name: series for name, series in kept.covariates.items() if name != TOPIC}
        runs.append(replace(kept, aside=(*kept.aside, *held, *turned), covariates=others))
        notes += [*words, *([_told_contacts(kept, held)] if held else []), *([odd] if odd else [])]
    return replace(recording, runs=tuple(runs), problems=(*recording.problems, *notes))


def _told_contacts(run: Run, spans: Sequence[tuple[float, float]]) -> str:
    """Return in words when and where a chair was held."""
    (first, end), *more = spans
    place = ""
    if run.pose is not None and len(run.pose.t):
        x, y = (float(np.interp(first, run.pose.t, run.pose.values[:, i])) for i in range(2))
        place = f", at x {x:.2f}, y {y:.2f} m"
    others = f", and {len(more)} times more" if more else ""
    seconds = sum(b - a for a, b in spans)
    return (
        f"{run.name}: the chair is held from t = {moment(first)} to {moment(end)}{place}{others}: a contact? "
        f"{seconds:.1f} s set aside"
    )


def _masked(run: Run, model: Model) -> tuple[Run, list[str]]:
    if run.pose is None or run.pose_source != "measured":
        return run, []
    pose, words = _fresh(run.name, run.pose)
    run = replace(run, pose=pose)
    spans = displaced_rows(pose, asked(run, model))
    off = np.zeros(len(pose.t), dtype=np.bool_)
    for first, end, _ in spans:
        off[first:end] = True
    if off.mean() > _MOST:
        return run, words
    if spans:
        words.append(_told(run.name, pose, spans, off))
    kept = replace(run, pose=pose.rows(~off)) if spans else run
    assert kept.pose is not None
    brief = brief_errors(kept, model)
    if not brief.any() or brief.mean() > _MOST:
        return kept, words
    begun = moment(float(kept.pose.t[int(np.argmax(brief))]))
    more = f"{run.name}: the reference is off for a moment at t = {begun}: {_rows(brief)}"
    return replace(kept, pose=kept.pose.rows(~brief)), [*words, more]


def _fresh(name: str, pose: Series) -> tuple[Series, list[str]]:
    """Return a reference without rows that are older than they say, if these are few, and words for them."""
    old = stale(pose)
    if not old.any() or old.mean() > _MOST:
        return pose, []
    begun = moment(float(pose.t[int(np.argmax(old))]))
    return pose.rows(~old), [f"{name}: the reference repeats itself while the robot moves at t = {begun}: {_rows(old)}"]


def _told(name: str, pose: Series, spans: Spans, off: BoolArray) -> str:
    first, end, far = spans[0]
    where = (
        f"t = {moment(float(pose.t[first]))} to {moment(float(pose.t[end - 1]))}"
        if end > first + 1
        else f"t = {moment(float(pose.t[first]))}"
    )
    more = f", and {len(spans) - 1} more" if len(spans) > 1 else ""
    return f"{name}: the reference is {quantities([far], 'm')[0]} off at {where}{more}: {_rows(off)}"


def _rows(off: BoolArray) -> str:
    return f"{int(off.sum())} of its {len(off)} rows set aside ({100 * off.mean():.2g} %)"


def brief_errors(run: Run, model: Model) -> BoolArray:
    """Return which rows of a run's reference are off for a moment, (n,)."""
    assert run.pose is not None
    off = np.zeros(len(run.pose.t), dtype=np.bool_)
    try:
        drive = prepare(run, model, interval=1e-9)
    except Error:
        return off
    left = drive.in_map(drive.measured - replay.increments(drive, model, ()))
    rows = np.zeros(len(drive.times), dtype=np.bool_)
    for part in (left[:, :2], left[:, 2:]):
        for first, end in _excursions(part, drive.times):
            rows[first:end] = True
    off[np.searchsorted(run.pose.t, drive.times[rows])] = True
    return off


def _excursions(left: FloatArray, times: FloatArray) -> list[tuple[int, int]]:
    """Return first row and end of each excursion, by what is left of increments (m, k) between rows at times (m + 1,).

    A chair that is late is off throughout the time that it is, and a row that is off only in its first step and last.
    """
    size = np.linalg.norm(left, axis=1)
    limit = _FAR * _SD[left.shape[1]] * float(np.median(size)) if len(size) else 0.0
    found = []
    loud = np.flatnonzero(size > max(limit, 1e-6))
    for i, j in pairwise(loud):
        between = np.r_[max(i - NEAR, 0) : i, i + 1 : j, j + 1 : min(j + NEAR + 1, len(size))]
        back = np.linalg.norm(left[i] + left[i + 1 : j + 1].sum(axis=0)) < _RETURN * size[i]
        if back and times[j + 1] - times[i] < _LONGEST and (size[between] < _QUIET * size[i]).all():
            found.append((int(i) + 1, int(j) + 1))
    return found
