# SPDX-License-Identifier: BSD-3-Clause
"""Commands of drives: someone at a stick who shows all there is, and designs that hide something on purpose."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kurumaisu.types import FloatArray

TOP_V, TOP_W = 0.75, 0.8  # [m/s], [rad/s] the fastest anyone asks for


def rich(seconds: float, rng: np.random.Generator) -> FloatArray:
    """Return commands (n, 3) of t [s], v [m/s], w [rad/s], held: speeds, turns, reversals, rests in random order."""
    kinds = np.array([(1, 0), (1, 1), (1, 1), (0, 1), (-1, 0), (-1, 1), (0, 0)])
    rows: list[tuple[float, ...]] = []
    t = 0.0
    while t < seconds:
        drive, turn = kinds[rng.integers(len(kinds))]
        v = drive * rng.triangular(0.12, 0.45, TOP_V)
        w = turn * rng.triangular(0.08, 0.3, TOP_W) * rng.choice([-1.0, 1.0])
        rows.append((t, v, w))
        t += rng.gamma(6.0, 0.3)
    return _ended(rows, seconds)


def stick(seconds: float, rng: np.random.Generator) -> FloatArray:
    """Return commands at 20 Hz of a stick that moves between the places that `rich` steps to, at a finite speed."""
    steps = rich(seconds, rng)
    t = np.arange(0.0, seconds, 0.05)
    speed = rng.uniform(2.0, 6.0)  # [1/s]
    place = np.zeros(2)
    rows: list[tuple[float, ...]] = []
    for now in t:
        goal = steps[np.searchsorted(steps[:, 0], now, side="right") - 1, 1:]
        place = place + np.clip(goal - place, -0.05 * speed * 0.5, 0.05 * speed * 0.5)
        rows.append((now, *np.where(np.abs(place) < 0.03, 0.0, place)))
    return _ended(rows, seconds)


def forward_only(seconds: float, rng: np.random.Generator) -> FloatArray:
    """Return commands that never reverse and turn only while driving."""
    return _held(seconds, rng, lambda: (rng.uniform(0.2, 0.7), rng.choice([-1.0, 0.0, 1.0]) * rng.uniform(0.1, 0.6)))


def one_speed(seconds: float, rng: np.random.Generator) -> FloatArray:
    """Return commands with one forward speed or rest, and no turns."""
    return _held(seconds, rng, lambda: (0.4 * (rng.random() < 0.6), 0.0))


def one_turn(seconds: float, rng: np.random.Generator) -> FloatArray:
    """Return commands that turn on the spot to the left at one rate, or rest."""
    return _held(seconds, rng, lambda: (0.0, 0.4 * (rng.random() < 0.6)))


def constant(seconds: float, rng: np.random.Generator) -> FloatArray:
    """Return one command throughout: an arc at one speed."""
    return _held(seconds, rng, lambda: (0.4, 0.25))


DESIGNS: dict[str, Callable[[float, np.random.Generator], FloatArray]] = {
    "rich": rich,
    "stick": stick,
    "forward_only": forward_only,
    "one_speed": one_speed,
    "one_turn": one_turn,
    "constant": constant,
}


def _held(seconds: float, rng: np.random.Generator, choose: Callable[[], tuple[float, float]]) -> FloatArray:
    rows: list[tuple[float, ...]] = []
    t = 0.0
    while t < seconds:
        rows.append((t, *choose()))
        t += rng.uniform(1.0, 3.0)
    return _ended(rows, seconds)


def _ended(rows: list[tuple[float, ...]], seconds: float) -> FloatArray:
    """Return the rows on a grid of milliseconds, closed by rest."""
    table = np.array([*rows, (seconds, 0.0, 0.0)])
    table[:, 0] = np.round(table[:, 0], 3)
    return table
