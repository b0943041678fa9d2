# SPDX-License-Identifier: BSD-3-Clause
"""What no sentence of the catalogue describes, in the rates of the base."""

from __future__ import annotations

import numpy as np

from kurumaisu.bench.strangers.loess.values import Array, Effect, Hidden, Rates


def _spells(t: Array, h: Hidden) -> Array:
    """1 in spells that come and go, 0 between, with soft ends."""
    rng = np.random.default_rng(int(h.extra * 1e6))
    on = np.zeros(t.size)
    for start in np.cumsum(rng.uniform(9, 24, 30)):
        on = np.maximum(on, np.clip(1.5 - np.abs(t - start - 1.5), 0, 0.7) / 0.7)
    return on


def _since_rest(m: Rates) -> Array:
    rest = (np.abs(m.cmd_v) < 1e-9) & (np.abs(m.cmd_w) < 1e-9)
    last = np.maximum.accumulate(np.where(rest, m.t, -30.0))
    return np.asarray(m.t - last)


def humid_tyres(m: Rates, h: Hidden) -> None:
    """The speed falls where the air is humid."""
    m.v = m.v * (1 - h.size * np.tanh((m.columns["humidity"] - 50) / 12))


def carpet(m: Rates, h: Hidden) -> None:
    """One part of the room, by x, has a carpet that slows the chair down."""
    m.v = m.v * (1 - 1.5 * h.size / (1 + np.exp(-(m.pose[:, 0] - 3.5 - 2 * h.extra) / 0.25)))


def cold_gear(m: Rates, h: Hidden) -> None:
    """Turning is sluggish after a rest until the gear has run for some seconds."""
    m.w = m.w * (1 - 2.5 * h.size * np.exp(-_since_rest(m) / (2 + 2 * h.extra)))


def spinning_wheel(m: Rates, h: Hidden) -> None:
    """A wheel spins now and then: for a moment the chair is slow."""
    m.v = m.v * (1 - 3.5 * h.size * _spells(m.t, h))


def tugged(m: Rates, h: Hidden) -> None:
    """A cable tugs to one side for some moments."""
    m.w = m.w + 1.2 * h.size * _spells(m.t, h) * (np.abs(m.v) > 0.02)


def hunting(m: Rates, h: Hidden) -> None:
    """The yaw rate swings with a slow period while it drives."""
    m.w = m.w + 0.7 * h.size * np.sin(2 * np.pi * m.t / (24 + 20 * h.extra)) * (np.abs(m.v) > 0.02)


def grain(m: Rates, h: Hidden) -> None:
    """A floor with a grain turns the chair as it crosses it at a slant."""
    m.w = m.w + h.size * m.v * np.sin(2 * m.pose[:, 2] + 6 * h.extra) * 1.5


def soft_tyre(m: Rates, h: Hidden) -> None:
    """The path bends with the pressure of a tyre that was logged."""
    m.w = m.w + 1.3 * h.size * m.v * (m.columns["pressure"] - 2.0) / 0.2


UNKNOWN_RATES: dict[str, Effect] = {
    "unknown.humid_tyres": Effect(humid_tyres, "rate", 0.06, 0.15, covariates=("humidity",), channel="base.v"),
    "unknown.carpet": Effect(carpet, "rate", 0.06, 0.15, False, covariates=("x",), channel="base.v"),
    "unknown.cold_gear": Effect(cold_gear, "rate", 0.08, 0.2, False, covariates=("time_since_rest",), channel="base.w"),
    "unknown.spinning_wheel": Effect(spinning_wheel, "slow", 0.08, 0.2, False, covariates=("time",), channel="base.v"),
    "unknown.tugged": Effect(tugged, "slow", 0.08, 0.2, covariates=("time",), channel="base.w"),
    "unknown.hunting": Effect(hunting, "slow", 0.05, 0.15, covariates=("time",), channel="base.w"),
    "unknown.grain": Effect(grain, "path", 0.05, 0.15, covariates=("heading",), channel="base.w"),
    "unknown.soft_tyre": Effect(soft_tyre, "path", 0.05, 0.15, covariates=("pressure",), channel="base.w"),
}
