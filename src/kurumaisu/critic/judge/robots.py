# SPDX-License-Identifier: BSD-3-Clause
"""Of which robot a criticism is: said, in its words, and with the numbers that its software takes."""

from __future__ import annotations

import re
from dataclasses import replace

from kurumaisu.critic.base.replay import robot_said
from kurumaisu.critic.imu.turning_only import with_limits
from kurumaisu.critic.values.criticism import Criticism
from kurumaisu.critic.values.digits import quantities, with_interval
from kurumaisu.critic.values.recording import Recording
from kurumaisu.critic.values.verdict import Multipliers, RobotTaken
from kurumaisu.params import Robot

_CHAIR = re.compile(r"\b(a|the|The) chair\b")
_UNITY = 1.0e-3  # by which wheels must differ before either side has a multiplier of its own


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
        details.append(_assumption(robot))
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


def _assumption(robot: Robot) -> str:
    why = "nothing was asked of it that its voltages cannot say" if robot.voltages else "it was asked for more"
    what = f"{robot.name}, as {why}" if robot.voltages else f'"{robot.name}", as {why} than an MD-100 can do'
    return f"The robot was taken for {what}; `robot:` in meta.yaml, or --robot, says which it is."


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
