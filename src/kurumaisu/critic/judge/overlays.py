# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of the runs from above: measured, simulated, and simulated with what was found."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from kurumaisu.critic.base import replay
from kurumaisu.critic.base.covariates import with_covariates
from kurumaisu.critic.base.drive import Drive, prepare
from kurumaisu.critic.base.replay import PICTURE, RESTART, restarted_path
from kurumaisu.critic.values.recording import Recording, Run
from kurumaisu.critic.values.story import Overlay
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray


def overlays(
    recording: Recording, model: Model, settings: Sequence[EffectSetting] | None = None
) -> tuple[Overlay, ...]:
    """Return a picture of every run that is whole enough for one; settings: what extends the model, if anything."""
    drawn = []
    for run in recording.runs:
        with suppress(Error):
            drawn.append(_overlay(run, model, settings, held_out=run.name in recording.test))
    return tuple(drawn)


def _overlay(run: Run, model: Model, settings: Sequence[EffectSetting] | None, *, held_out: bool) -> Overlay:
    drive = with_covariates(prepare(run, model, PICTURE), run)
    baseline, off = _restarted(drive, replay.path(drive, model, ()))
    extended, off_extended = None, None
    if settings is not None:
        extended, off_extended = _restarted(drive, replay.path(drive, model, settings))
    path = drive.poses[:, :2]
    return Overlay(drive.name, path, baseline, extended, held_out, RESTART, off, off_extended, drive.times)


def _restarted(drive: Drive, path: FloatArray) -> tuple[FloatArray, float | None]:
    """Return a simulated path (n, 2) in pieces that begin at measured poses, nan between, and how far off they end."""
    pieces, off = [], []
    for rows, poses in restarted_path(drive, path):
        pieces += [poses[:, :2], np.full((1, 2), np.nan)]
        if drive.times[rows][-1] - drive.times[rows][0] > RESTART / 2:
            off.append(np.sum((poses[-1] - drive.poses[rows][-1])[:2] ** 2))
    return np.concatenate(pieces)[:-1], float(np.sqrt(np.mean(off))) if off else None
