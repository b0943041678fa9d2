# SPDX-License-Identifier: BSD-3-Clause
"""What a hidden fault of a laser is worth: z against the noise of readings and the errors of the reference's poses.

Mean signals: the readings' noise is known, neighbours' correlation and the scans' common mode included; each stop, or
each scan of a drive, has an error of its pose with the stated deviations, which takes its part of the signal away.
Beams that come to meet another box have jumped, and those more than 78 degrees oblique hardly come back: both count
as nothing. Offsets of single beams, where the background has them, are those of patches of neighbours. Rounding other
than its variance is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu
from scipy.stats import norm, t

from kurumaisu.bench.hidden.generator import laws
from kurumaisu.bench.hidden.generator.motion import STEP, Fault, Form, Sizes
from kurumaisu.bench.hidden.generator.scanning import BEAM_TIME, MOUNT, Scans, expected
from kurumaisu.bench.hidden.generator.tours import REFERENCE_TIME, Tour
from kurumaisu.bench.hidden.laser.catalogue import LASER
from kurumaisu.bench.hidden.laser.forms import box_turned
from kurumaisu.bench.hidden.laser.usual_effects import Backdrop
from kurumaisu.types import BoolArray, FloatArray

_PART = 1e-5
_OBLIQUE = 0.2  # least cosine of the incidence that counts
_JUMP = 0.05  # [m/s, rad/s] from one step of the integration to the next, more than the noise of the rates
_SELDOM = 1e-4  # share of readings that are wild anyway
_PATCH = 22  # neighbouring beams, over which signals hardly change
# Nobody says at which temperature a laser reads right, so an effect of the temperature has any offset it likes.
_BESIDE = {"laser.temperature": "laser.offset"}
EVERY = 5  # of the scans, the first of so many is looked at and stands for all


class LaserScale:
    """What faults are worth on a given tour."""

    def __init__(self, tour: Tour, backdrop: Backdrop) -> None:
        """Look once without faults."""
        self.tour, self._backdrop = tour, backdrop
        self.nominal = expected(tour, (), EVERY)
        self._wider: FloatArray | float = 1.0
        self._seen = seen(self.nominal) & ~jolted(tour, self.nominal)[:, None]
        self.count = sum(len(leg.stamps) for leg in tour.legs) / len(self.nominal.stamps)

    def noisier(self, faults: Sequence[Fault]) -> LaserScale:
        """Return the same where readings have the noise of these faults, too: beside it, others are worth less."""
        out = copy(self)
        for fault in faults:
            if fault.form.stage == "sd":
                out._wider = out._wider * fault.form.act(self.nominal, fault.sizes).sd / self.nominal.sd
        return out

    def signal(self, fault: Fault) -> FloatArray:
        """Return the change of the mean readings (s, b) [m].

        Of what moves beams it is that of a tiny part of the size, scaled up, so that hardly any leave their wall.
        """
        part = _PART if fault.form.stage == "aim" and fault.form != LASER["laser.tilt"].plain else 1.0
        changed = expected(self.tour, [Fault(fault.form, {**fault.sizes, "size": part * fault.sizes["size"]})], EVERY)
        same = self._seen & (changed.box == self.nominal.box)
        return np.where(same, changed.mean - self.nominal.mean, 0.0) / part

    def gram(self, signals: FloatArray) -> FloatArray:
        """Return the products (k, k) of whitened signals (s, b, k): z squared on the diagonal."""
        k, offsets = signals.shape[2], self._beam_columns()
        products = self._without_poses(np.concatenate([signals, offsets], axis=2))
        cross = products[:k, k:]
        return np.asarray(
            products[:k, :k] - cross @ np.linalg.solve(products[k:, k:] + np.eye(offsets.shape[2]), cross.T)
        )

    def _beam_columns(self) -> FloatArray:
        """Return what one sd of the mean offset of each patch of beams does, (s, b, patches); none without offsets."""
        sd = self._backdrop.beam_sd
        patches = np.arange(self._seen.shape[1]) // _PATCH
        mine = patches[:, None] == np.unique(patches)[: None if sd > 0 else 0]
        return np.where(self._seen[..., None], mine * sd / np.sqrt(_PATCH), 0.0)

    def per_scan(self) -> FloatArray:
        """Return how closely its readings know 1 m of a whole scan (s,) [1/m^2], beside errors of its poses in a drive.

        While the chair stands, an error of its pose is the same in all scans.
        """
        products = self._products(np.empty((*self._seen.shape, 0)))
        whole = products[:, -1, -1]
        if not self.tour.moving:
            return np.asarray(whole)
        position, heading = self.tour.truth
        prior = np.tile([position**-2, position**-2, heading**-2], (products.shape[1] - 1) // 3)
        cross = products[:, :-1, -1:]
        return np.asarray(whole - (cross * np.linalg.solve(products[:, :-1, :-1] + np.diag(prior), cross)).sum((1, 2)))

    def _products(self, signals: FloatArray) -> FloatArray:
        """Return the products (s, k + n, k + n) of whitened signals (s, b, k) and what `_pose_columns` are."""
        sd = np.hypot(self.nominal.sd * self._wider, 0.001 / np.sqrt(12))
        effects = np.where(self._seen[..., None], self._pose_columns(), 0.0)
        white = _unchained(np.concatenate([signals, effects], axis=2) / sd[..., None], self._backdrop.beam_rho)
        return np.asarray(white.transpose(0, 2, 1) @ white)

    def _without_poses(self, signals: FloatArray) -> FloatArray:
        """Return the products of whitened signals without what errors of poses and of whole scans explain."""
        k, products = signals.shape[2], self.count * self._products(signals)
        return np.asarray(products[:, :k, :k].sum(axis=0) - self._taken(products, k))

    def _taken(self, products: FloatArray, k: int) -> FloatArray:
        """Return the products' part that errors of poses and of whole scans explain, (k, k)."""
        group = np.unique(self.nominal.stop, return_inverse=True)[1]
        scans, own = len(group), products.shape[1] - k - 1
        groups, common = int(group.max()) + 1, self._backdrop.common_sd > 0
        effects = own + common
        place = np.column_stack([own * group[:, None] + np.arange(own), own * groups + np.arange(scans)])[:, :effects]
        size = own * groups + (scans if common else 0)
        rows = np.repeat(place[:, :, None], effects, axis=2).ravel()
        columns = np.repeat(place[:, None, :], effects, axis=1).ravel()
        inner = sparse.coo_matrix(
            (products[:, k : k + effects, k : k + effects].ravel(), (rows, columns)), (size, size)
        )
        outer = np.zeros((size, k))
        np.add.at(outer, place, products[:, k : k + effects, :k])
        position, heading = self.tour.truth
        # A stop has one pose; of the scans of a drive that one stands for, each has its own.
        poses = self.count if self.tour.moving else 1.0
        prior = np.tile([poses / position**2, poses / position**2, poses / heading**2], groups * own // 3)
        whole = sparse.diags(prior) if not common else sparse.block_diag([sparse.diags(prior), self._whole(scans)])
        solved = splu(sparse.csc_matrix(inner + whole)).solve(outer)
        return np.asarray(outer.T @ solved)

    def _whole(self, scans: int) -> FloatArray:
        """Return the precision (scans, scans) of the mean common mode of the scans that each looked at stands for."""
        each = round(self.count)
        every = np.arange(scans * each)
        common = self._backdrop.common_sd**2 * self._backdrop.common_rho ** np.abs(np.subtract.outer(every, every))
        return np.asarray(np.linalg.inv(common.reshape(scans, each, scans, each).mean(axis=(1, 3))))

    def _pose_columns(self) -> FloatArray:
        """Return what errors of poses and 1 m of a whole scan do, (s, b, 4), or (s, b, 10) of a drive.

        1 m of x, 1 m of y, 1 rad of heading of base_link; while it drives, of each pose of the reference around a scan.
        """
        c = self.nominal
        ux, uy = np.cos(c.angles), np.sin(c.angles)
        nx, ny = c.normal[..., 0], c.normal[..., 1]
        facing = nx * ux + ny * uy
        facing = np.where(self._seen, facing, 1.0)
        lever_x, lever_y = -np.sin(c.headings) * MOUNT[0], np.cos(c.headings) * MOUNT[0]
        reach = np.where(np.isfinite(c.ranges), c.ranges, 0.0)
        turned_x = lever_x[:, None] - reach * uy
        turned_y = lever_y[:, None] + reach * ux
        rigid = np.stack([-nx / facing, -ny / facing, -(nx * turned_x + ny * turned_y) / facing], axis=-1)
        if self.tour.moving:  # errors of neighbouring poses are independent, and a scan rests on three of them
            since = BEAM_TIME * np.arange(rigid.shape[1]) / REFERENCE_TIME
            hats = np.maximum(1 - np.abs(since[:, None] - np.arange(3)), 0.0)
            rigid = (hats[:, :, None] * rigid[:, :, None, :]).reshape(*ux.shape, 9)
        return np.concatenate([rigid, np.ones_like(ux)[..., None]], axis=-1)

    def rivals(self, names: Sequence[str], hidden: Sequence[str] = ()) -> list[tuple[str, FloatArray]]:
        """Return rivals by name with their signals (s, b, k) at typical sizes, of which any sum is that rival.

        A name comes more than once where it has shapes whose sum is none, such as two time constants.
        hidden: what they are rivals of, which no rival may have in it.
        """
        out = []
        for name in names:
            if name == "world.map_error":
                out.append((name, self._walls()))
                continue
            for shapes in _shapes(name):
                faults = [LASER[name].fault(shape, "plain") for shape in shapes]
                if name in _BESIDE and _BESIDE[name] not in hidden:
                    faults.append(LASER[_BESIDE[name]].fault({"size": 1e-3}, "plain"))
                out.append((name, np.stack([self.signal(fault) for fault in faults], axis=-1)))
        return out

    def _walls(self) -> FloatArray:
        """Return what moving each wall by 5 mm along x and y does, and turning it by 2 mrad."""
        columns, c = [], self.nominal
        facing = c.normal[..., 0] * np.cos(c.angles) + c.normal[..., 1] * np.sin(c.angles)
        facing = np.where(self._seen, facing, 1.0)
        for i in range(len(self.tour.room)):
            for axis in range(2):
                columns.append(np.where(self._seen & (c.box == i), 0.005 * c.normal[..., axis] / facing, 0.0))
            columns.append(self.signal(Fault(Form("aim", box_turned), {"size": 0.002, "box": float(i)})))
        return np.stack(columns, axis=-1)


def _shapes(name: str) -> list[list[Sizes]]:
    """Return sizes of a rival: any sum of what those of one inner list do is one, none across two inner lists."""
    hidden = LASER[name]
    base = {"size": hidden.typical, **hidden.extra(np.random.default_rng(0))}
    free = {
        "laser.warmup": [[{"tau": tau}] for tau in (200.0, 600.0, 2400.0)],
        "laser.cyclic": [
            [{"wavelength": wave, "phase": phase} for phase in (0.0, np.pi / 2)] for wave in (0.8, 1.4, 2.5)
        ],
        "laser.tilt": [[{"bearing": bearing} for bearing in (0.0, np.pi / 4, np.pi / 2)]],
        "laser.beam_bias": [[{"phase": phase} for phase in (0.0, np.pi / 2)]],
    }
    return [[{**base, **shape} for shape in shapes] for shapes in free.get(name, [[{}]])]


def _unchained(columns: FloatArray, rho: float) -> FloatArray:
    """Return columns (s, b, k) with the neighbours' AR(1) correlation taken out."""
    if rho == 0:
        return columns
    out = columns.copy()
    out[:, 1:] = (columns[:, 1:] - rho * columns[:, :-1]) / np.sqrt(1 - rho**2)
    return out


def jolted(tour: Tour, scans: Scans) -> BoolArray:
    """Return the scans (s,) of a drive in which, or beside which, a rate jumps: no reference shows when exactly."""
    out = np.zeros(len(scans.stamps), dtype=bool)
    for i, leg in enumerate(tour.legs if tour.moving else ()):
        rates = np.diff(leg.path, axis=0) / STEP
        kinks = STEP * (1 + np.flatnonzero((np.abs(np.diff(rates, axis=0)) > _JUMP).any(axis=1)))
        mine = scans.leg == i
        since = scans.stamps[mine][:, None] - kinks
        out[mine] = ((since < REFERENCE_TIME) & (since > -3 * REFERENCE_TIME)).any(axis=1)
    return out


def seen(scans: Scans) -> BoolArray:
    """Return which beams (s, b) have a reading that counts."""
    return np.isfinite(scans.ranges) & (scans.mean < laws.LASER_FAR) & (scans.cosine > _OBLIQUE)


def spread_z(nominal: Scans, changed: Scans, count: float) -> float:
    """Return z of another deviation of the readings: the root of twice the log likelihood ratio that is expected."""
    q = (changed.sd / nominal.sd)[seen(nominal)]
    return float(np.sqrt(count * (q**2 - 1 - 2 * np.log(q)).sum()))


def odd_z(name: str, sizes: Sizes, scale: LaserScale) -> float:
    """Return z of what is neither mean nor deviation, by its likelihood ratio per reading."""
    nominal, count = scale.nominal, scale.count
    valid = np.isfinite(nominal.ranges) & (nominal.mean < laws.LASER_FAR)
    readings, size = count * valid.sum(), sizes["size"]
    near = nominal.ranges[:, :-1], nominal.ranges[:, 1:]
    with np.errstate(invalid="ignore"):
        jumps = count * (valid[:, :-1] & valid[:, 1:] & (np.abs(near[0] - near[1]) > 0.1)).sum()
    beyond = count * (valid & (nominal.mean > 1 / max(size, 1e-9))).sum()
    common = 1 + size**2 * scale.per_scan()
    worth = {
        "laser.mixed_pixels": lambda: 2 * jumps * _bernoulli(size),
        "laser.dropout": lambda: 2 * readings * _bernoulli(size),
        "laser.crosstalk": lambda: 2 * readings * sizes["width"] / (2 * np.pi) * _bernoulli(size),
        "laser.saturation": lambda: 2 * beyond * -np.log(_SELDOM),
        "laser.quantisation": lambda: 2 * readings * np.log(max(size / 0.001, 1.0)),
        "laser.common_mode": lambda: count * (common - 1 - np.log(common)).sum(),
        "laser.beam_correlation": lambda: -readings * np.log(1 - min(size, 0.99) ** 2),
        "laser.heavy_tails": lambda: 2 * readings * _tails(size),
    }
    return float(np.sqrt(worth[name]()))


def _bernoulli(p: float) -> float:
    p = min(max(p, 1e-9), 1 - 1e-9)
    return float(p * np.log(p / _SELDOM) + (1 - p) * np.log((1 - p) / (1 - _SELDOM)))


def _tails(inverse_nu: float) -> float:
    nu = 1 / inverse_nu
    x = np.linspace(-60, 60, 24001)
    scale = np.sqrt((nu - 2) / nu)
    log_t = t.logpdf(x, nu, scale=scale)
    return float(np.sum(np.exp(log_t) * (log_t - norm.logpdf(x))) * (x[1] - x[0]))


MEANS = tuple(name for name, hidden in LASER.items() if hidden.by == "mean")
