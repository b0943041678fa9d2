# SPDX-License-Identifier: BSD-3-Clause
"""The chair: D/A, electronics, two geared motors under a speed loop, tyres, casters, seat; variants side by side."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
H = 0.02  # [s] period of the digital speed loop, and the step of the integration (midpoint rule)
MASS, SEAT, TRACK, EMF, OHM = 110.0, 45.0, 0.54, 8.0, 0.15  # kg, kg, m, V per m/s (and N per A), Ohm
COULOMB, VISCOUS, AMPS, VOLTS = 12.0, 9.0, 90.0, 25.5  # N, N per m/s, A, V
KP = 0.7 * MASS / (2 * H) * OHM / EMF - EMF  # V per m/s: closes 0.7 of an error within a step
TRAIL, CASTER = 0.06, 0.42  # m: trail, and how far the casters sit in front of the axle

# What can be wrong with a chair; all 0 in a sound one.
_WIRE = "delay delay_wander lost dac_f dac_s dac_step leak band_f band_s stick_f stick_s soft_f soft_s"
_BOX = (
    "amp_v amp_w amp_rev amp_lr bend_v bend_w cube_v cube_w inv_v inv_w rc_v rc_w rc2_v rc2_w slow_v slow_w slow_down"
)
_DRIVE = "play sag collapse soft droop far low"  # steering pot, battery, weak loop, mass far from the axle
_TYRES = "wear_l wear_r track under under_sat kick scrub slip slip2 grade_x grade_y grade_up"
_ODD = "cold flat carpet heat pressure bank crab gust lean rock mud"  # in no catalogue
FAULTS = " ".join([_WIRE, _BOX, _DRIVE, _TYRES, _ODD]).split()
ODD = set(_ODD.split())


@dataclass
class Outside:
    """What acts from outside, by step and run: noise of the rates, obstacles, events, the place of things."""

    noise: Array  # (steps, 3, runs): forward, yaw, sideways
    blocked: Array  # (steps, runs): 1 where a wall holds the chair
    lost: Array  # (steps, runs): 1 where packets are lost
    gust: Array  # (steps, runs)
    wander: Array  # (steps, runs): 0..1, how busy the network is
    pressure: Array  # (steps, runs): a covariate, about 0
    patch: tuple[float, float]  # the carpet lies where this direction (cos, sin) has x c + y s > 0
    end: Array  # (runs,) length of each run [s]


@dataclass
class Motion:
    """Rates of all variants (steps, variants, runs), commands by row and run, wheel speeds and pose of variant 0."""

    v: Array
    w: Array
    side: Array
    rows: Array  # (rows, 2, runs)
    rim: Array  # (steps, 2, runs)
    pose: Array  # (steps + 1, 3, runs)


def limit(x: Array, low: Array, high: Array) -> Array:
    """np.clip, which is slow."""
    return np.asarray(np.minimum(np.maximum(x, low), high))


def volts(v: Array, w: Array) -> tuple[Array, Array]:
    """The published law, equations (1) and (2)."""
    f = np.where(v > 0, 1.32402 * v + 0.127906, np.where(v < 0, 2.07369 * v - 0.108783, 0.0))
    s = np.where(w > 0, -0.499211 * w + 0.104181, np.where(w < 0, -0.469278 * w - 0.169476, 0.0))
    return f, s


def _band(x: Array, q: dict[str, Array], axis: str) -> Array:
    """Voltage beyond the dead zone's edge, after what the electronics take from it."""
    x = np.maximum(x - q["band_" + axis], 0.0)
    x = np.where(x > q["stick_" + axis], x, 0.0)
    return np.asarray(np.sqrt(x * x + q["soft_" + axis] ** 2) - q["soft_" + axis])


def decode(v: Array, w: Array, q: dict[str, Array]) -> Array:
    """Commands through D/A and joystick electronics: the rates that the chair is to have (2, variants, runs)."""
    f, s = volts(v, w)
    step = np.maximum(q["dac_step"], 1e-9)
    f_out, s_out = (np.round((x + a) / step) * step for x, a in ((f, q["dac_f"]), (s, q["dac_s"] + q["leak"] * f)))
    a = np.where(v > 0, (f_out - 0.127906) / 1.32402, (f_out + 0.108783) / 2.07369)
    slope = np.where(v > 0, 1.32402, 2.07369)
    a = np.where(v == 0, 0.0, np.sign(v) * _band(np.maximum(a * np.sign(v), 0) * slope, q, "f") / slope)
    b = np.where(w > 0, -(s_out - 0.104181) / 0.499211, -(s_out + 0.169476) / 0.469278)
    slope = np.where(w > 0, 0.499211, 0.469278)
    b = np.sign(w) * _band(np.maximum(b * np.sign(w), 0) * slope, q, "s") / slope
    b = np.where(w == 0, np.where(v == 0, 0.0, -(q["dac_s"] + q["leak"] * f) / 0.484), b)
    a = a * (1 + q["amp_v"]) * (1 + q["amp_rev"] * (v < 0)) * (1 - q["bend_v"] * abs(a) - q["cube_v"] * a * a)
    b = b * (1 + q["amp_w"]) * (1 + q["amp_lr"] * np.sign(w)) * (1 - q["bend_w"] * abs(b) - q["cube_w"] * b * b)
    top_v, top_w = 1 / (q["inv_v"] + 1e-9), 1 / (q["inv_w"] + 1e-9)
    return np.array([limit(a, -top_v, top_v), limit(b, -top_w, top_w)])


class Electronics:
    """Network, filters, ramps and play between what is asked for and the speed loop."""

    def __init__(self, q: dict[str, Array], on: set[str], steps: int, runs: int, out: Outside) -> None:
        self.q, self.on, self.out = q, on, out
        nv = len(q["delay"])
        self.past = np.zeros((steps + 1, 2, nv, runs))
        self.one, self.two, self.ramp, self.last = (np.zeros((2, nv, runs)) for _ in range(4))
        self.a1, self.a2 = (
            np.stack([1 - np.exp(-H / np.maximum(q[n + x], 1e-6)) for x in ("_v", "_w")]) for n in ("rc", "rc2")
        )
        slow = np.stack([q["slow_v"], q["slow_w"]])
        self.up = H / np.maximum(slow, 1e-9)
        self.down = self.up * (1 + 9 * q["slow_down"])
        self.turn = np.zeros((nv, runs))
        self.runs = np.arange(runs)
        self.late = [i for i in range(nv) if q["delay"][i, 0] != 0 or q["delay_wander"][i, 0] != 0]

    def step(self, k: int, x: Array) -> Array:
        """What the speed loop is asked for in step k."""
        q, on = self.q, self.on
        if "lost" in on:
            x = np.where((self.out.lost[k] * q["lost"]) > 0, self.last, x)
            self.last = x
        if on & {"delay", "delay_wander"}:
            self.past[k] = x
            x = x.copy()
            for i in self.late:
                back = np.maximum(k - (q["delay"][i] + q["delay_wander"][i] * self.out.wander[k]) / H, 0.0)
                low = back.astype(int)
                part, high = (back - low)[:, None], np.minimum(low + 1, k)
                x[:, i] = (self.past[low, :, i, self.runs] * (1 - part) + self.past[high, :, i, self.runs] * part).T
        if on & {"rc_v", "rc_w", "rc2_v", "rc2_w"}:
            self.one += (x - self.one) * self.a1
            self.two += (self.one - self.two) * self.a2
            x = self.two.copy()
        if on & {"slow_v", "slow_w"}:
            most = np.where(abs(x) < abs(self.ramp), self.down, self.up)
            self.ramp += limit(x - self.ramp, -most, most)
            x = self.ramp.copy()
        if "play" in on:
            half = q["play"] / 2
            self.turn = limit(self.turn, x[1] - half, x[1] + half)
            x = np.array([x[0], self.turn])
        if on & {"sag", "collapse"}:
            left = H * k / self.out.end
            x = x * (1 - q["sag"] * H * k - q["collapse"] * np.minimum(np.maximum((left - 0.7) / 0.3, 0), 1) ** 2)
        return x


class Motors:
    """Motors with back-EMF, friction and the battery's voltage, their speed loop, and a passenger on a springy seat."""

    def __init__(self, q: dict[str, Array], runs: int) -> None:
        nv = len(q["soft"])
        stiff = np.where(q["soft"] > 0, MASS / 2 / np.maximum(q["soft"], 2e-2), (KP + EMF) * EMF / OHM)
        self.kp = np.minimum(stiff * OHM / EMF - EMF, KP)
        self.drag = q["droop"] / (1 - q["droop"]) * stiff
        self.ahead = np.where(q["soft"] > 0, 0.0, 1.0)
        self.most = VOLTS - q["low"]
        yaw = 1 / (MASS * (1 + q["far"]))  # TRACK^2 / (4 yaw inertia)
        self.same, self.cross, self.even = 1 / MASS + yaw, 1 / MASS - yaw, not np.any(q["far"])
        self.u, self.goal, self.amps = (np.zeros((2, nv, runs)) for _ in range(3))
        self.sway, self.speed = np.zeros((nv, runs)), np.zeros((nv, runs))

    def step(self, goal: Array) -> Array:
        """Mean speeds of the rims (left, right) over one period of the loop."""
        rise = self.ahead * (goal - self.goal)  # fed forward, over this period
        middle = goal - rise / 2
        push = self._friction(middle) + VISCOUS * middle + rise * (MASS / 2 / H)
        volt = EMF * middle + OHM / EMF * push + self.kp * (goal - rise - self.u)
        volt = limit(volt, -self.most, self.most)
        back = EMF * self.u
        volt = limit(volt, back - OHM * AMPS, back + OHM * AMPS)
        seat = 0.5 * (900.0 * self.sway + 90.0 * self.speed)
        old, self.goal = self.u, goal
        middle = old + self._accel(old, volt, seat) * (H / 2)
        accel = self._accel(middle, volt, seat)
        self.u = old + accel * H
        pull = accel.sum(axis=0) / 2
        self.speed = self.speed - H * (pull + 2 * seat / SEAT)
        self.sway = self.sway + H * self.speed
        return np.asarray((old + self.u) / 2)

    def _accel(self, u: Array, volt: Array, seat: Array) -> Array:
        self.amps = (volt - EMF * u) * (1 / OHM)
        force = EMF * self.amps - self._friction(u) - (VISCOUS + self.drag) * u + seat * 0.1
        if self.even:
            return np.asarray(self.same * force)
        return np.asarray(self.same * force + self.cross * force[::-1])

    def _friction(self, u: Array) -> Array:
        return np.asarray(COULOMB * u / (abs(u) + 0.005))


class Floor:
    """Tyres, casters and floor: from the speeds of the rims to the motion of the chair."""

    def __init__(self, q: dict[str, Array], on: set[str], runs: int, out: Outside) -> None:
        self.q, self.on, self.out = q, on, out
        nv = len(q["wear_l"])
        self.wear = 1 + np.stack([q["wear_l"], q["wear_r"]])
        self.swing, self.way, self.gone, self.rest = (np.zeros((nv, runs)) for _ in range(4))
        self.angle = np.full((nv, runs), 0.02)
        self.wheel = np.zeros((nv, runs))
        self.mark = 0.5 * np.ones(runs)
        self.ring, self.beat = np.zeros((nv, runs)), np.zeros((nv, runs))
        self.before = np.zeros((nv, runs))

    def step(self, k: int, rim: Array, amps: Array, pose: Array) -> tuple[Array, Array, Array]:
        """Forward, yaw and sideways rate in step k; pose (3, runs) is where the chair of variant 0 is."""
        q, on = self.q, self.on
        rim = rim * (self.wear - 2e-5 * abs(amps))  # creep under traction
        v = (rim[0] + rim[1]) / 2
        w = (rim[1] - rim[0]) / (TRACK * (1 + q["track"]))
        side = -(q["slip"] + q["slip2"] * abs(v)) * v * w
        if on & {"under", "under_sat"}:
            w = w / (1 + q["under"] * v * v) * (1 - q["under_sat"] * np.tanh((v / 0.35) ** 2))
        if on & {"grade_x", "grade_y", "grade_up"}:
            up = q["grade_x"] * np.cos(pose[2]) + q["grade_y"] * np.sin(pose[2])
            moving = abs(v) > 0.02
            v = (
                v
                - np.where(q["grade_up"] > 0, q["grade_up"] * np.maximum(np.cos(pose[2]) * np.sign(v), 0), up) * moving
            )
        if on & {"kick", "scrub"}:
            w = w + self._casters(v, w)
        if on & ODD:
            v, w, side = self._odd(k, rim, pose, (v, w, side))
        return v, w, side

    def _casters(self, v: Array, w: Array) -> Array:
        q = self.q
        sign = np.where(abs(v) > 0.02, np.sign(v), self.way)
        self.swing = np.where((sign * self.way < 0), 1.0, self.swing) * np.exp(-H * abs(v) / 0.25)
        self.way = sign
        angle = self.angle  # of a real caster: it turns about its pin as the pin is dragged along
        self.angle = angle + H * (-v * np.sin(angle) / TRAIL + 0.2 * w * CASTER * np.cos(angle) + 0.1 * abs(v))
        return np.asarray(q["kick"] * self.swing + q["scrub"] * np.sin(self.angle) * abs(v) / 0.3)

    def _odd(self, k: int, rim: Array, pose: Array, rates: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        """Troubles that stand in no catalogue."""
        q, out, (v, w, side) = self.q, self.out, rates
        moving = abs(v) > 0.02
        self.rest = np.where(moving | (abs(w) > 0.03), self.rest + H, 0.0)
        self.gone = self.gone + H * abs(v)
        self.wheel = self.wheel + H * rim[0]
        self.ring = self.ring + H * (-self.beat * 1.0)
        self.beat = self.beat + H * (30.0 * self.ring - 1.2 * self.beat) + (v - self.before)
        self.before = v
        inside = (pose[0] * out.patch[0] + pose[1] * out.patch[1]) > 0
        factor = 1 - q["cold"] * np.exp(-self.rest / 1.2) - q["carpet"] * inside + q["pressure"] * out.pressure[k]
        factor = factor - q["heat"] * (1 - np.cos(self.gone * 2.4)) / 2 - q["lean"] * np.minimum(abs(w), 0.6)
        bump = np.exp(6 * (np.cos(self.wheel / 0.16) - 1))  # once per turn of the left wheel
        side = side + q["bank"] * moving * np.cos(pose[2]) + q["crab"] * v
        w = w + q["flat"] * bump * abs(rim[0]) + q["gust"] * out.gust[k] + q["mud"] * inside * v
        return v * factor + q["rock"] * self.beat, w, side


def simulate(
    variants: list[dict[str, float]],
    times: Array,
    steps: int,
    out: Outside,
    drive: Callable[[float, Array], Array],
    start: Array,
) -> Motion:
    """Drive all variants by one driver, who sees variant 0, the only one with noise; start (3, runs)."""
    nv, runs = len(variants), out.noise.shape[2]
    q = {n: np.array([[x.get(n, 0.0)] for x in variants]) for n in FAULTS}
    on = {n for n in FAULTS if np.any(q[n] != 0)}
    wires, motors, floor = Electronics(q, on, steps, runs, out), Motors(q, runs), Floor(q, on, runs, out)
    new, old = (np.zeros((2, nv, runs)) for _ in range(2))
    rates = np.zeros((3, steps, nv, runs))
    rims, poses, rows = np.zeros((steps, 2, runs)), np.zeros((steps + 1, 3, runs)), np.zeros((len(times), 2, runs))
    pose = start.copy()
    poses[0] = pose
    row, track = 0, 0.5 * TRACK
    for k in range(steps):
        goal = new
        if row < len(times) and times[row] < H * (k + 1.5):  # half a step ahead: the loop's hold takes it back
            rows[row] = drive(times[row], pose)
            old, new = new, decode(rows[row, 0], rows[row, 1], q)
            share = min(max(k + 1.5 - times[row] / H, 0.0), 1.0)
            goal, row = old + (new - old) * share, row + 1
        goal = wires.step(k, goal)
        turn = track * goal[1]
        rim = motors.step(np.array([goal[0] - turn, goal[0] + turn]))
        v, w, side = floor.step(k, rim, motors.amps, pose)
        free = 1 - out.blocked[k]
        rates[0, k], rates[1, k], rates[2, k] = v * free, w * free, side * free
        awake = free * (np.abs(rows[row - 1]).sum(axis=0) > 0) if row else 0.0
        rates[0, k, 0] += out.noise[k, 0] * awake
        rates[1, k, 0] += out.noise[k, 1] * awake
        rates[2, k, 0] += out.noise[k, 2] * awake
        heading = pose[2] + rates[1, k, 0] * (H / 2)
        c, s = np.cos(heading) * H, np.sin(heading) * H
        a, b = rates[0, k, 0], rates[2, k, 0]
        pose = np.array([pose[0] + a * c - b * s, pose[1] + a * s + b * c, pose[2] + rates[1, k, 0] * H])
        poses[k + 1], rims[k] = pose, rim[:, 0]
    return Motion(rates[0], rates[1], rates[2], rows, rims, poses)
