# SPDX-License-Identifier: BSD-3-Clause
"""The chair in motion: asked-for rates become voltages, rates, and a path."""

from collections.abc import Callable, Sequence

import numpy as np

from kurumaisu.bench.strangers.delta.core import DT, Array, Cause, Drive, Path, Setup
from kurumaisu.bench.strangers.delta.law import corrected_yaw_rate, held, integrate, speed, volts, yaw_rate
from kurumaisu.bench.strangers.delta.mechanics import PLACED, RATES, VOLTS, Motion
from kurumaisu.bench.strangers.delta.quantities import of_motion

RATE_CHANNELS = ("v", "w", "share_v", "share_w", "path")


def deterministic(setup: Setup, m: Motion, causes: Sequence[Cause]) -> None:
    """Rates without noise that a motion's commands lead to; effects of place are left to the integration."""
    ids = {c.id: c for c in causes}
    m.v, m.w, m.vy = m.ask_v.copy(), m.ask_w.copy(), np.zeros(len(m.t))
    if "base.delay" in ids:
        RATES["base.delay"](m, ids["base.delay"])
    if setup.volts:
        driving = np.abs(m.v) > 1e-6
        meant = m.w.copy()
        m.vf, m.vs = volts(m.v, m.w)
        for name, act in VOLTS.items():
            if name in ids:
                act(m, ids[name])
        m.v = speed(m.vf)
        m.w = corrected_yaw_rate(m.vs) if "base.steering_law" in ids else yaw_rate(m.vs, meant, driving)
    for name, act in RATES.items():
        if name in ids and name != "base.delay":
            act(m, ids[name])


def curved(setup: Setup, drive: Drive, m: Motion, cause: Cause) -> Callable[[Array, Array, Array], tuple[Array, Array]]:
    """What an unknown adds to the rates, given the place; other quantities are worked out once."""
    curve = cause.curve
    assert curve is not None
    known = None if curve.covariate in ("x", "y", "heading") else of_motion(setup, drive, m, curve.covariate)
    index = {"x": 0, "y": 1, "heading": 2}.get(curve.covariate, 0)

    def add(x: Array, y: Array, th: Array, cell: slice | int = slice(None)) -> tuple[Array, Array]:
        """Rates added in some cells."""
        q = (x, y, th)[index] if known is None else known[cell]
        g = cause.size * curve.shape(np.asarray(q))
        v, w = m.v[cell], m.w[cell]
        moving = np.clip((np.abs(v) + np.abs(w)) / 0.05, 0, 1)
        return {
            "v": (g * moving, 0 * g),
            "w": (0 * g, g * moving),
            "share_v": (g * v, 0 * g),
            "share_w": (0 * g, g * w),
            "path": (0 * g, g * v),
        }[curve.channel]

    return add


def simulate(
    setup: Setup, drive: Drive, causes: Sequence[Cause], noisy: bool = False, along: Path | None = None, cells: int = 0
) -> Path:
    """Drive the commands; effects of place are those along a path, if one is given, else of the chair's own."""
    cells = cells or round(drive.length / DT)
    ask_v, ask_w = held(drive.commands, cells)
    m = Motion(DT * (np.arange(cells) + 0.5), ask_v, ask_w, drive.session)
    deterministic(setup, m, causes)
    adders = [curved(setup, drive, m, c) for c in causes if c.curve and c.curve.channel in RATE_CHANNELS]
    adders += [PLACED[c.id](m, c) for c in causes if c.id in PLACED]
    moving = np.clip((np.abs(m.v) + np.abs(m.w)) / 0.05, 0, 1)
    noise_v, noise_w = drive.noise_v[:cells] * moving, drive.noise_w[:cells] * moving
    for c in causes:
        if c.id == "base.process_noise":
            noise_v, noise_w = noise_v * rough(m, c), noise_w * rough(m, c)
    if along is not None:
        for add in adders:
            dv, dw = add(along.x[:cells], along.y[:cells], along.th[:cells])
            m.v, m.w = m.v + dv, m.w + dw
        adders = []
    if noisy:
        m.v, m.w = m.v + noise_v, m.w + noise_w
        held_up = (m.t > drive.contact[0]) & (m.t < drive.contact[1])
        m.v, m.w, m.vy = (np.where(held_up, 0.0, u) for u in (m.v, m.w, m.vy))
    return stepwise(m, adders, drive.origin) if adders else integrate(m.v, m.w, m.vy, drive.origin)


def rough(m: Motion, cause: Cause) -> Array:
    """Factor by which the noise of the rates grows with them."""
    if cause.other:
        return np.asarray(1 + cause.size * (m.v**2 + 0.25 * m.w**2) / 0.1)
    return np.asarray(1 + cause.size * (np.abs(m.v) / 0.3 + np.abs(m.w) / 0.6))


def stepwise(
    m: Motion, adders: Sequence[Callable[..., tuple[Array, Array]]], origin: tuple[float, float, float]
) -> Path:
    """Integrate cell by cell, where the rates depend on the place."""
    n = len(m.t)
    x, y, th = origin
    v_all, w_all = np.array(m.v), np.array(m.w)
    stride = 5
    for k in range(0, n, stride):
        block = slice(k, min(k + stride, n))
        for add in adders:
            dv, dw = add(np.float64(x), np.float64(y), np.float64(th), block)
            v_all[block] += dv
            w_all[block] += dw
        for v, w, vy in zip(v_all[block], w_all[block], m.vy[block], strict=True):
            mid = th + w * DT / 2
            c, s = np.cos(mid), np.sin(mid)
            x, y, th = x + DT * (v * c - vy * s), y + DT * (v * s + vy * c), th + DT * w
    return integrate(v_all, w_all, m.vy, origin)
