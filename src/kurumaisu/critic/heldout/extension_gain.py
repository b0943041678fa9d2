# SPDX-License-Identifier: BSD-3-Clause
"""What an extension is worth beyond the motion: on scans held out, and to the SLAM that is run on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from kurumaisu.critic.heldout import scan_gain, slam_gain
from kurumaisu.critic.predict.motion import Forecast
from kurumaisu.critic.predict.scan_poses import ScanPoses, joined
from kurumaisu.critic.ranges.scans.gathering import why_not_usable
from kurumaisu.critic.values.criticism import Criticism
from kurumaisu.critic.values.recording import Recording
from kurumaisu.critic.values.settings import Settings
from kurumaisu.critic.values.story import Overlay
from kurumaisu.critic.values.verdict import Cause, ChannelGain, Gain


@dataclass(frozen=True)
class Extension:
    """What extends a model. forecast: of the base, None where nothing drove it; scans: the laser's and the map's.

    refit: returns the base's part as fitted without the run of a name; points: causes of a confounded set that put the
    reference elsewhere than base_link, as they would be.
    """

    forecast: Forecast | None
    scans: Settings
    refit: Callable[[str], Settings]
    points: tuple[Cause, ...] = ()

    @property
    def empty(self) -> bool:
        """Tell whether nothing was found."""
        return not self.scans and (self.forecast is None or not self.forecast.settings)


def with_scan_gain(criticism: Criticism, measured: ChannelGain | None) -> Criticism:
    """Return a criticism with what its settings for the laser gain on scans held out, None where nobody knows."""
    if measured is None:
        return criticism
    gain = criticism.verdict.gain or Gain(measured.log_density_per_sample)
    whole = replace(gain, channels={**gain.channels, scan_gain.RANGE_CHANNEL: measured})
    story = replace(criticism.story, details=(*criticism.story.details, _sentence(measured)))
    return replace(criticism, verdict=replace(criticism.verdict, gain=whole), story=story)


def _sentence(measured: ChannelGain) -> str:
    density = measured.log_density_per_sample
    text = (
        f"On held-out scans, the laser effects found gain {density.gain:+.3g} nats per reading "
        f"(90 % {density.lo90:+.3g} to {density.hi90:+.3g})"
    )
    if measured.rmse is not None:
        before, after = 1e3 * measured.rmse.baseline, 1e3 * measured.rmse.extended
        text += f"; rms error {before:.2g} mm before, {after:.2g} mm after"
    return text + ("." if density.lo90 > 0 else ": not confirmed.")


def with_slam(criticism: Criticism, recording: Recording, extension: Extension) -> Criticism:
    """Return a criticism with what SLAM gains by the extension, or why that is not known."""
    verdict, story = criticism.verdict, criticism.story
    if extension.empty or verdict.gain is None:
        return criticism
    seen = slam_gain.measure(recording, criticism.model, lambda name: _without(name, criticism, recording, extension))
    told = replace(story, details=(*story.details, seen.sentence))
    if seen.gain is None or seen.measured is None or seen.baseline is None:
        return replace(criticism, story=told)
    held_out = seen.gain.run in recording.test
    name = f"SLAM on {seen.gain.run}"
    picture = Overlay(name, seen.measured, seen.baseline, seen.extended, held_out, restart=0.0)
    whole = replace(verdict, gain=replace(verdict.gain, slam=seen.gain))
    return replace(criticism, verdict=whole, story=replace(told, overlays=(picture, *story.overlays)))


def _without(name: str, criticism: Criticism, recording: Recording, extension: Extension) -> Settings:
    """Return what extends the model as fitted without a run."""
    base, scans = extension.refit(name), extension.scans
    others = replace(recording, train=tuple(other for other in recording.train if other != name))
    if scans and name not in recording.test and others.train and why_not_usable(others) is None:
        places = ScanPoses(others, criticism.model, extension.forecast)
        scans = scan_gain.refit(joined(places.trained()), scans)
    return (*base, *scans)
