# SPDX-License-Identifier: BSD-3-Clause
"""How each effect of the base, or something unknown, acts on the plant's arrays."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from .catalogue import Effect
from .plant import LAW_V, LAW_W, Arr, Motion, Noise, Run, State, integral, lag, ramp, rates, since, volts


def _delay(s: State, e: Effect) -> None:
    r = s.run
    d = np.full(len(r.tc), e.size)
    if e.other:  # setting off is late, stopping is not
        eager = np.abs(np.diff(r.vc, prepend=0.0)) * np.sign(np.abs(r.vc) - np.abs(np.roll(r.vc, 1)))
        d = np.where(eager > 0, 2.5 * e.size, 0.3 * e.size)
    i = np.searchsorted(np.maximum.accumulate(r.tc + d), s.t, "right") - 1
    s.vc, s.wc = np.where(i < 0, 0.0, r.vc[i]), np.where(i < 0, 0.0, r.wc[i])
    s.vf, s.vs = volts(s.vc, LAW_V), volts(s.wc, LAW_W)


def _steps(s: State, e: Effect) -> None:
    q = e.size
    for name in ("vf", "vs"):
        u = getattr(s, name)
        k = np.round(u / q)
        setattr(
            s, name, np.where(k % 4 == 3, k - 1, k) * q if e.other else k * q
        )  # other: every fourth code is missing


def _zone(u: Arr, e: Effect) -> Arr:
    """What is lost of a voltage u >= 0 beyond the modelled dead zone."""
    return e.size * (1 - np.exp(-u / e.size)) if e.other else np.full_like(u, e.size)


def _zone_v(s: State, e: Effect) -> None:
    over = np.where(s.vc > 0, s.vf - LAW_V[1], LAW_V[3] - s.vf)
    s.vf = s.vf - np.sign(s.vc) * _zone(np.maximum(over, 0.0), e)


def _zone_w(s: State, e: Effect) -> None:
    over = np.where(s.wc > 0, LAW_W[1] - s.vs, s.vs - LAW_W[3])
    s.vs = s.vs + np.sign(s.wc) * _zone(np.maximum(over, 0.0), e)


def _zero_f(s: State, e: Effect) -> None:
    s.vf = s.vf + e.size * (np.minimum(s.t / 30, 1) if e.other else 1.0)


def _zero_s(s: State, e: Effect) -> None:
    s.vs = s.vs + e.size * (np.minimum(s.t / 30, 1) if e.other else 1.0)


def _cross(s: State, e: Effect) -> None:
    s.leak = s.leak + e.size * (np.abs(s.vf) if e.other else s.vf)


def _to_rates(s: State) -> None:
    s.v, s.w = rates(s.vf, s.vc, LAW_V), rates(s.vs, s.wc, LAW_W)
    s.w = s.w + s.leak / np.where(s.wc > 0, LAW_W[0], np.where(s.wc < 0, LAW_W[2], 0.5 * (LAW_W[0] + LAW_W[2])))


def _play(s: State, e: Effect) -> None:
    at = np.flatnonzero(np.diff(s.w, prepend=s.w[0] - 1.0))
    out, y = [], 0.0
    for u in s.w[at].tolist():
        y = min(max(y, u - e.size / 2), u + e.size / 2)
        out.append(y)
    held = np.repeat(np.array(out), np.diff(np.append(at, len(s.w))))
    if e.other:  # the play creeps away
        held = s.w + (held - s.w) * np.exp(-since(np.diff(s.w, prepend=0.0) != 0, s.t) / 0.4)
    s.w = np.where((s.vc == 0) & (s.wc == 0), 0.0, held)


def _sat(s: State, e: Effect) -> None:
    name = "w" if e.more.get("axis", 0.0) else "v"
    top = max(e.more.get("top", 0.8) - e.size, 0.05)
    u = getattr(s, name)
    setattr(s, name, u / (1 + (np.abs(u) / top) ** 3) ** (1 / 3) if e.other else np.clip(u, -top, top))


def _sag(s: State, e: Effect) -> None:
    end = s.run.end
    lost = 4 * e.size * end * (s.t / end) ** 6 if e.other else e.size * s.t
    s.v, s.w = s.v * (1 - lost), s.w * (1 - lost)


def _distance(s: State) -> Arr:
    return np.asarray(np.cumsum(np.abs(s.v)) * s.dt)


def _accel(s: State, e: Effect) -> None:
    s.v, s.w = ramp(s.v, s.dt / e.size), ramp(s.w, s.dt / (0.5 * e.size))
    if e.other:  # rounded ramps
        s.v, s.w = lag(s.v, s.dt, 0.2 * e.size), lag(s.w, s.dt, 0.2 * e.size)


def _payload(s: State, e: Effect) -> None:
    for name in ("v", "w"):
        setattr(s, name, lag(getattr(s, name) * (1 - e.size), s.dt, 2 * e.size, e.other))


def _caster(s: State, e: Effect) -> None:
    way = np.sign(np.where(np.abs(s.v) > 0.01, s.v, 0.0))
    seen = np.flatnonzero(way)
    if len(seen) == 0:
        return
    at = seen[np.flatnonzero(np.diff(way[seen])) + 1]
    s0, length = _distance(s), e.more.get("length", 0.25)
    gone = np.full(len(s.t), 1e9)
    for i in at:
        gone[i:] = s0[i:] - s0[i]
    kick = e.size * np.exp(-gone / length) * (np.cos(np.minimum(gone, 9.0) * 2.2 / length) if e.other else 1.0)
    s.w = s.w + np.where(np.abs(s.v) > 0.01, kick, 0.0)


def _slope(s: State, e: Effect) -> None:
    up = np.cos(s.pose[2] - e.more.get("uphill", 0.0))
    s.v = s.v - np.where(np.abs(s.v) > 0.02, e.size * (2 * np.maximum(up, 0.0) if e.other else up), 0.0)


def _place(s: State, e: Effect) -> None:
    """unknown: a carpet beyond a line: slower there. Step by step where the path is not yet known."""
    edge, axis = e.more["edge"], int(e.more["axis"])

    def lost(u: Arr) -> Arr:
        return np.asarray(e.size * 0.5 * (1 + np.tanh((u - edge) / 0.1)))

    if s.known:
        s.v = s.v * (1 - lost(s.pose[axis]))
        return
    n = max(1, round(0.01 / s.dt))
    run, way = (np.cos, np.sin)[axis](s.pose[2][::n]) * s.v[::n] * s.dt * n, s.run.start[axis]
    out = []
    for d in run.tolist():
        out.append(e.size * 0.5 * (1 + math.tanh((way - edge) / 0.1)))
        way += d * (1 - out[-1])
    s.v = s.v * (1 - np.repeat(np.array(out), n)[: len(s.v)])


def _pulses(s: State, width: float) -> Arr:
    d = s.t - s.run.events[:, None]
    return np.asarray(np.where((d > 0) & (d < width), np.sin(np.pi * d / width), 0.0).sum(axis=0))


def _rest(s: State) -> Arr:
    return since((np.abs(s.v) < 1e-3) & (np.abs(s.w) < 1e-3), s.t)


def _set(s: State, v: Arr | None = None, w: Arr | None = None) -> None:
    s.v, s.w = s.v if v is None else v, s.w if w is None else w


def _soft(e: Effect, x: Arr) -> Arr:
    """Share lost to understeer at the square x of the speed."""
    return e.size * 0.1 * (1 - np.exp(-x / 0.04)) if e.other else 1 - 1 / (1 + e.size * x)


def _ref(s: State, a: Arr | float = 0.0, b: Arr | float = 0.0, q: Arr | float = 0.0) -> None:
    s.ref = s.ref + np.array([a + 0 * s.t, b + 0 * s.t, q + 0 * s.t])


def _world(s: State, ex: Arr) -> None:
    _ref(s, ex * np.cos(s.pose[2]), -ex * np.sin(s.pose[2]))


def _clock(s: State, e: Effect) -> None:
    s.clock += e.size


Act = Callable[[State, Effect], None]
VOLTS: dict[str, Act] = {
    "base.delay": _delay,
    "base.dac_quantisation": _steps,
    "base.dac_zero_f": _zero_f,
    "base.dac_zero_s": _zero_s,
    "base.dead_zone_v": _zone_v,
    "base.dead_zone_w": _zone_w,
    "base.cross_v_to_w": _cross,
}
TURN: dict[str, Act] = {  # up to the yaw rate
    "base.backlash": _play,
    "base.gain_v": lambda s, e: _set(s, s.v * (1 + e.size * (1 - np.exp(-s.t / 15) if e.other else 1.0))),
    "base.gain_w": lambda s, e: _set(s, w=s.w * (1 + e.size * (1 - np.exp(-s.t / 15) if e.other else 1.0))),
    "base.left_right_gain": lambda s, e: _set(
        s, w=s.w * (1 + 0.5 * e.size * np.sign(s.w) * (2 * np.abs(s.w) if e.other else 1.0))
    ),
    "base.reverse_gain": lambda s, e: _set(
        s, np.where(s.v < 0, s.v * (1 + e.size * (np.abs(s.v) / 0.2 if e.other else 1.0)), s.v)
    ),
    "base.curvature_v": lambda s, e: _set(s, s.v * (1 - e.size * (s.v**2 / 0.4 if e.other else np.abs(s.v)))),
    "base.curvature_w": lambda s, e: _set(s, w=s.w * (1 - e.size * (s.w**2 / 0.5 if e.other else np.abs(s.w)))),
    "base.saturation": _sat,
    "base.battery_sag": _sag,
    "base.understeer": lambda s, e: _set(s, w=s.w * (1 - _soft(e, s.v**2))),
    "base.cross_w_to_v": lambda s, e: _set(s, s.v + e.size * (-np.abs(s.w) if e.other else s.w)),
    "base.lag_v": lambda s, e: _set(s, lag(s.v, s.dt, e.size, e.other)),
    "base.lag_w": lambda s, e: _set(s, w=lag(s.w, s.dt, e.size, e.other)),
    "base.accel_limit": _accel,
    "base.payload": _payload,
    "base.veer": lambda s, e: _set(s, w=s.w + e.size * s.v * (_distance(s) / 8 if e.other else 1.0)),
    "base.caster_reversal": _caster,
    "unknown.rest_v": lambda s, e: _set(s, s.v * (1 - e.size * np.exp(-_rest(s) / 2.5))),
    "unknown.rest_w": lambda s, e: _set(s, w=s.w * (1 + e.size * np.exp(-_rest(s) / 3.0))),
    "unknown.column_v": lambda s, e: _set(s, s.v * (1 - e.size * s.column)),
    "unknown.column_w": lambda s, e: _set(s, w=s.w + e.size * s.column * (np.abs(s.v) > 0.02)),
    "unknown.flat_spot": lambda s, e: _set(
        s, s.v * (1 + e.size * np.sin(2 * np.pi * _distance(s) / e.more["length"] + e.more["phase"]))
    ),
    "unknown.swell": lambda s, e: _set(
        s, s.v * (1 + e.size * np.sin(2 * np.pi * s.t / e.more["period"] + e.more["phase"]))
    ),
    "unknown.lost": lambda s, e: _set(s, s.v * (1 - np.minimum(1.0, e.size * 2 * (_pulses(s, 0.8) > 0)))),
    "unknown.gusts": lambda s, e: _set(s, w=s.w + e.size * _pulses(s, 1.2) * (np.abs(s.v) > 0.02)),
}
DRIVE: dict[str, Act] = {  # heading is known
    "base.slope": _slope,
    "unknown.place_v": _place,
    "base.lateral_slip": lambda s, e: setattr(
        s, "lat", s.lat - e.size * s.v * s.w * (np.abs(s.v) / 0.3 if e.other else 1.0)
    ),
    "unknown.camber": lambda s, e: setattr(
        s, "lat", s.lat + e.size * np.sin(2 * s.pose[2] + e.more["phase"]) * (np.abs(s.v) > 0.02)
    ),
}
WATCH: dict[str, Act] = {  # the path is known
    "base.marker_x": lambda s, e: _ref(s, a=e.size),
    "base.marker_y": lambda s, e: _ref(s, b=e.size),
    "base.clock_scale": _clock,
    "unknown.compass": lambda s, e: _ref(s, q=e.size * np.sin(2 * s.pose[2] + e.more["phase"])),
    "unknown.camera": lambda s, e: _world(
        s, e.size * np.sin(2 * np.pi * s.pose[0] / e.more["length"] + e.more["phase"])
    ),
}


def _apply(table: dict[str, Act], s: State, effects: list[Effect]) -> None:
    for ident, act in table.items():
        for e in effects:
            if e.ident == ident:
                act(s, e)


def simulate(
    run: Run,
    effects: list[Effect],
    noise: Noise | None,
    ms: int = 1,
    end: float | None = None,
    given: Arr | None = None,
) -> Motion:
    """The drive at steps of ms milliseconds, up to end; if given x, y, theta over t, on that path."""
    dt = ms / 1000
    t = np.arange(0.0, (run.end if end is None else end) + dt / 2, dt)
    i = np.maximum(np.searchsorted(run.tc, t + 1e-9, "right") - 1, 0)
    vc, wc, zero = run.vc[i], run.wc[i], np.zeros(len(t))
    col = run.column[::ms][: len(t)]
    s = State(
        run,
        t,
        dt,
        vc,
        wc,
        volts(vc, LAW_V),
        volts(wc, LAW_W),
        vc,
        wc,
        zero,
        np.zeros((3, len(t))),
        np.zeros((3, len(t))),
        zero,
        col,
    )
    _apply(VOLTS, s, effects)
    _to_rates(s)
    _apply(TURN, s, effects)
    free = (t < run.stuck[0]) | (t > run.stuck[1])
    s.v, s.w = s.v * free, s.w * free
    moving = np.where((np.abs(s.v) > 1e-3) | (np.abs(s.w) > 1e-3), 1.0, 0.0)
    n = run.unit[:, ::ms][:, : len(t)] * moving if noise else np.zeros((2, len(t)))
    v_add, w_add = n[0] * (noise.sv if noise else 0.0), n[1] * (noise.sw if noise else 0.0)
    w = s.w + w_add
    if given is None:
        s.pose[2] = run.start[2] + integral(w, dt)
    else:
        s.pose, s.known = given, True
    _apply(DRIVE, s, effects)
    v = s.v + v_add
    if given is None:
        c, d = np.cos(s.pose[2]), np.sin(s.pose[2])
        s.pose[0] = run.start[0] + integral(v * c - s.lat * d, dt)
        s.pose[1] = run.start[1] + integral(v * d + s.lat * c, dt)
    _apply(WATCH, s, effects)
    return Motion(
        t, s.v, s.w, s.lat, v, w, s.pose, s.ref, s.clock, moving, np.array([np.cos(s.pose[2]), np.sin(s.pose[2])])
    )
