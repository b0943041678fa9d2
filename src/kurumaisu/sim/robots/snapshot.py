# SPDX-License-Identifier: BSD-3-Clause
"""The changing part of machinery, as values."""

from __future__ import annotations

from typing import Any

from kurumaisu.sim.robots.machinery import Machinery


def take(machinery: Machinery) -> dict[str, Any]:
    """Return copies of all that changes while a population stays the same."""
    return {
        "seed": machinery.seed,
        "effects": machinery.effects.state(),
        "motion": machinery.motion.state(),
        "walks": machinery.pedestrians.state(),
        "frames": machinery.frames.copy(),
        "before": machinery.before.copy(),
        "stalled": machinery.stalled.copy(),
        "velocities": machinery.drive.velocities.copy(),
        "estimates": machinery.localization.estimates.copy(),
        "shares": machinery.localization.shares.copy(),
        "sweeps": machinery.rangers.scans.sweeps,
    }


def restore(machinery: Machinery, values: dict[str, Any]) -> None:
    """Go back to what take returned, of the same population."""
    machinery.begin(values["seed"])
    machinery.effects.restore(values["effects"])
    machinery.frames[:] = values["frames"]
    machinery.before[:] = values["before"]
    machinery.motion.place(machinery.frames[:-1])
    machinery.motion.restore(values["motion"])
    machinery.pedestrians.restore(values["walks"])
    machinery.stalled[:] = values["stalled"]
    machinery.drive.velocities[:] = values["velocities"]
    machinery.localization.estimates[:] = values["estimates"]
    machinery.localization.shares[:] = values["shares"]
    machinery.rangers.keep(values["sweeps"])
