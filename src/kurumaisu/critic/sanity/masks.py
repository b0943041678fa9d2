# SPDX-License-Identifier: BSD-3-Clause
"""Rows of a reference that are off for a moment: they are set aside, and the rest is judged.

Even a poor model says of the next moment how far the chair goes: what it gets wrong lasts, and does not come back.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import GRID, prepare
from kurumaisu.critic.sanity import imu_match
from kurumaisu.critic.sanity.pose_jumps import jumps
from kurumaisu.critic.sanity.rows import stale, stretches
from kurumaisu.critic.values.digits import moment, quantities
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.critic.values.robust import third_difference_sd
from kurumaisu.errors import Error
from kurumaisu.params import Model
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import BoolArray, FloatArray

_BACK = 5.0  # [s] within which a reference that was elsewhere is back
_SAME = 0.5  # share of its first jump that is left when it is back
_MOST = 0.05  # share of a run's rows that may be set aside
_FAR = 8.0  # sds of what a model leaves between two rows
_LONGEST = 1.0  # [s]
_RETURN = 0.4  # share of the way out, of which the way back may differ
_QUIET = 0.35  # the same, that another row near by may be off
_NEAR = 2  # rows
_GAP = 5.0  # usual intervals
# Of a normal vector's components, by the number of them, over the median of its norm.
_SD = {1: SIGMA_PER_MAD, 2: 0.8493}
TOPIC = "collision"  # a quantity that says so itself
_ASKED = np.array([0.1, 0.2])  # [m/s], [rad/s] from which a chair is asked to move
_STANDS = 0.15  # share of that below which it stands
_LATEST = 0.6  # [s] by which a chair may answer late
_BEFORE = 0.2  # [s] beyond that for which it must have been asked, in whichever axis
_NOISE = 3.0  # sds of such a rate by errors of the reference, that one which stands may seem to have
_MOST_SEEN = 0.5  # share of what it is asked for that it may seem to have by them
_WINDOW = 0.4  # [s] over which its rates are taken
_LEAST = 0.4  # [s] of standing, beyond the window
_LIKE = (0.7, 1.4)  # times what is asked for, of which it is known what the chair does elsewhere
_MOVES = 0.7  # share of that time in which it moves, at least
_MARGINS = (0.4, 1.0)  # [s] before and after, in which it is stopped, and gets going again


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
    spans = _elsewhere(pose, run.command)
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


_Spans = list[tuple[int, int, float]]  # first row, end and distance [m] of each stretch that is off


def _elsewhere(pose: Series, command: Series | None) -> _Spans:
    """Return what is off, however it jumps about meanwhile: what leaves fewest jumps, and then most rows.

    A jump may end what lasts for longer, or be what a single row does.
    """
    lasting, single = jumps(pose, 1.0, command)
    jumped = sorted({*lasting, *single})
    step = _beyond_motion(pose, jumped)
    alone = [(row, row + 1, float(np.hypot(*step[row - 1]))) for row in _singles(pose, jumped)]
    ways = []
    known: _Spans
    for known in ([], alone) if alone else ([],):
        rest = [i for i in jumped if i not in _ends(known)]
        found = [*known, *_returns(pose, rest, set(single), step)]
        found += _next_to_gaps(pose, [i for i in jumped if i not in _ends(found)])
        left = len(set(jumped) - _ends(found))
        ways.append((left, sum(end - first for first, end, _ in found), sorted(found)))
    return min(ways)[2]


def _ends(spans: _Spans) -> set[int]:
    return {row for first, end, _ in spans for row in (first, end)}


def _singles(pose: Series, jumped: Sequence[int]) -> list[int]:
    """Return the rows that jump away alone, and back with the next."""
    out: list[int] = []
    for i in jumped:
        if i + 1 in jumped and i - 1 not in out and _alone(pose, i):
            out.append(i)
    return out


def _returns(pose: Series, jumped: Sequence[int], single: set[int], step: FloatArray) -> _Spans:
    """Return the stretches from a jump to the one that brings it back; step (n - 1, 2) [m]: beyond the motion."""
    found: _Spans = []
    away, last = 0, 0  # rows at which it left, and jumped last
    off, far = np.zeros(2), 0.0  # how far it is off, and was at most
    for i in jumped:
        if away in single and last == away and i > away + 1 and _alone(pose, away):
            found.append((away, away + 1, far))  # its way back was no jump
            away = 0
        if not away or pose.t[i] - pose.t[away] >= _BACK:
            away, off, far = i, np.zeros(2), 0.0
        off, last = off + step[i - 1], i
        far = max(far, float(np.hypot(*off)))
        if np.hypot(*off) < _SAME * np.hypot(*step[away - 1]):
            found.append((away, i, far))
            away = 0
    if away in single and last == away and away + 1 < len(pose.t) and _alone(pose, away):
        found.append((away, away + 1, far))
    return found


def _next_to_gaps(pose: Series, jumped: Sequence[int]) -> Iterator[tuple[int, int, float]]:
    """Yield the same of the few rows between a jump and a gap, or an end: where it came from, or went to, is hidden."""
    lasts = np.diff(pose.t)
    gaps = [0, *(np.flatnonzero(lasts > _GAP * np.median(lasts)) + 1).tolist(), len(pose.t)]
    for i in jumped:
        far = float(np.hypot(*(pose.values[i, :2] - pose.values[i - 1, :2])))
        yield from ((min(i, gap), max(i, gap), far) for gap in gaps if 0 < abs(gap - i) <= _NEAR)


def _beyond_motion(pose: Series, jumped: Sequence[int]) -> FloatArray:
    """Return by how much each row (n - 1, 2) [m] is off the one before, beyond what the rows about jumps move."""
    step, lasts = np.diff(pose.values[:, :2], axis=0), np.diff(pose.t)[:, np.newaxis]
    quiet = np.setdiff1d(np.arange(1, len(pose.t)), jumped)
    if not len(quiet):
        return step
    rates = (step / lasts)[quiet - 1]
    return np.asarray(step - lasts * np.column_stack([np.interp(pose.t[1:], pose.t[quiet], one) for one in rates.T]))


def _alone(pose: Series, row: int) -> bool:
    """Tell whether the row after one that jumped is back where it jumped from."""
    jump, left = pose.values[row : row + 2, :2] - pose.values[row - 1, :2]
    return bool(np.hypot(*left) < _SAME * np.hypot(*jump))


def _told(name: str, pose: Series, spans: _Spans, off: BoolArray) -> str:
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
        between = np.r_[max(i - _NEAR, 0) : i, i + 1 : j, j + 1 : min(j + _NEAR + 1, len(size))]
        back = np.linalg.norm(left[i] + left[i + 1 : j + 1].sum(axis=0)) < _RETURN * size[i]
        if back and times[j + 1] - times[i] < _LONGEST and (size[between] < _QUIET * size[i]).all():
            found.append((int(i) + 1, int(j) + 1))
    return found


def contacts(run: Run, model: Model) -> tuple[tuple[float, float], ...]:
    """Return the spans of time [s] in which the chair was held, by a quantity that says so, else by its motion."""
    spans = _said(run.covariates[TOPIC]) if TOPIC in run.covariates else _seen(run, model)
    return _merged([(a - _MARGINS[0], b + _MARGINS[1]) for a, b in spans])


def _said(series: Series) -> Iterator[tuple[float, float]]:
    """Yield the spans in which a quantity is not 0; each value holds until the next."""
    ends = np.append(series.t[1:], series.t[-1])
    for a, b in zip(*stretches(series.values[:, 0] != 0), strict=True):
        yield float(series.t[a]), float(ends[b - 1])


def _seen(run: Run, model: Model) -> Iterator[tuple[float, float]]:
    if run.pose is None or run.pose_source != "measured":
        return
    try:
        drive = prepare(run, model)
    except Error:
        return
    t = drive.start + GRID * np.arange(len(drive.v))
    after = np.clip(np.searchsorted(run.pose.t, t), 1, len(run.pose.t) - 1)
    inside = (t > drive.times[0] + _WINDOW) & (t < drive.times[-1] - _WINDOW)
    inside &= run.pose.t[after] - run.pose.t[after - 1] < _WINDOW  # nobody knows what is within a gap
    asked = np.column_stack([drive.v, drive.w])
    ends = (geometry.interpolate(run.pose.t, run.pose.values[:, :3], t + by) for by in (-_WINDOW / 2, _WINDOW / 2))
    driven = np.abs(geometry.between(*ends)[:, [0, 2]] / _WINDOW)
    late = _BEFORE + _answer(np.abs(asked[inside]), driven[inside])
    wanted = _held((np.abs(asked) > _ASKED).any(axis=1), round(late / GRID))
    small = np.maximum(_STANDS * np.abs(asked), _STANDS * _ASKED)
    sds = third_difference_sd(run.pose.values[:, :3]) if len(run.pose.t) > 3 else np.zeros(3)
    sds = np.sqrt(2) / _WINDOW * np.array([max(sds[:2]), sds[2]])  # of rates, by errors that differ from row to row
    small = np.minimum(np.hypot(small, _NOISE * sds), np.maximum(_MOST_SEEN * _ASKED, small))
    stands = inside & wanted & (driven < small).all(axis=1)
    for a, b in zip(*stretches(stands), strict=True):
        if (b - a) * GRID >= _LEAST and _is_odd(asked[a:b], asked, wanted, stands):
            yield float(t[a]), float(t[b - 1])


def _is_odd(here: FloatArray, asked: FloatArray, wanted: BoolArray, stands: BoolArray) -> bool:
    """Tell whether the chair moves elsewhere when about the same is asked for."""
    size = np.maximum(np.median(np.abs(here), axis=0), _ASKED)
    as_much = (np.abs(asked) < _LIKE[1] * size).all(axis=1)
    alike = wanted & as_much & (np.abs(asked) > _LIKE[0] * size).any(axis=1)
    return bool(alike.any() and 1 - stands[alike].mean() >= _MOVES)


def _answer(asked: FloatArray, driven: FloatArray) -> float:
    """Return by how much [s] what is driven (n, 2) is behind what is asked, where they are most alike."""
    one, other = (np.linalg.norm(rates / _ASKED, axis=1) for rates in (asked, driven))
    shifts = [k for k in range(round(_LATEST / GRID) + 1) if k < len(one) - 1]
    alike = [one[: len(one) - k] @ other[k:] / max(float(np.linalg.norm(one[: len(one) - k])), 1e-9) for k in shifts]
    return GRID * shifts[int(np.argmax(alike))] if shifts else _LATEST


def _held(flags: BoolArray, count: int) -> BoolArray:
    """Return where flags (n,) have held for so many samples."""
    sums = np.concatenate([[0], np.cumsum(flags)])
    out = np.zeros_like(flags)
    out[count - 1 :] = sums[count:] - sums[:-count] == count
    return out


def _merged(spans: list[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    out: list[tuple[float, float]] = []
    for a, b in sorted(spans):
        if out and a <= out[-1][1]:
            out[-1] = out[-1][0], max(out[-1][1], b)
        else:
            out.append((a, b))
    return tuple(out)
