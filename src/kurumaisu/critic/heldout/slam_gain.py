# SPDX-License-Identifier: BSD-3-Clause
"""What an extension is worth downstream: the same SLAM run with odometry and laser of the old and the new model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from kurumaisu import geometry, slam_score
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.covariates import with_covariates_but_place
from kurumaisu.critic.base.drive import Drive, driven, prepare_all
from kurumaisu.critic.heldout.corrected_scans import Corrected, corrected
from kurumaisu.critic.heldout.drive_gain import BLOCK, rmse_gain
from kurumaisu.critic.ranges.scans.gathering import laser_of
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.critic.values.verdict import SlamGain
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, Model, shipped
from kurumaisu.types import FloatArray

if TYPE_CHECKING:  # loading MRPT takes a third of a second, which most recordings need not pay
    from kurumaisu.slam import ScanLog

FEWEST = 50  # scans of which a path is made
_MOST = 400  # scans, at 4 to 8 ms each
_LEAST_APART = 0.15  # [s] between them, where there are more than that
_GAP = 0.5  # [s] between poses over which the reference is not interpolated
_SEEDS = (1, 2)  # of the particle filter: its path is drawn
Refit = Callable[[str], Sequence[EffectSetting]]  # what extends the model, fitted without the run of this name


@dataclass(frozen=True)
class Downstream:
    """gain: None where SLAM was not run, for the reason told; paths (n, 2) [m] in the reference's frame."""

    sentence: str
    gain: SlamGain | None = None
    measured: FloatArray | None = None
    baseline: FloatArray | None = None
    extended: FloatArray | None = None


@dataclass(frozen=True)
class _Path:
    """Times (n,) [s], the reference (n, 3), poses (n, 3) in its frame by the first seed; squares (seeds, n, 2)."""

    times: FloatArray
    truth: FloatArray
    poses: FloatArray
    squares: FloatArray


def measure(recording: Recording, model: Model, refit: Refit) -> Downstream:
    """Return the error of SLAM's path on a run held out, with the model as it was and with what extends it."""
    run = _chosen(recording)
    if run is None:
        return Downstream(f"SLAM not compared: {_missing(recording)}.")
    try:
        return _compared(recording, run, model, refit)
    except Error as error:  # a verdict is worth more than what it is worth downstream
        return Downstream(f"SLAM not compared: {error}.")


def _compared(recording: Recording, run: Run, model: Model, refit: Refit) -> Downstream:
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
        blocks = [_blocks(side, i) for side in sides]
        gains.append(rmse_gain(blocks[0], blocks[1], unit))
    gain = SlamGain(run.name, len(sides[0].times), *gains)
    return Downstream(sentence(gain), gain, sides[0].truth[:, :2], sides[0].poses[:, :2], sides[1].poses[:, :2])


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


def _chosen(recording: Recording) -> Run | None:
    """Return the run with most scans that can be mapped, of those to judge by or else of all."""
    names = recording.test or recording.train
    able = [run for run in recording.runs if run.name in names and driven(run) and len(_rows(run)) >= FEWEST]
    return max(able, key=lambda run: len(_rows(run)), default=None)


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
    times, poses = replay.odometry(_begun(drive), model, settings)
    fan = slam.Fan(
        angle_min=scans.angle_min,
        angle_increment=scans.angle_increment,
        time_increment=scans.time_increment,
        range_max=scans.range_max,
        base_from_laser=scans.mount,
    )
    log: ScanLog = slam.scan_log(run.name, scans.stamps, scans.ranges.astype(np.float32), fan, times, poses)
    return log


def _begun(drive: Drive) -> Drive:
    """Return the drive with nothing of the reference but where it begins."""
    return drive.seen_at(drive.times[:1], drive.poses[:1])


def _mapped(log: ScanLog, reference: Series) -> _Path:
    slam = import_module("kurumaisu.slam")
    settings = slam.load_mapping_settings(shipped("launch/mapping_node.yaml"))
    truth = geometry.interpolate(reference.t, reference.values[:, :3], log.times)
    aligned, squares = [], []
    for seed in _SEEDS:
        path = slam.map_scans(settings, log, seed).trajectory[:, 1:]
        placed = geometry.compose(np.broadcast_to(slam_score.align(path, truth), path.shape), path)
        off = placed - truth
        squares.append(np.column_stack([(off[:, :2] ** 2).sum(axis=1), geometry.wrap(off[:, 2]) ** 2]))
        aligned.append(placed)
    return _Path(log.times, truth, aligned[0], np.array(squares))


def _blocks(side: _Path, column: int) -> list[FloatArray]:
    index = ((side.times - side.times[0]) // BLOCK).astype(int)
    return [side.squares[:, index == i, column].ravel() for i in np.unique(index)]
