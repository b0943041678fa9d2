# SPDX-License-Identifier: BSD-3-Clause
"""What the drives say of a robot's wheels, as the numbers that ROS's diff_drive_controller takes.

The controller turns its wheels by (v ± w b s / 2) / (r m): b, r are the track and the radius that it was told, s and m
multipliers of the track and of each side's radius. A robot whose steady rates are G times those that it is asked for
has G_vv = (m_l + m_r) / 2, G_ww = G_vv / s and G_wv = (m_r - m_l) / (b s).

They are fitted whether or not they differ from 1 enough for a cause to be named, beside what was found, if that is
needed; of that, what leaves rates in proportion counts as theirs, too. A criticism says them in words, and of which
robot it is.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import GRID, Drive
from kurumaisu.critic.base.replay import robot_said
from kurumaisu.critic.engine.catalogue import settings_of
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.experiment import design
from kurumaisu.critic.judge.turning_only import SCALE_SD, with_limits
from kurumaisu.critic.values.criticism import Criticism
from kurumaisu.critic.values.digits import quantities, with_interval
from kurumaisu.critic.values.recording import Recording
from kurumaisu.critic.values.verdict import NORMAL90, Estimate, Multipliers, RobotTaken
from kurumaisu.experiments import Phase, samples
from kurumaisu.params import EffectSetting, Model, Robot
from kurumaisu.types import FloatArray

_HELD = 20.0  # [s] after which rates that were asked for are steady
_TRIED = np.array([[0.3, 0.0], [0.0, 0.5], [-0.3, 0.0], [0.0, -0.5], [0.03, 0.0], [0.0, 0.05]])  # [m/s], [rad/s]
_SAME = 1e-3  # [m/s], [rad/s] by which steady rates may be out of proportion
_MOST = 5.0  # a multiplier beyond is none: an axis is reversed, or in another unit
# UMBmark (Borenstein and Feng 1996): a square of 4 m, slowly, cornering on the spot, in both directions
_SIDE, _SPEED, _TURN, _REST = 4.0, 0.2, np.radians(40.0), 2.0
_CHAIR = re.compile(r"\b(a|the|The) chair\b")
_UNITY = 1.0e-3  # by which wheels must differ before either side has a multiplier of its own


@dataclass(frozen=True)
class _Controller:
    """Multipliers of the separation, of the left and of the right radius, and the track [m] that it was told."""

    values: FloatArray
    track: float

    def asked(self, rates: FloatArray) -> FloatArray:
        """Return what a base without multipliers makes of the wheels' rates for v and w, all (n, 2)."""
        separation, left, right = self.values
        turn = rates[:, 1] * self.track * separation / 2
        sides = (rates[:, 0] - turn) / left, (rates[:, 0] + turn) / right
        return np.stack([(sides[1] + sides[0]) / 2, (sides[1] - sides[0]) / self.track], axis=1)


def measured(problem: Problem, best: Fit, *, turning: bool = False) -> Multipliers | None:
    """Return the multipliers that the drives of a problem ask for; best: what was found in them.

    turning: only how the robot turned was measured: both radii are right on the mean, as far as anybody knows,
    and the scale of the imu is not known quite.
    None for a robot of which no track is known, or where the drives cannot show one of them.
    """
    model, track = problem.model, problem.model.robot.track
    wheels = {each.id for each in effects.BASE if each.of_wheels and not (turning and each.shows_in is effects.Rate.V)}
    own = [each for each in problem.candidates if each.id in wheels]
    if track is None or {each.id for each in own} != wheels:
        return None
    others = [each for each in best.candidates if each.id not in wheels]
    # What is out of proportion may stand for what a gain explains as well, where one speed alone was driven.
    kept = [each for each in others if _in_proportion(model, [s for s in best.settings if s.id == each.id])]
    fits = [problem.fit_candidates([*some, *own], best.start) for some in (kept, others)[: 1 + (kept != others)]]
    fit = max(fits, key=lambda one: one.score)
    ids = {s.id for s in fit.settings if s.id in wheels or _in_proportion(model, [s])}
    values = _values(model, fit.values, fit, ids)
    if values is None:
        return None
    spread = _spread(problem, fit, values, ids)
    spread[0, 0] += (SCALE_SD * values[0]) ** 2 if turning else 0.0
    variances = np.append(np.diag(spread), [spread[1:, 1:].sum() / 4, spread[0, 0] * track**2])
    sds = np.sqrt(np.maximum(variances, 0.0))  # but for rounding
    means = [*values, (values[1] + values[2]) / 2, values[0] * track]
    separation, left, right, radius, apart = (
        Estimate(float(mean), float(mean - NORMAL90 * sd), float(mean + NORMAL90 * sd), unit)
        for mean, sd, unit in zip(means, sds, ("1", "1", "1", "1", "m"), strict=True)
    )
    none = _Controller(np.ones(3), track)
    before = max(np.linalg.norm(end) for end in _square(model, fit.settings, none))
    after = _square_within(model, fit.settings, _Controller(values, track), spread)
    return Multipliers(separation, radius, left, right, apart, float(before), after)


def _in_proportion(model: Model, settings: Sequence[EffectSetting]) -> bool:
    """Tell whether, with these effects, steady rates are in proportion to those asked for."""
    steady = _steady(model, settings)
    return bool(np.abs(steady - _TRIED @ _gains(steady).T).max() < _SAME)


def _gains(steady: FloatArray) -> FloatArray:
    """Return the matrix (2, 2) from rates asked for to steady rates (n, 2)."""
    return np.stack([steady[0] / _TRIED[0, 0], steady[1] / _TRIED[1, 1]], axis=1)


def _steady(model: Model, settings: Sequence[EffectSetting]) -> FloatArray:
    """Return the rates (n, 2) of v [m/s] and w [rad/s] that come of those that are tried, when they were held."""
    moved = [replay.motion(_drive(np.tile(r, (round(_HELD / GRID), 1))), model, settings) for r in _TRIED]
    return np.array([[one.v[-1], one.w[-1]] for one in moved])


def _values(model: Model, parameters: FloatArray, fit: Fit, ids: Collection[str]) -> FloatArray | None:
    """Return the multipliers (3,) for a fit with these parameters, of effects of these ids; None for nonsense."""
    gains = _gains(_steady(model, [setting for setting in settings_of(fit.terms, parameters) if setting.id in ids]))
    track = model.robot.track
    assert track is not None
    if not all(1 / _MOST < gain < _MOST for gain in (gains[0, 0], gains[1, 1])):
        return None
    separation = gains[0, 0] / gains[1, 1]
    apart = gains[1, 0] * track * separation / 2
    return np.array([separation, gains[0, 0] - apart, gains[0, 0] + apart])


def _spread(problem: Problem, fit: Fit, values: FloatArray, ids: Collection[str]) -> FloatArray:
    """Return the covariance (3, 3) of the multipliers."""
    free = [i for i, term in enumerate(fit.terms) if not term.fixed]
    slopes = []
    for i in free:
        step = fit.terms[i].step * fit.terms[i].parameter.scale
        parameters = fit.values + np.where(np.arange(len(fit.terms)) == i, 0.01 * step, 0.0)
        moved = _values(problem.model, parameters, fit, ids)
        slopes.append(((values if moved is None else moved) - values) / 0.01)
    return np.asarray(np.array(slopes).T @ design.doubt(problem, fit.terms, fit.values) @ np.array(slopes))


def _square_within(
    model: Model, settings: Sequence[EffectSetting], controller: _Controller, spread: FloatArray
) -> float:
    """Return how far from its start [m] a square ends, rms over what the multipliers may be; the worse direction."""
    nominal = _square(model, settings, controller)
    squares = (nominal**2).sum(axis=1)
    for way in np.linalg.cholesky(spread + 1e-15 * np.eye(3)).T:
        moved = _square(model, settings, _Controller(controller.values + way, controller.track))
        squares = squares + ((moved - nominal) ** 2).sum(axis=1)
    return float(np.sqrt(squares.max()))


def _square(model: Model, settings: Sequence[EffectSetting], controller: _Controller) -> FloatArray:
    """Return where a robot ends its square from its start [m], anticlockwise and clockwise, (2, 2), without noise."""
    ends = []
    speed, turn = np.minimum((_SPEED, _TURN), model.robot.fastest or np.inf)
    for side in (1.0, -1.0):
        corner = [
            Phase(_SIDE / speed, (speed, 0.0), 0.0),
            Phase(_REST, (0.0, 0.0), 0.0),
            Phase(np.pi / 2 / turn, (0.0, side * turn), 0.0),
            Phase(_REST, (0.0, 0.0), 0.0),
        ]
        asked = controller.asked(samples(4 * corner, GRID)[:, 1:])
        ends.append(replay.odometry(_drive(asked), model, settings)[1][-1, :2])
    return np.array(ends)


def _drive(rates: FloatArray) -> Drive:
    """Return a drive that asks for rates (n, 2) on the grid, from (0, 0, 0)."""
    ends = np.array([0.0, GRID * len(rates)])
    return Drive("", "command", 0.0, rates[:, 0], rates[:, 1], ends, np.zeros((2, 3)))


def with_robot(criticism: Criticism, recording: Recording) -> Criticism:
    """Return the criticism with the robot that it is of: what was assumed, what to paste, and what to call it.

    Of one that was only seen to turn, without what nobody measured.
    """
    robot = criticism.model.robot
    verdict, story = criticism.verdict, criticism.story
    found = None if verdict.robot is None else verdict.robot.multipliers
    taken = RobotTaken(robot.kind, not robot_said(recording, criticism.model), found)
    details = [_worded(one, robot) for one in story.details]
    if taken.assumed and verdict.verdict != "invalid_data" and not all(run.voltage for run in recording.runs):
        why = "nothing was asked of it that its voltages cannot say" if robot.voltages else "it was asked for more"
        what = f"{robot.name}, as {why}" if robot.voltages else f'"{robot.name}", as {why} than an MD-100 can do'
        details.append(f"The robot was taken for {what}; `robot:` in meta.yaml, or --robot, says which it is.")
    if found is not None:
        details.append(_in_words(found, robot, turning=recording.turning))
    told = replace(
        story,
        headline=_worded(story.headline, robot),
        details=tuple(details),
        unexplained=tuple(_worded(one, robot) for one in story.unexplained),
        provenance={**story.provenance, "robot": f"{robot.kind}{', assumed' if taken.assumed else ''}"},
        paste=_paste(found, turning=recording.turning) if found is not None else "",
    )
    return with_limits(replace(criticism, verdict=replace(verdict, robot=taken), story=told), recording)


def _worded(sentence: str, robot: Robot) -> str:
    return _CHAIR.sub(rf"\1 {robot.noun}", sentence)


def _in_words(found: Multipliers, robot: Robot, *, turning: bool) -> str:
    e = found.apparent_track
    track = f"as if its wheels were {with_interval(e.estimate, e.lo90, e.hi90, e.unit)} apart"
    before, after = quantities([found.square_before, found.square_after], "m")
    square = f"UMBmark's square of 4 m ends {before} from its start"
    if found.square_after < found.square_before:
        square += f"; with the multipliers for its controller, {after}, their uncertainty included"
    else:
        square += "; these drives know of no multipliers that would surely close it better"
    skids = "skids, and " if robot.skids else ""
    radius = ", if their radius is right, which turning alone does not tell" if turning else ""
    return f"It {skids}turns {track}{radius}; its software has {robot.track:g} m. {square}."


def _paste(found: Multipliers, *, turning: bool) -> str:
    """Return lines for the controller's YAML file; nothing where they would be no better.

    turning: nobody knows what the radii of both wheels are on the mean.
    """
    if found.square_after >= found.square_before:
        return ""
    rows = [("wheel_separation_multiplier", found.wheel_separation_multiplier)]
    left, right = found.left_wheel_radius_multiplier, found.right_wheel_radius_multiplier
    if abs(left.estimate - right.estimate) < _UNITY:
        rows += [] if turning else [("wheel_radius_multiplier", found.wheel_radius_multiplier)]
    else:
        rows += [("left_wheel_radius_multiplier", left), ("right_wheel_radius_multiplier", right)]
    lines = [f"{name}: {e.estimate:.4f}  # 90 %: {e.lo90:.4f} to {e.hi90:.4f}" for name, e in rows]
    if len(rows) > 2 and not turning:
        e = found.wheel_radius_multiplier
        lines.append(f"# wheel_radius_multiplier: {e.estimate:.4f}  # instead of left and right, which it overrides")
    return "\n".join(lines)
