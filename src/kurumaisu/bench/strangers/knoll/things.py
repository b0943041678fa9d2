# SPDX-License-Identifier: BSD-3-Clause
"""What a case consists of: a scene, drives in it, hits of beams, and causes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from kurumaisu.bench.strangers.knoll.room import Room
from kurumaisu.types import BoolArray, FloatArray, IntArray

Rng = np.random.Generator
Pose = tuple[FloatArray, FloatArray, FloatArray]
Covariates = dict[str, Callable[[FloatArray], FloatArray]]
DT = 0.01  # [s]


@dataclass(frozen=True)
class Fan:
    """A laser's fan, its error and its mount (x, y, yaw)."""

    name: str
    angle_min: float
    increment: float
    beams: int
    time_increment: float
    scan_time: float
    near: float
    far: float
    sigma: tuple[float, float, float]
    scale: float = 1
    datum: float = 0
    resolution: float = 0.001
    mount: FloatArray = field(default_factory=lambda: np.zeros(3))
    height: float = 0.0

    @property
    def small(self) -> bool:
        """Return whether it needs a small room."""
        return self.far < 5


@dataclass(frozen=True)
class Reference:
    """Where poses come from: sds of position and heading, of what wanders in them in slow_time, and the rate."""

    name: str
    white_p: float
    white_h: float
    slow_p: float
    slow_h: float
    slow_time: float
    rate: float

    @property
    def white(self) -> FloatArray:
        """Return the variances of white errors."""
        return np.array([self.white_p**2, self.white_p**2, self.white_h**2])

    @property
    def slow(self) -> FloatArray:
        """Return the variances of slow errors."""
        return np.array([self.slow_p**2, self.slow_p**2, self.slow_h**2])

    def cov(self, t: FloatArray, share: float = 1.0) -> FloatArray:
        """Return the covariance of the errors at t, of all three in turn; share: of the white variances."""
        slow = np.exp(-np.abs(t[:, None] - t) / self.slow_time)
        return np.kron(np.eye(t.size), np.diag(share * self.white)) + np.kron(slow, np.diag(self.slow))


@dataclass(frozen=True)
class Scene:
    """A robot, the noise of its rates, a driver, a reference, a laser and the surroundings."""

    robot: str
    vmax: float
    wmax: float
    margin: float
    law: str
    fan: Fan | None
    ref: Reference
    sd_v: float
    sd_w: float
    noise_time: float
    person: bool
    sharp: bool
    command_step: int
    covariates: Covariates
    scan_rate: float
    strays: float
    room: Room

    @property
    def voltage(self) -> bool:
        """Return whether the robot is driven by voltages."""
        return self.robot == "chair_v"

    @property
    def laser(self) -> Fan:
        """Return the fan of a robot that has one."""
        assert self.fan
        return self.fan


@dataclass
class Drive:
    """One drive on a grid: commands, covariates, noise and the true path; later its reference and scans."""

    n: int
    day: float  # [s] of its start
    t: FloatArray
    vc: FloatArray
    wc: FloatArray
    cov: dict[str, FloatArray]
    nv: FloatArray
    nw: FloatArray
    path: FloatArray  # (3, n + 1)
    rows: list[tuple[int, float, float]] = field(default_factory=lambda: [(0, 0.0, 0.0)])
    v: FloatArray = field(init=False)  # true rates
    w: FloatArray = field(init=False)
    u: FloatArray = field(init=False)
    vm: FloatArray = field(init=False)  # rates without noise
    wm: FloatArray = field(init=False)
    rt: FloatArray = field(init=False)  # the reference's stamps, poses, poses without noise, and what is off
    ref: FloatArray = field(init=False)
    clean: FloatArray = field(init=False)
    bad: BoolArray = field(init=False)
    st: FloatArray = field(init=False)  # stamps of scans
    scans: FloatArray = field(init=False)

    def integral(self, rate: FloatArray, t: FloatArray) -> FloatArray:
        """Return the integral of what is on the grid from the start to t."""
        return np.interp(t, np.arange(self.n + 1) * DT, np.concatenate([[0], np.cumsum(rate) * DT]))

    def at(self, t: FloatArray) -> Pose:
        """Return the true poses at t, in its shape."""
        nodes = np.arange(self.n + 1) * DT
        x, y, th = (np.interp(t.ravel(), nodes, p).reshape(t.shape) for p in self.path)
        return x, y, th


@dataclass(frozen=True)
class Hits:
    """What beams hit, flat over scans and beams."""

    r: FloatArray
    cosi: FloatArray  # cosine of the incidence
    thing: IntArray
    edge: IntArray
    dark: FloatArray
    beam: IntArray
    bearing: FloatArray
    ang: FloatArray
    t: FloatArray
    late: FloatArray  # after the scan's first beam
    day: float
    v: FloatArray
    w: FloatArray
    back: FloatArray  # range beside it
    cov: dict[str, FloatArray]
    jac: FloatArray  # of the range by the pose
    th: FloatArray

    def tan(self, most: float) -> FloatArray:
        """Return the tangent of the incidence."""
        return np.asarray(np.minimum(np.sqrt(1 / self.cosi**2 - 1), most))

    def only(self, o: BoolArray) -> Hits:
        """Return some of the beams, but for jac and cov."""
        each: dict[str, Any] = {
            k: a[o] for k, a in vars(self).items() if isinstance(a, np.ndarray) and a.size == o.size
        }
        return replace(self, **each)


Rates = tuple[FloatArray, FloatArray, FloatArray]


@dataclass
class Cause:
    """What one cause does, channel by channel; None where it does nothing."""

    id: str
    other: bool = False
    told: dict[str, float] = field(default_factory=dict)
    order: int = 5
    volt: Callable[[Drive, FloatArray, FloatArray], tuple[FloatArray, FloatArray]] | None = None
    rate: Callable[[Drive, FloatArray, FloatArray, FloatArray], Rates] | None = None
    place: Callable[[Any, Any, Any, Any, Any], tuple[Any, Any]] | None = None  # (x, y, theta, v, w) -> v, w
    marker: FloatArray | None = None  # of the tracked point in the body
    warp: Callable[[FloatArray, FloatArray, FloatArray, FloatArray], Pose] | None = None  # what a pose errs at t
    clock: float = 0.0  # stamps of the reference: true * (1 + clock)
    law: str | None = None
    growth: Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]] | None = None  # of the noise of v, of w
    mount: FloatArray | None = None
    scan_time: Callable[[FloatArray], FloatArray] | None = None  # when a scan of some stamp was taken
    stretch: float = 0.0
    walls: Callable[[FloatArray, IntArray], FloatArray] | None = None
    mean: Callable[[FloatArray, Hits], FloatArray] | None = None
    sd: Callable[[FloatArray, Hits], FloatArray] | None = None
    corrupt: Callable[[Rng, FloatArray, Hits], FloatArray] | None = None
    noise: Callable[[FloatArray], FloatArray] | None = None  # makes white noise of unit sd correlated
    common: tuple[float, float] | None = None  # sd, rho
    dens: Callable[[FloatArray, FloatArray, FloatArray, Hits], FloatArray] | None = None  # (reading, mean, sd, hits)
    moments: Callable[[FloatArray, FloatArray, Hits], tuple[FloatArray, FloatArray]] | None = None  # of mean, variance
    lost: Callable[[FloatArray, Hits], FloatArray] | None = None  # probability
    step: float = 0.0
    unknown: tuple[str, str] | None = None  # channel, covariate

    def tell(self, name: str, value: float) -> float:
        """Return a parameter that truth.json is to have."""
        self.told[name] = float(value)
        return value

    @property
    def poses(self) -> bool:
        """Return whether it moves the reference's poses."""
        return self.marker is not None or self.warp is not None

    @property
    def base(self) -> bool:
        """Return whether motions change by it."""
        does = (self.volt, self.rate, self.place, self.law)
        return any(a is not None for a in does) or self.poses or self.clock != 0

    @property
    def scatter(self) -> bool:
        """Return whether it changes how things scatter, not where."""
        does = (self.sd, self.dens, self.lost, self.common, self.noise, self.growth)
        return any(a is not None for a in does) or self.step != 0

    @property
    def ranges(self) -> bool:
        """Return whether mean readings change by it."""
        does = (self.mount, self.scan_time, self.walls, self.mean)
        return any(a is not None for a in does) or self.poses or self.stretch != 0 or self.clock != 0


@dataclass(frozen=True)
class Draw:
    """What a cause is drawn from: dice, the scene, its size, the size with a sign, and whether its form is another."""

    rng: Rng
    scene: Scene
    size: float
    signed: float
    other: bool = False

    @property
    def far(self) -> float:
        """Return how far the laser sees, in a room."""
        return min(self.scene.laser.far, 12.0)


Maker = Callable[[Cause, Draw], None]
