# SPDX-License-Identifier: BSD-3-Clause
"""Causes of the base: each in a plain equation (form 0) and in other ones."""

from collections.abc import Callable

import numpy as np

from .model import LEFT, LEFT_0, RIGHT, RIGHT_0, Cause, F, Run, arr, law, turn, unlaw_v, unlaw_w


class State:
    """What the causes work on: the cells of one drive."""

    def __init__(self, run: Run) -> None:
        self.run, self.mid, self.dt = run, run.mid, np.diff(run.t)
        self.t, self.pace = self.mid.copy(), np.ones(len(self.mid))
        self.long = float(run.t[-1])
        self.x, self.y, self.th = run.at(self.mid)
        self.law = 0
        self.grow_v = self.grow_w = np.ones(len(self.mid))

    def hold(self) -> None:
        """Rates asked for, as voltages."""
        run = self.run
        i = np.clip(np.searchsorted(run.ct, self.t, side="right") - 1, 0, None)
        self.age = self.t - run.ct[i]
        self.vc, self.wc = run.cv[i], run.cw[i]
        self.sign = np.sign(self.wc)
        self.vf, self.vs = law(self.vc, self.wc)

    def obey(self) -> None:
        """Voltages as rates."""
        self.v = unlaw_v(self.vf)
        if self.law == 0:
            self.w = unlaw_w(self.vs, self.sign)
        else:  # intercepts of the opposite sign
            left = RIGHT_0 if self.law == 2 else -LEFT_0
            self.w = np.where(self.vs < left, (self.vs - left) / LEFT, 0.0)
            right = -RIGHT_0
            self.w = np.where(self.vs > right, (self.vs - right) / RIGHT, self.w)
        self.u = np.zeros(len(self.v))


P = dict[str, float]


def relax(u: F, dt: F, tau: float, tau_down: float = -1.0) -> F:
    """First-order lag, if wished with another time constant where the size falls."""
    up = np.exp(-dt / max(tau, 1e-6))
    down = up if tau_down < 0 else np.exp(-dt / max(tau_down, 1e-6))
    out, last = [], float(u[0])
    for want, a, b, d in zip(u.tolist(), up.tolist(), down.tolist(), dt.tolist(), strict=True):
        f = a if abs(want) >= abs(last) else b
        new = want + (last - want) * f
        rate = tau if f == a else tau_down
        out.append(want + (last - want) * rate / d * (1 - f) if rate > 1e-6 else want)  # mean over the cell
        last = new
    return np.array(out)


def limit(u: F, dt: F, up: float, down: float) -> F:
    """Ramps: slopes of growing and of falling size."""
    out, last = [], float(u[0])
    for want, d in zip(u.tolist(), dt.tolist(), strict=True):
        top = (up if abs(want) > abs(last) else down) * d
        new = last + min(max(want - last, -top), top)
        out.append((last + new) / 2)
        last = new
    return np.array(out)


def play(u: F, gap: float) -> F:
    """Play of a half gap either way."""
    out, last = [], float(u[0])
    for want in u.tolist():
        last = min(max(last, want - gap), want + gap)
        out.append(last)
    return np.array(out)


def _delay(s: State, p: P, f: int) -> None:
    d = p["delay"]
    if f == 2:
        s.t = np.floor(s.t / (2 * d)) * 2 * d
    else:
        s.t = s.t - d * (1 + (0.8 * np.sin(s.t * 0.9) if f == 1 else 0.0))


def _clock_scale(s: State, p: P, f: int) -> None:
    k, half = p["scale"], s.long / 2
    if f == 0:
        s.t, s.pace = s.t / (1 + k), s.pace / (1 + k)
    elif f == 1:
        s.pace = 1 - k * s.t / half
        s.t = s.t - k * s.t**2 / (2 * half)
    else:
        s.pace = 1 - 2 * k * (s.t > half)
        s.t = s.t - 2 * k * np.maximum(s.t - half, 0.0)


def _dac_zero_f(s: State, p: P, f: int) -> None:
    o = p["offset"] * (1 + (0.4 * np.sin(s.mid / 9) if f == 2 else 0.0 * s.mid))
    s.vf = s.vf + o + (np.where(s.vc == 0, np.where(o > 0, 0.127906, -0.108783), 0.0) if f == 1 else 0.0)


def _dac_zero_s(s: State, p: P, f: int) -> None:
    s.vs = s.vs + p["offset"] * (1 + (0.6 * np.sin(s.mid / 9) if f == 1 else 0.3 * np.sign(s.vc) * (f == 2)))


def _dac_quantisation(s: State, p: P, f: int) -> None:
    q = p["step"]
    if f == 0:
        s.vf, s.vs = q * np.round(s.vf / q), q * np.round(s.vs / q)
    elif f == 1:
        s.vf, s.vs = q * np.trunc(s.vf / q), q * np.trunc(s.vs / q)
    else:  # a bit that is missing
        s.vf, s.vs = s.vf - np.mod(s.vf, 2 * q) // q * q, s.vs - np.mod(s.vs, 2 * q) // q * q


def _steering_law(s: State, p: P, f: int) -> None:
    s.law = 1 + (f == 1)


def _dead(size: F, width: float, edge: F, f: int) -> F:
    """By how much a voltage of some size beyond its dead zone is less."""
    if f == 0:
        return width + 0 * size
    if f == 1:
        return np.where(size < edge + width, 1.0, 0.0)
    return arr(width * np.exp(-(size - edge) / 0.15))


def _dead_zone_v(s: State, p: P, f: int) -> None:
    edge = np.where(s.vf > 0, 0.127906, 0.108783)
    size = np.abs(s.vf)
    s.vf = np.sign(s.vf) * np.maximum(size - _dead(size, p["width"], edge, f), 0.0)


def _dead_zone_w(s: State, p: P, f: int) -> None:
    turned = np.abs(s.wc) * 0.48
    s.vs = s.vs + s.sign * _dead(turned, p["width"], 0 * turned, f)


def _cross_v_to_w(s: State, p: P, f: int) -> None:
    s.vs = s.vs + p["share"] * s.vf * (np.abs(s.vf) if f == 1 else 1.0) * ((s.vf > 0) if f == 2 else 1.0)


def _backlash(s: State, p: P, f: int) -> None:
    g = p["play"]
    if f == 2:
        s.w = play(s.w, 0.5 * g) / 2 + play(s.w, 1.5 * g) / 2
    else:
        s.w = play(s.w, g) if f == 0 else s.w + 1.2 * g * np.tanh((play(s.w, g) - s.w) / g)


def _gain(x: F, g: float, f: int, mid: F, knee: float) -> F:
    if f == 1:
        return arr(g * knee * np.tanh(x / knee))
    return arr(g * x * (1 + (0.5 * np.sin(mid / 7) if f == 2 else 0.0)))


def _gain_v(s: State, p: P, f: int) -> None:
    s.v = s.v + _gain(s.v, p["gain"], f, s.mid, 0.3)


def _gain_w(s: State, p: P, f: int) -> None:
    s.w = s.w + _gain(s.w, p["gain"], f, s.mid, 0.3)


def _left_right_gain(s: State, p: P, f: int) -> None:
    a = p["asymmetry"] * (1.5 * np.tanh(np.abs(s.w) / 0.3) if f == 2 else 1.0)
    s.w = s.w * (1 + (2 * a * (s.w > 0) if f == 1 else a * np.sign(s.w)))


def _veer(s: State, p: P, f: int) -> None:
    c = p["curvature"]
    s.w = s.w + (c * s.v if f == 0 else c * np.abs(s.v) if f == 1 else c * 2 * s.v * np.abs(s.v))


def _reverse_gain(s: State, p: P, f: int) -> None:
    back = np.minimum(s.v, 0.0)
    g = p["gain"]
    s.v = s.v + (_gain(back, g, 1, s.mid, 0.15) if f == 1 else g * back * (-4 * back if f == 2 else 1.0))


def _bend(x: F, c: float, f: int, knee: float) -> F:
    size = np.abs(x)
    if f == 0:
        return x * (1 - c * size)
    if f == 1:
        return x * np.maximum(size, 1e-3) ** (-c)
    return x - c * 2 * np.sign(x) * np.maximum(size - knee, 0.0) ** 2


def _curvature_v(s: State, p: P, f: int) -> None:
    s.v = _bend(s.v, p["curvature"], f, 0.25)


def _curvature_w(s: State, p: P, f: int) -> None:
    s.w = _bend(s.w, p["curvature"], f, 0.25)


def _top(x: F, k: float, f: int) -> F:
    if f == 0:
        return np.clip(x, -1 / k, 1 / k)
    return arr(np.tanh(x * k) / k if f == 1 else x / (1 + np.abs(x * k) ** 6) ** (1 / 6))


def _saturation(s: State, p: P, f: int) -> None:
    s.v, s.w = _top(s.v, p["inverse_v"], f), _top(s.w, p["inverse_w"], f)


def _battery_sag(s: State, p: P, f: int) -> None:
    k = p["sag"]
    g = (k * s.mid, 1 - np.exp(-2 * k * s.mid), 2 * k * np.maximum(s.mid - s.long / 2, 0.0))[f]
    s.v, s.w = s.v * (1 - g), s.w * (1 - g)


def _lag(x: F, dt: F, tau: float, f: int) -> F:
    if f == 1:
        return relax(relax(x, dt, tau / 2), dt, tau / 2)
    return relax(x, dt, tau) if f == 0 else relax(x, dt, 1.4 * tau, 0.4 * tau)


def _lag_v(s: State, p: P, f: int) -> None:
    s.v = _lag(s.v, s.dt, p["tau"], f)


def _lag_w(s: State, p: P, f: int) -> None:
    s.w = _lag(s.w, s.dt, p["tau"], f)


def _accel_limit(s: State, p: P, f: int) -> None:
    a, b = 1 / p["slowness_v"], 1 / p["slowness_w"]
    k = 3.0 if f == 1 else 1.0
    s.v, s.w = limit(s.v, s.dt, a, k * a), limit(s.w, s.dt, b, k * b)
    if f == 2:
        s.v, s.w = relax(s.v, s.dt, 0.15), relax(s.w, s.dt, 0.15)


def _payload(s: State, p: P, f: int) -> None:
    d, form = p["droop"], 1 if f == 1 else 0
    more = 1 + (np.abs(s.v) if f == 2 else 0.0)
    s.v, s.w = _lag(s.v * (1 - d * more), s.dt, p["tau"], form), _lag(s.w * (1 - d), s.dt, p["tau"], form)


def _process_noise(s: State, p: P, f: int) -> None:
    g, v, w = p["growth"], np.abs(s.v), np.abs(s.w)
    s.grow_v = (1 + g * v, 1 + 2 * g * v * v, 1 + g * (v > 0.3))[f]
    s.grow_w = (1 + g * w, 1 + 2 * g * w * w, 1 + g * (w > 0.4))[f]


def _understeer(s: State, p: P, f: int) -> None:
    k, v = p["k"], np.abs(s.v)
    s.w = s.w / (1 + (k * v * v, k * v / 2, 2 * k * np.maximum(v - 0.25, 0.0))[f])


def _caster_reversal(s: State, p: P, f: int) -> None:
    kick, length, gone, way, out = p["kick"], p["length"], 1e9, 0.0, []
    for v, d in zip(s.v.tolist(), s.dt.tolist(), strict=True):
        if abs(v) > 0.01:
            if way * v < 0:
                gone = 0.0
            way = v
            gone += abs(v) * d
        out.append(gone if abs(v) > 0.01 else 1e9)
    q = np.array(out) / length
    bow = np.where(q < 2, np.sin(np.pi * np.minimum(q, 2) / 2), 0)
    s.w = s.w + kick * (np.exp(-np.minimum(q, 50)), np.maximum(1 - q / 2, 0), bow)[f]


def _cross_w_to_v(s: State, p: P, f: int) -> None:
    s.v = s.v + p["lever"] * (s.w, np.abs(s.w), 2 * s.w * np.abs(s.w))[f]


def _lateral_slip(s: State, p: P, f: int) -> None:
    q = s.v * s.w
    s.u = s.u - p["c"] * (q, 4 * q * np.abs(q), np.sign(q) * np.maximum(np.abs(q) - 0.05, 0) * 1.5)[f]


def _slope(s: State, p: P, f: int) -> None:
    c, sn = np.cos(s.th), np.sin(s.th)
    up = (p["climb_x"] * c + p["climb_y"] * sn) * np.where(s.vc != 0, 1.0, 0.0)
    s.v = s.v - (up, up * 2.5 * np.abs(s.v), up * np.where(up * s.v > 0, 1.5, 0.5))[f]


def shift(run: Run, causes: list[Cause], t: F) -> tuple[F, F, F]:
    """How far the reference is off the chair at some times, in the map's frame."""
    from .unknown import REFERENCE

    x, y, th = run.at(t)
    a, b, c = np.zeros(len(t)), np.zeros(len(t)), np.zeros(len(t))
    for k in causes:
        if k.id == "base.marker_yaw":
            c = c + k.p["yaw"]
        elif k.id.startswith("base.marker_"):
            q = turn(th, np.array(k.p.get("x", 0.0)), np.array(k.p.get("y", 0.0)))
            a, b = a + q[0], b + q[1]
        elif k.id in REFERENCE:
            q3 = REFERENCE[k.id](run, k.p, x, y, th, t)
            a, b, c = a + q3[0], b + q3[1], c + q3[2]
    return a, b, c


Act = Callable[[State, P, int], None]
# id: act, rank, sizes, which of them are scaled, sign free
ACTS: dict[str, tuple[Act, int, P, tuple[str, ...], bool]] = {
    "delay": (_delay, 0, {"delay": 0.05}, ("delay",), False),
    "clock_scale": (_clock_scale, 0, {"scale": 0.001}, ("scale",), True),
    "dac_zero_f": (_dac_zero_f, 1, {"offset": 0.01}, ("offset",), True),
    "dac_zero_s": (_dac_zero_s, 1, {"offset": 0.01}, ("offset",), True),
    "cross_v_to_w": (_cross_v_to_w, 1, {"share": 0.01}, ("share",), True),
    "dac_quantisation": (_dac_quantisation, 2, {"step": 0.03}, ("step",), False),
    "dead_zone_v": (_dead_zone_v, 3, {"width": 0.03}, ("width",), False),
    "dead_zone_w": (_dead_zone_w, 3, {"width": 0.03}, ("width",), False),
    "steering_law": (_steering_law, 3, {"flip": 1.0}, (), False),
    "gain_v": (_gain_v, 4, {"gain": 0.05}, ("gain",), True),
    "gain_w": (_gain_w, 4, {"gain": 0.05}, ("gain",), True),
    "left_right_gain": (_left_right_gain, 4, {"asymmetry": 0.05}, ("asymmetry",), True),
    "reverse_gain": (_reverse_gain, 4, {"gain": 0.05}, ("gain",), True),
    "curvature_v": (_curvature_v, 4, {"curvature": 0.05}, ("curvature",), True),
    "curvature_w": (_curvature_w, 4, {"curvature": 0.05}, ("curvature",), True),
    "saturation": (_saturation, 5, {"inverse_v": 2.0, "inverse_w": 2.0}, ("inverse_v", "inverse_w"), False),
    "battery_sag": (_battery_sag, 4, {"sag": 0.001}, ("sag",), False),
    "backlash": (_backlash, 6, {"play": 0.03}, ("play",), False),
    "lag_v": (_lag_v, 7, {"tau": 0.1}, ("tau",), False),
    "lag_w": (_lag_w, 7, {"tau": 0.1}, ("tau",), False),
    "payload": (_payload, 7, {"droop": 0.05, "tau": 0.1}, ("droop", "tau"), False),
    "accel_limit": (_accel_limit, 7, {"slowness_v": 1.0, "slowness_w": 0.5}, ("slowness_v", "slowness_w"), False),
    "understeer": (_understeer, 8, {"k": 0.1}, ("k",), False),
    "veer": (_veer, 8, {"curvature": 0.03}, ("curvature",), True),
    "caster_reversal": (_caster_reversal, 8, {"kick": 0.1, "length": 0.25}, ("kick",), True),
    "cross_w_to_v": (_cross_w_to_v, 8, {"lever": 0.03}, ("lever",), True),
    "lateral_slip": (_lateral_slip, 8, {"c": 0.02}, ("c",), False),
    "slope": (_slope, 8, {"climb_x": 0.02, "climb_y": 0.01}, ("climb_x", "climb_y"), True),
    "process_noise": (_process_noise, 9, {"growth": 3.0}, ("growth",), False),
}
MARKERS: dict[str, P] = {"marker_x": {"x": 0.03}, "marker_y": {"y": 0.03}, "marker_yaw": {"yaw": 0.02}}


def rates(run: Run, causes: list[Cause]) -> State:
    """Rates of every cell without noise, seen from the path that was really driven."""
    from .unknown import RATES

    s = State(run)
    todo = [(ACTS[c.id[5:]][1], ACTS[c.id[5:]][0], c) for c in causes if c.id[5:] in ACTS and c.id[:5] == "base."]
    todo += [(8, RATES[c.id], c) for c in causes if c.id in RATES]
    todo.sort(key=lambda k: k[0])
    for rank, act, c in todo:
        if rank == 0:
            act(s, c.p, c.form)
    s.hold()
    for rank, act, c in todo:
        if 1 <= rank <= 3:
            act(s, c.p, c.form)
    s.obey()
    for rank, act, c in todo:
        if rank > 3:
            act(s, c.p, c.form)
    s.v, s.w, s.u = s.v * s.pace, s.w * s.pace, s.u * s.pace
    return s
