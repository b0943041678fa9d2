# SPDX-License-Identifier: BSD-3-Clause
"""What must not be told of drives of which nothing but the turning was measured: where they went, and how fast."""

from __future__ import annotations

from dataclasses import replace

from kurumaisu import effects
from kurumaisu.critic.values.criticism import Criticism
from kurumaisu.critic.values.recording import Recording
from kurumaisu.params import EffectSetting

_TURNS = "dtheta"  # the channel of a gain that was measured
_LENGTHS = ("m", "m/s")
_UNSEEN = ("sd_v",)  # parameters of noise that was not measured
_SCALE = 0.03  # share by which the scale of a gyro may be off
SCALE_SD = _SCALE / 2
EXPLAINED = -1.0  # no share
_LIMITS = {
    True: "How the robot turned was measured by the imu, whose own scale may be off by {:.0%}; how far it drove, by "
    "its odometry. This recording cannot tell how far its wheels slip: a reference of its pose does.",
    False: "Only how the robot turned was measured, by the imu, whose own scale may be off by {:.0%}. This recording "
    "cannot tell how far it drives or slips, and effects on its speed were not looked for: a reference of its pose "
    "tells them.",
}  # by whether anything says where it was


def with_limits(criticism: Criticism, recording: Recording) -> Criticism:
    """Return a criticism without figures of what was not measured, and with what such a recording cannot tell."""
    verdict, story = criticism.verdict, criticism.story
    if not recording.turning or verdict.verdict == "invalid_data":
        return criticism
    story = replace(story, details=(_LIMITS[recording.placed].format(_SCALE), *story.details))
    if recording.placed:
        return replace(criticism, story=story)
    gain = verdict.gain
    if gain is not None:
        channels = {name: each for name, each in gain.channels.items() if name == _TURNS}
        verdict = replace(verdict, gain=replace(gain, rmse={}, channels=channels))
    story = replace(
        story,
        noise=tuple(each for each in story.noise if each.unit not in _LENGTHS),
        overlays=(),
    )
    settings = tuple(_seen(setting) for setting in criticism.settings)
    return replace(criticism, verdict=verdict, story=story, settings=settings)


def beyond_imu(shares: dict[str, float]) -> dict[str, float]:
    """Return by which share each effect turns the robot, by its id; EXPLAINED where that may be the scale of a gyro."""
    follows = [each for each in effects.BASE if each.follows is effects.Follows.W]
    like_scale = {each.id for each in follows if each.shows_in is effects.Rate.W}
    return {name: EXPLAINED if name in like_scale and share < _SCALE else share for name, share in shares.items()}


def _seen(setting: EffectSetting) -> EffectSetting:
    parameters = {name: 0.0 if name in _UNSEEN else value for name, value in setting.parameters.items()}
    return replace(setting, parameters=parameters)
