# SPDX-License-Identifier: BSD-3-Clause
"""Data that contradict themselves: what goes wrong between a robot and a folder of tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.types import FloatArray

Change = Callable[[Run, np.random.Generator], Run]


@dataclass(frozen=True)
class Wrong:
    """A mistake: what it does to a run, the words of which one must be in what is said, the ids that say the same."""

    change: Change
    words: tuple[str, ...]
    also: tuple[str, ...] = ()
    laser: bool = False


def _values(part: str, change: Callable[[FloatArray], FloatArray]) -> Change:
    def act(run: Run, rng: np.random.Generator) -> Run:
        series: Series | None = getattr(run, part)
        return run if series is None else replace(run, **{part: replace(series, values=change(series.values))})  # type: ignore[arg-type]

    return act


def _times(part: str, change: Callable[[FloatArray, np.random.Generator], FloatArray]) -> Change:
    def act(run: Run, rng: np.random.Generator) -> Run:
        series: Series | None = getattr(run, part)
        return run if series is None else replace(run, **{part: replace(series, t=change(series.t, rng))})  # type: ignore[arg-type]

    return act


def _both(first: Change, second: Change) -> Change:
    return lambda run, rng: second(first(run, rng), rng)


def _times_columns(*factors: float) -> Callable[[FloatArray], FloatArray]:
    return lambda values: values * np.array(factors)


def _wheels_swapped(run: Run, rng: np.random.Generator) -> Run:
    """V_s of a chair whose wheels' wires are exchanged: it turns the other way."""
    assert run.pose is not None
    return replace(run, pose=replace(run.pose, values=_mirrored(run.pose.values)))


def _mirrored(poses: FloatArray) -> FloatArray:
    """Return the path reflected about the line on which it starts."""
    x0, y0, heading = poses[0]
    c, s = np.cos(heading), np.sin(heading)
    along, across = c * (poses[:, 0] - x0) + s * (poses[:, 1] - y0), -s * (poses[:, 0] - x0) + c * (poses[:, 1] - y0)
    x, y = x0 + c * along + s * across, y0 + s * along - c * across
    return np.column_stack([x, y, 2 * heading - poses[:, 2]])


def _rows_twice(run: Run, rng: np.random.Generator) -> Run:
    """A tenth of the reference's rows given again 5 ms later with a little of what came in between: a stuck buffer."""
    assert run.pose is not None
    t, values = run.pose.t, run.pose.values
    again = np.sort(rng.choice(len(t) - 1, len(t) // 10, replace=False))
    times = np.concatenate([t, t[again] + 0.4 * np.diff(t)[again]])
    order = np.argsort(times, kind="stable")
    return replace(run, pose=replace(run.pose, t=times[order], values=np.concatenate([values, values[again]])[order]))


def _rows_shuffled(run: Run, rng: np.random.Generator) -> Run:
    """Blocks of one second of the reference's poses in the wrong order, under times that increase."""
    assert run.pose is not None
    size = max(round(1.0 / float(np.median(np.diff(run.pose.t)))), 1)
    blocks = [run.pose.values[i : i + size] for i in range(0, len(run.pose.t), size)]
    order = np.arange(len(blocks))
    for i in rng.choice(len(blocks) - 2, len(blocks) // 4, replace=False):
        order[[i, i + 1]] = order[[i + 1, i]]
    return replace(run, pose=replace(run.pose, values=np.concatenate([blocks[i] for i in order])[: len(run.pose.t)]))


def _fan_off(run: Run, rng: np.random.Generator) -> Run:
    """All readings one beam on, as by a fan that was said to begin a step earlier."""
    return _values("scan", lambda values: np.concatenate([values[:, 1:], values[:, -1:]], axis=1))(run, rng)


WRONG: dict[str, Wrong] = {
    "pose in millimetres": Wrong(_values("pose", _times_columns(1000, 1000, 1)), ("millimet", "unit", "1000")),
    "heading in degrees": Wrong(_values("pose", _times_columns(1, 1, 180 / np.pi)), ("degree", "radian")),
    "commands in degrees": Wrong(
        _both(_values("command", _times_columns(1, 180 / np.pi)), _values("voltage", lambda v: v)), ("degree", "radian")
    ),
    "x and y swapped": Wrong(_values("pose", lambda p: p[:, [1, 0, 2]]), ("swap", "axes", "exchang")),
    "x reversed": Wrong(_values("pose", _times_columns(-1, 1, 1)), ("sign", "revers", "mirror")),
    "heading reversed": Wrong(_values("pose", _times_columns(1, 1, -1)), ("sign", "revers", "mirror"), ("base.sign",)),
    "wheels swapped": Wrong(_wheels_swapped, ("wheel", "sign", "mirror", "turn"), ("base.sign",)),
    "voltages swapped": Wrong(_values("voltage", lambda v: v[:, ::-1]), ("swap", "exchang"), ("base.sign",)),
    "clock shifted": Wrong(_times("pose", lambda t, _: t + 3.0), ("clock", "shift", "late", "time")),
    "clock skewed": Wrong(_times("pose", lambda t, _: t * 1.05), ("clock", "time"), ("base.clock_scale",)),
    "rows twice": Wrong(_rows_twice, ("twice", "duplicate", "repeat", "same")),
    "rows out of order": Wrong(_rows_shuffled, ("order", "jump", "time")),
    "ranges in millimetres": Wrong(_values("scan", lambda r: r * 1000), ("millimet", "unit", "1000"), laser=True),
    "scan mirrored": Wrong(_values("scan", lambda r: r[:, ::-1]), ("mirror", "revers"), laser=True),
    "fan off by a step": Wrong(_fan_off, ("fan", "step", "angle", "beam"), ("laser.mount_yaw",), laser=True),
    "wrong map": Wrong(lambda run, _: run, ("map", "world"), laser=True),
}


def spoilt(recording: Recording, name: str, rng: np.random.Generator) -> Recording:
    """Return the recording with a mistake in all of its runs; a wrong map is the caller's to write."""
    return replace(recording, runs=tuple(WRONG[name].change(run, rng) for run in recording.runs))
