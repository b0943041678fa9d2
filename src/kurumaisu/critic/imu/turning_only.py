# SPDX-License-Identifier: BSD-3-Clause
"""What must not be told of drives of which nothing but the turning was measured: where they went, and how fast."""

from __future__ import annotations

from dataclasses import replace

from kurumaisu.critic.values.criticism import Criticism
from kurumaisu.critic.values.recording import Recording

_TURNS = "dtheta"  # the channel of a gain that was measured
_LENGTHS = ("m", "m/s")
LIMITS = (
    "Only how the robot turned was measured, by the imu, whose own scale may be off by some per cent: this recording "
    "cannot tell how far it drives or slips, and effects on its speed were not looked for; a reference of its pose "
    "tells them."
)


def with_limits(criticism: Criticism, recording: Recording) -> Criticism:
    """Return a criticism without figures of what was not measured, and with what such a recording cannot tell."""
    if not recording.turning:
        return criticism
    verdict, story = criticism.verdict, criticism.story
    gain = verdict.gain
    if gain is not None:
        channels = {name: each for name, each in gain.channels.items() if name == _TURNS}
        verdict = replace(verdict, gain=replace(gain, rmse={}, channels=channels))
    story = replace(
        story,
        details=(LIMITS, *story.details),
        noise=tuple(each for each in story.noise if each.unit not in _LENGTHS),
        overlays=(),
    )
    return replace(criticism, verdict=verdict, story=story)
