# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of the base alone: commands, voltages, reference poses; faults sized by what they are worth."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.bench.hidden.base.whitening import Path, Whitener, deviation
from kurumaisu.bench.hidden.generator import laws
from kurumaisu.bench.hidden.generator.drives import DESIGNS
from kurumaisu.bench.hidden.generator.motion import STEP, Fault, Setting, drive
from kurumaisu.bench.hidden.generator.noise import Regime, draw_rates, draw_reference
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.types import FloatArray

RUNS, SECONDS = 3, 60.0
_TAIL = 1.0  # [s] of reference after the last command


@dataclass(frozen=True)
class Drives:
    """Drives of one recording: settings with noise; errors (m, 3) of each one's reference; the regime they follow."""

    settings: tuple[Setting, ...]
    errors: tuple[FloatArray, ...]
    regime: Regime


def draw_drives(
    design: str | None, regime: Regime, rng: np.random.Generator, seconds: float = SECONDS, rate: float | None = None
) -> Drives:
    """Return drives with all their noise drawn; design None: one of the rich ones per drive; rate [Hz] likewise."""
    rate = rate or float(rng.choice([5.0, 10.0, 10.0, 20.0]))
    stamps = np.round(np.arange(0.0, seconds + _TAIL, 1 / rate), 6)
    settings, errors = [], []
    for _ in range(RUNS):
        name = design or str(rng.choice(["rich", "rich", "stick"]))
        command = DESIGNS[name](seconds, rng)
        start = np.array([*rng.uniform(-2, 2, 2), rng.uniform(-np.pi, np.pi)])
        noise = draw_rates(regime, round((seconds + _TAIL + 2.0) / STEP), rng)
        settings.append(Setting(command, start, stamps, noise))
        errors.append(draw_reference(regime, stamps, rng))
    return Drives(tuple(settings), tuple(errors), regime)


def recording(name: str, drives: Drives, faults: Sequence[Fault]) -> Recording:
    """Return what was measured of drives with these faults."""
    runs = tuple(
        run_of(f"run_{i}", setting, drive(setting, faults)[0] + error)
        for i, (setting, error) in enumerate(zip(drives.settings, drives.errors, strict=True), start=1)
    )
    return Recording(name, runs, train=tuple(run.name for run in runs))


def run_of(name: str, setting: Setting, poses: FloatArray) -> Run:
    """Return a drive's tables as the critic takes them."""
    t, v, w = setting.command.T
    volts = np.column_stack([laws.volts(v, laws.TRANSLATION), laws.volts(w, laws.STEERING)])
    return Run(
        name,
        command=Series(t, np.column_stack([v, w]), ("v", "w")),
        voltage=Series(t, volts, ("v_f", "v_s")),
        pose=Series(setting.stamps, poses, ("x", "y", "theta")),
    )


class Scale:
    """What faults are worth on given drives: whitened signals of their noise-free differences."""

    def __init__(self, drives: Drives) -> None:
        """Drive without noise and faults once, and work out the filter."""
        self.drives = drives
        self._settings = [replace(setting, noise=None) for setting in drives.settings]
        self._nominal, moved = [], []
        for setting in self._settings:
            poses, rates = drive(setting, ())
            self._nominal.append(poses)
            moved.append(gates(rates.moving, setting.stamps))
        self.path = Path(self._settings[0].stamps, np.stack(self._nominal), np.stack(moved))
        self.whitener = Whitener(self.path, drives.regime)

    def deviations(self, faults: Sequence[Fault]) -> FloatArray:
        """Return deviations (runs, n, 3) that faults make without noise."""
        pairs = zip(self._nominal, self._settings, strict=True)
        return np.stack([deviation(nominal, drive(setting, faults)[0]) for nominal, setting in pairs])

    def signals(self, alternatives: Sequence[Sequence[Fault]]) -> FloatArray:
        """Return whitened signals (samples, alternatives)."""
        return self.whitener.whiten(np.stack([self.deviations(faults) for faults in alternatives], axis=-1))

    def louder(self, fault: Fault) -> Scale:
        """Return what faults are worth under the noise that a fault in its amplitude makes."""
        out = copy.copy(self)
        out.path = replace(self.path, gate=self.path.gate * self.growth(fault))
        out.whitener = Whitener(out.path, self.drives.regime)
        return out

    def growth(self, fault: Fault) -> FloatArray:
        """Return how many times a fault in the noise's amplitude makes it between poses, (runs, n - 1)."""
        out = []
        for setting in self._settings:
            ones = replace(setting, noise=np.ones((round((setting.stamps[-1] + 3.0) / STEP), 3)))
            rates = drive(ones, (fault,))[1]
            loud = gates(rates.moving * rates.noise[:, 0], setting.stamps)
            usual = gates(rates.moving, setting.stamps)
            out.append(np.where(usual > 0, loud / np.maximum(usual, 1e-12), 1.0))
        return np.stack(out)


def gates(moving: FloatArray, stamps: FloatArray) -> FloatArray:
    """Return the root mean square of a gate between stamps."""
    sums = np.concatenate([[0.0], np.cumsum(moving**2)]) * STEP
    at = np.interp(stamps, STEP * np.arange(len(sums)), sums)
    return np.asarray(np.sqrt(np.maximum(np.diff(at) / np.diff(stamps), 0.0)))
