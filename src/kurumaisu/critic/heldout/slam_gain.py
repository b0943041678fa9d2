# SPDX-License-Identifier: BSD-3-Clause
"""What an extension is worth beyond the motion: on scans held out, and to the same SLAM run with both models."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from kurumaisu import effects, geometry, slam_score
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.covariates import with_covariates_but_place
from kurumaisu.critic.base.drive import driven, prepare_all
from kurumaisu.critic.data.reference import map_run
from kurumaisu.critic.heldout import scan_gain
from kurumaisu.critic.heldout.drive_gain import blocks, rmse_gain
from kurumaisu.critic.predict.motion import Forecast
from kurumaisu.critic.predict.scan_poses import ScanPoses, joined
from kurumaisu.critic.ranges.scans.beams import acts_on_readings
from kurumaisu.critic.ranges.scans.gathering import laser_of, why_not_usable
from kurumaisu.critic.values.criticism import Criticism, Settings
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.critic.values.story import Overlay
from kurumaisu.critic.values.verdict import Cause, ChannelGain, Gain, SlamGain
from kurumaisu.effects import Beams, Echoes
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, Laser, Model
from kurumaisu.types import FloatArray

if TYPE_CHECKING:  # loading MRPT takes a third of a second, which most recordings need not pay
    from kurumaisu.slam import ScanLog

FEWEST = 50  # scans of which a path is made
_MOST = 400  # scans, at 4 to 8 ms each
_LEAST_APART = 0.15  # [s] between them, where there are more than that
_GAP = 0.5  # [s] between poses over which the reference is not interpolated
_SEEDS = (1, 2)  # of the particle filter: its path is drawn
Refit = Callable[[str], Sequence[EffectSetting]]  # what extends the model, fitted without the run of this name
_ROUNDS = 4  # of an inversion whose error falls by the effects' relative size each time


@dataclass(frozen=True)
class _Path:
    """Times (n,) [s], the reference (n, 3), poses (n, 3) in its frame by the first seed; squares (n, seeds, 2)."""

    times: FloatArray
    truth: FloatArray
    poses: FloatArray
    squares: FloatArray


def measure(recording: Recording, model: Model, refit: Refit) -> tuple[SlamGain, Overlay]:
    """Return the error of SLAM's path on a run held out, with the model as it was and with what extends it; a picture.

    Its paths are in the reference's frame. Raise Error saying why SLAM cannot be run.
    """
    run = _chosen(recording)
    assert run.scan is not None
    assert run.pose is not None
    beams = laser_of(model.laser, recording.laser, recording.runs).beams
    if beams != run.scan.values.shape[1]:
        raise Error(f"{run.name}: scans have {run.scan.values.shape[1]} beams, the model's laser has {beams}")
    rows = _rows(run)
    ours = recording.model is not None or any(one.voltage is not None for one in recording.runs)
    sides = []
    for settings in ((), tuple(refit(run.name))):
        log = _log(run, model, settings, corrected(recording, run, rows, model, settings, known=ours))
        sides.append(_mapped(log, run.pose))
    gains = []
    for i, unit in enumerate(("m", "rad")):
        baseline, extended = (blocks(side.squares[:, :, i], side.times - side.times[0]) for side in sides)
        gains.append(rmse_gain(baseline, extended, unit))
    measured, before, after = (path[:, :2] for path in (sides[0].truth, sides[0].poses, sides[1].poses))
    picture = Overlay(f"SLAM on {run.name}", measured, before, after, run.name in recording.test, restart=0.0)
    return SlamGain(run.name, len(sides[0].times), *gains), picture


def sentence(gain: SlamGain) -> str:
    """Return in a sentence what SLAM gains."""
    p, h = gain.position, gain.heading
    text = (
        f"SLAM on {gain.run} ({gain.scans} scans): path error {1e3 * p.baseline:.0f} mm and "
        f"{np.degrees(h.baseline):.2f} deg (rms) with the original model, {1e3 * p.extended:.0f} mm and "
        f"{np.degrees(h.extended):.2f} deg with the extended model"
    )
    if max(p.lo90, h.lo90) > 0:
        return f"{text}."
    worse = min(p.hi90, h.hi90) < 0
    return f"{text}: {'no improvement' if worse else 'no significant difference in this run'}."


def _chosen(recording: Recording) -> Run:
    """Return the run with most scans that can be mapped, of those to judge by or else of all. Raise Error for none."""
    names = recording.test or recording.train
    able = [run for run in recording.runs if run.name in names and driven(run) and len(_rows(run)) >= FEWEST]
    if not able:
        raise Error(_missing(recording))
    return max(able, key=lambda run: len(_rows(run)))


def _missing(recording: Recording) -> str:
    names = recording.test or recording.train
    runs = [run for run in recording.runs if run.name in names]
    if all(run.scan is None for run in runs):
        return "no scans were recorded"
    if all(run.pose is None for run in runs):
        return "there is no reference pose"
    if all(run.pose_source != "measured" for run in runs):
        return "the reference pose is SLAM's own"
    if not any(driven(run) for run in runs):
        return "what drove the chair was not recorded"
    return f"no run has {FEWEST} scans between reference poses while the chair was driven"


def _rows(run: Run) -> list[int]:
    """Return the scans that are mapped: on known poses, in one piece from the first on, thinned."""
    if run.scan is None or run.pose is None or run.pose_source != "measured":
        return []
    t, times = run.scan.t, run.pose.t
    after = np.clip(np.searchsorted(times, t), 1, len(times) - 1) if len(times) > 1 else np.zeros(len(t), dtype=int)
    known = (t >= times[0]) & (t <= times[-1]) & (times[after] - times[after - 1] < _GAP)
    out: list[int] = []
    for i in np.flatnonzero(known).tolist():
        if not out or t[i] - t[out[-1]] >= _LEAST_APART:
            out.append(i)
        if len(out) == _MOST:
            break
    return out


def _log(run: Run, model: Model, settings: Sequence[EffectSetting], scans: Corrected) -> ScanLog:
    slam = import_module("kurumaisu.slam")
    drive = with_covariates_but_place(prepare_all(run, model, float(scans.stamps[-1]) + 1.0), run)
    begun = drive.seen_at(drive.times[:1], drive.poses[:1])  # nothing of the reference but where it begins
    times, poses = replay.odometry(begun, model, settings)
    fan = slam.Fan(**scans.fan)
    log: ScanLog = slam.scan_log(run.name, scans.stamps, scans.ranges.astype(np.float32), fan, times, poses)
    return log


def _mapped(log: ScanLog, reference: Series) -> _Path:
    truth = geometry.interpolate(reference.t, reference.values[:, :3], log.times)
    aligned, squares = [], []
    for seed in _SEEDS:
        path = map_run(log, seed, lambda _: None).trajectory[:, 1:]
        placed = geometry.compose(np.broadcast_to(slam_score.align(path, truth), path.shape), path)
        off = placed - truth
        squares.append(np.column_stack([(off[:, :2] ** 2).sum(axis=1), geometry.wrap(off[:, 2]) ** 2]))
        aligned.append(placed)
    return _Path(log.times, truth, aligned[0], np.stack(squares, axis=1))


@dataclass(frozen=True)
class Corrected:
    """stamps (n,) [s] at which the scans began, ranges (n, b) [m] on the level, and the fan as SLAM has it."""

    stamps: FloatArray
    ranges: FloatArray
    fan: dict[str, Any]


def corrected(
    recording: Recording,
    run: Run,
    rows: Sequence[int],
    model: Model,
    settings: Sequence[EffectSetting],
    *,
    known: bool,
) -> Corrected:
    """Return some scans of a run, freed of what model and effects say that the laser does to them on the mean.

    How obliquely a beam meets its wall is not known here: effects of that stay in. known: whether the model's law of
    the laser is that of this one; else readings are taken for ranges.
    """
    assert run.scan is not None
    laser = laser_of(model.laser, recording.laser, recording.runs)
    given = {setting.id for setting in settings}
    own = (own for own in model.effects if own.id not in given)
    every = tuple(s for s in (*own, *settings) if acts_on_readings(s.id) and _steady(laser, s))
    chain = effects.build_laser(every, np.random.default_rng(0))
    stamps = run.scan.t[list(rows)]
    flat = np.zeros(laser.beams)
    said = laser.time_increment * np.arange(laser.beams)
    mount = np.array([laser.mount.x, laser.mount.y, laser.mount.yaw])
    begun = float(run.scan.t[0])
    beams = [chain.aim(Beams(t, t + said, mount, laser.mount.z, laser.bearings, flat, begun)) for t in stamps.tolist()]
    readings = run.scan.values[list(rows)]
    first = laser.error.range(readings) if known else readings
    ranges = np.array([_ranges(laser, chain, t, start) for t, start in zip(stamps.tolist(), first, strict=True)])
    level = ranges * np.cos(np.array([each.elevations for each in beams]))
    one = beams[len(beams) // 2]
    fan = {
        "angle_min": float(one.bearings[0]),
        "angle_increment": float((one.bearings[-1] - one.bearings[0]) / (laser.beams - 1)),
        "time_increment": float((one.times[-1] - one.times[0]) / (laser.beams - 1)),
        "range_max": laser.range_max if known else float(np.nanmax(readings, initial=0.0, where=readings < np.inf)),
        "base_from_laser": one.mount.tolist(),
    }
    return Corrected(np.array([float(each.times[0]) for each in beams]), level, fan)


def _steady(laser: Laser, setting: EffectSetting) -> bool:
    """Tell whether an effect does the same to every laser: nobody can undo what is drawn."""
    flat = np.ones(laser.beams)
    echoes = Echoes(0.0, laser.bearings, flat, 0 * flat, flat, flat, flat, 0 * flat, flat)
    drawn = [effects.build_laser((setting,), np.random.default_rng(seed)).read(echoes) for seed in (0, 1)]
    return np.array_equal(drawn[0], drawn[1], equal_nan=True)


def _ranges(laser: Laser, chain: effects.LaserChain, stamp: float, start: FloatArray) -> FloatArray:
    """Return the ranges (b,) [m] that the chain makes readings of, from a first guess; inf and nan stay."""
    if chain.empty:
        return start
    hit = np.isfinite(start)
    guess, zero, one = np.where(hit, start, 1.0), np.zeros_like(start), np.ones_like(start)
    # The model's own law is undone by the first guess; what the effects add to it is taken off in turn.
    for _ in range(_ROUNDS):
        mean, sd = laser.error.mean(guess), laser.error.deviation(guess)
        seen = chain.read(Echoes(stamp, laser.bearings, guess, zero, one, mean, sd, zero, guess))
        guess = np.where(hit, start - (seen - mean), 1.0)
    return np.where(hit, guess, start)


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
    try:
        gain, picture = measure(
            recording, criticism.model, lambda name: _without(name, criticism, recording, extension)
        )
    except Error as error:  # a verdict is worth more than what it is worth downstream
        return replace(criticism, story=replace(story, details=(*story.details, f"SLAM not compared: {error}.")))
    whole = replace(verdict, gain=replace(verdict.gain, slam=gain))
    told = replace(story, details=(*story.details, sentence(gain)), overlays=(picture, *story.overlays))
    return replace(criticism, verdict=whole, story=told)


def _without(name: str, criticism: Criticism, recording: Recording, extension: Extension) -> Settings:
    """Return what extends the model as fitted without a run."""
    base, scans = extension.refit(name), extension.scans
    others = replace(recording, train=tuple(other for other in recording.train if other != name))
    if scans and name not in recording.test and others.train and why_not_usable(others) is None:
        places = ScanPoses(others, criticism.model, extension.forecast)
        scans = scan_gain.refit(joined([shots for _, shots in places.trained_runs()]), scans)
    return (*base, *scans)
