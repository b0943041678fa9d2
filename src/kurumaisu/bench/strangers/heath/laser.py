# SPDX-License-Identifier: BSD-3-Clause
"""Rooms of pixels, their Stage world, a ray caster; the laser with equation (4), and its part of the catalogue."""

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace as Scans
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from .chair import TOOLS, Hidden, Run, apply, cell, pose, table

Array = NDArray[Any]
WORLD = """define floorplan model ( color "gray30" boundary 0 gui_nose 0 gui_outline 0 gripper_return 0 )

floorplan
(
  name "room"
  bitmap "room.png"
  size [{:.3f} {:.3f} 1.000]
  pose [{:.4f} {:.4f} 0 0]
)
"""


@dataclass
class Room:
    """Occupied pixels (row 0 is the lowest y), their size, the lower left corner, and the walls."""

    taken: Array
    pixel: float
    x0: float
    y0: float
    walls: Array  # rows: 0 vertical or 1 horizontal, coordinate, from, to, normal's sign

    def clearance(self) -> Array:
        """Return the distance [m] of each free pixel from the nearest wall."""
        return np.asarray(ndimage.distance_transform_edt(~self.taken) * self.pixel)

    def clear(self, field: Array, x: Array, y: Array) -> Array:
        """Return values of a field of the picture's shape at points."""
        row, col = (((np.asarray(q) - o) / self.pixel).astype(int) for q, o in ((y, self.y0), (x, self.x0)))
        return np.asarray(field[np.clip(row, 0, field.shape[0] - 1), np.clip(col, 0, field.shape[1] - 1)])

    def write(self, folder: Path) -> None:
        """Write room.world and room.png, with the walls black up to the picture's border."""
        rows, cols = self.taken.shape
        raw = b"".join(b"\0" + line.tobytes() for line in np.where(self.taken, 0, 255).astype(np.uint8)[::-1])
        head = struct.pack(">IIBBBBB", cols, rows, 8, 0, 0, 0, 0)
        parts = (b"IHDR" + head, b"IDAT" + zlib.compress(raw), b"IEND")
        (folder / "room.png").write_bytes(
            b"\x89PNG\r\n\x1a\n"
            + b"".join(struct.pack(">I", len(part) - 4) + part + struct.pack(">I", zlib.crc32(part)) for part in parts)
        )
        w, h = cols * self.pixel, rows * self.pixel
        (folder / "room.world").write_text(WORLD.format(w, h, self.x0 + w / 2, self.y0 + h / 2))


def segments(taken: Array, pixel: float, x0: float, y0: float) -> Array:
    """Return the maximal segments between free and taken pixels."""
    out = []
    for kind, grid, o, p in ((0, taken, x0, y0), (1, taken.T, y0, x0)):
        change = grid[:, 1:].astype(int) - grid[:, :-1]
        for sign in (-1, 1):
            for k in np.flatnonzero((change == sign).any(axis=0)):
                edge = np.diff(np.concatenate(([0], (change[:, k] == sign).astype(int), [0])))
                out += [
                    (kind, o + (k + 1) * pixel, p + a * pixel, p + b * pixel, -sign)
                    for a, b in zip(np.flatnonzero(edge == 1), np.flatnonzero(edge == -1), strict=True)
                ]
    return np.array(out, float)


def build(rng: np.random.Generator, shape: str = "") -> Room:
    """Return a room with furniture: rectangle, L, T, two rooms with a door, corridor; `hall` is long and empty."""
    pixel = float(rng.choice([0.02, 0.025, 0.04, 0.05]))
    shape = shape or str(rng.choice(["box", "box", "ell", "tee", "corridor", "two"]))
    w, h = {"hall": (14.5, 5.0), "corridor": (rng.uniform(8, 14), rng.uniform(2.4, 3.4))}.get(
        shape, (rng.uniform(4.2, 10), rng.uniform(4.2, 8))
    )
    parts = [(0.0, 0.0, w, h)]
    if shape in ("ell", "tee", "corridor"):
        at = {"ell": 0.0, "tee": w / 2 - 1.2, "corridor": rng.uniform(0, w - 3)}[shape]
        parts.append((at, h - 0.1, rng.uniform(2.4, 4), rng.uniform(2.5, 5)))
    if shape == "two":
        parts += [(w - 0.05, h / 2 - 0.8, 0.8, 1.7), (w + 0.5, rng.uniform(-1, 0.5), rng.uniform(3, 4.5), h)]
    parts = [(a, b, min(c, 14.5 - a), d) for a, b, c, d in parts]
    low = np.min([p[:2] for p in parts], axis=0) - 0.2
    high = np.max([(a + c, b + d) for a, b, c, d in parts], axis=0) + 0.2
    free = np.zeros(np.ceil((high - low) / pixel).astype(int)[::-1], bool)

    def box(a: float, b: float, c: float, d: float) -> tuple[slice, slice]:
        i, j = round((b - low[1]) / pixel), round((a - low[0]) / pixel)
        return slice(i, i + max(2, round(d / pixel))), slice(j, j + max(2, round(c / pixel)))

    for part in parts:
        free[box(*part)] = True
    free[:3] = free[-3:] = free[:, :3] = free[:, -3:] = False
    before = (ndimage.distance_transform_edt(free) * pixel > 0.55).sum()
    for _ in range(0 if shape == "hall" else int(rng.integers(2, 9))):
        trial = free.copy()
        trial[box(*rng.uniform(low, high), *rng.uniform(0.15, 1.3, 2))] = False
        names, count = ndimage.label(ndimage.distance_transform_edt(trial) * pixel > 0.55)
        if count and np.bincount(names.ravel())[1:].max() > 0.45 * before:
            free = trial
    x0, y0 = map(float, rng.uniform(-5, 5, 2).round(2) if rng.random() < 0.5 else -(high - low).round(1) / 2)
    return Room(~free, pixel, x0, y0, segments(~free, pixel, x0, y0))


def cast(walls: Array, x: Array, y: Array, a: Array) -> tuple[Array, Array]:
    """Return range, and cosine of the incidence, of rays from (x, y) in direction a."""
    best, cosine = np.full(a.size, 99.0), np.full(a.size, 0.02)
    flat = [np.ravel(q) for q in (x, y, np.cos(a), np.sin(a))]
    for start in range(0, a.size, 16384):
        part = slice(start, start + 16384)
        o, d, near, slant = [q[part] for q in flat[:2]], [q[part] for q in flat[2:]], best[part], cosine[part]
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1 / d[0], 1 / d[1]
            for m, at, low, high, normal in walls:
                m = int(m)
                t = (at - o[m]) * inverse[m]
                other = o[1 - m] + t * d[1 - m]
                hit = (t > 0) & (t < near) & (other >= low) & (other <= high) & (d[m] * normal < 0)
                near[hit] = t[hit]
                slant[hit] = np.abs(d[m][hit])
    return best.reshape(a.shape), np.maximum(cosine, 0.02).reshape(a.shape)


@dataclass
class Fan:
    """Directions of the beams and the time between them."""

    angle_min: float
    increment: float
    beams: int
    between: float


def look(room: Room, fan: Fan, run: Run, times: Array, causes: list[Hidden], off: Array | float = 0.0) -> Scans:
    """Return what scans first fired at `times` (by their stamps) should read: mean, spread, and what they depend on."""
    beam, t = np.arange(fan.beams), times[:, None]
    g = Scans(
        t=t,
        all=run.start + t,
        run=run.number,
        walls=room.walls,
        mx=0.3,
        my=0.0,
        myaw=0.0,
        between=fan.between,
        late=0.0 * t,
        columns=run.columns,
        beam=beam,
        beta=fan.angle_min + beam * fan.increment,
    )
    apply(causes, "geo", g)
    at = pose(run, np.clip(t + g.late + g.between * beam, 0, run.length)) + off
    c, s = np.cos(at[..., 2]), np.sin(at[..., 2])
    g.direction = at[..., 2] + g.beta
    x, y = at[..., 0] + c * g.mx - s * g.my, at[..., 1] + s * g.mx + c * g.my
    g.r, cosine = cast(g.walls, x, y, g.direction + g.myaw)
    g.sec, g.slant = 1 / cosine, np.arccos(np.minimum(cosine, 1))
    k = cell(run, t)
    g.v, g.w = run.path.model.v[k], run.path.model.w[k]
    g.jump = np.abs(np.diff(g.r, axis=1)) > 0.12 + 0.02 * g.r[:, 1:]
    g.edge = np.pad(g.jump, ((0, 0), (0, 1))) | np.pad(g.jump, ((0, 0), (1, 0)))
    g.mu, g.sd = 1.004587 * g.r + 0.058826, 0.000199 * g.r**2 - 0.000488 * g.r + 0.002334
    apply(causes, "mean", g)
    apply(causes, "sd", g)
    return g


def read(g: Scans, causes: list[Hidden], rng: np.random.Generator) -> Array:
    """Return readings with noise, a grid of 1 mm and the gate; nan is no valid reading, inf no return."""
    g.rng = np.random.default_rng(rng.integers(2**62))
    g.eps = rng.standard_normal(g.r.shape)
    apply(causes, "eps", g)
    g.value = g.mu + g.sd * g.eps
    apply(causes, "read", g)
    value = np.round(g.value, 3)
    return np.where(value > 4.0, np.inf, np.where(value < 0.06, np.nan, value))


def chain(g: Scans, rho: float, axis: int) -> Array:
    """Return a first-order process of variance 1 over scans (axis 0, one for all beams) or over beams (1)."""
    z = np.moveaxis(g.rng.standard_normal(g.eps.shape if axis else (g.eps.shape[0], 1)), axis, 0)
    for k in range(1, len(z)):
        z[k] = rho * z[k - 1] + np.sqrt(1 - rho * rho) * z[k]
    return np.moveaxis(z, 0, axis)


def mixed(g: Scans, a: float, low: float, high: float) -> Array:
    """Return readings with, at jumps and with probability a, a point between both sides."""
    out, left, right = g.value.copy(), g.value[:, :-1], g.value[:, 1:]
    hit = g.jump & (g.rng.random(g.jump.shape) < a) & (g.r[:, 1:] < 5) & (g.r[:, :-1] < 5)
    part = g.rng.uniform(low, high, hit.shape)
    out[:, 1:] = np.where(hit, part * left + (1 - part) * right, right)
    return np.asarray(out)


def lost(g: Scans, chance: Array | float, wide: int = 1) -> Array:
    """Return readings that are not valid by chance, `wide` beams at a time."""
    gone = g.rng.random(g.value.shape) < chance / wide
    for _ in range(wide - 1):
        gone[:, 1:] |= gone[:, :-1].copy()
    return np.where(gone, np.nan, g.value)


def other(g: Scans, a: float, drift: float, width: float, reach: float, every: int = 1) -> Array:
    """Return readings with random ranges in a sector that drifts, in a share `a` of the scans."""
    middle = np.mod(drift * g.all + g.rng.uniform(-0.2, 0.2, g.t.shape), 4.0) - 2.0
    on = (np.abs(g.beta - middle) < width / 2) & (g.beam % every == 0) & (g.rng.random(g.t.shape) < a)
    return np.where(on, g.rng.uniform(0.06, reach, g.value.shape), g.value)


def moved(walls: Array, scale: float, shifts: Array | float) -> Array:
    """Return walls that lie elsewhere than in the map, ends lengthened a little so that corners stay shut."""
    out, pad = walls * np.array([1, *[1 + scale] * 3, 1]), 2 * np.max(np.abs(shifts))
    out[:, 1] += shifts
    return np.asarray(out + np.array([0, 0, -pad, pad, 0]))


TOOLS |= {f.__name__: f for f in (chain, mixed, lost, other, moved)}
TOOLS |= {  # range at an elevation, 0.4 m above the floor; the same normal numbers for the same draw
    "tilted": lambda r, up: np.minimum(r / np.cos(up), 0.4 / np.sin(np.maximum(-up, 1e-3))),
    "normals": lambda draw, count: np.clip(np.random.default_rng(int(draw)).standard_normal(count), -2.5, 2.5),
}
LASER = table(
    """
mount_x | geo x 0.008 0.05 ± each | mx += a
mount_y | geo y 0.008 0.05 ± each | my += a
mount_yaw | geo yaw 0.005 0.05 ± each | myaw += a
tilt | mean pitch 0.03 0.08 ± | mu = 1.004587 * tilted(r, -a * cos(beta)) + 0.058826
sweep | geo stretch 0.3 0.65 ± | between *= 1 + a
latency | geo delay 0.01 0.1 + | late -= a | grows until it is reset: late -= 2 * a * mod(t / 15, 1) | another in each
  scan: late -= 2 * a * mod(sin(t * 129.898) * 437.585, 1)
clock_skew | geo skew 0.0001 0.001 ± | late -= a * t | faster as it warms up: late -= a * t**2 / 60
offset | mean offset 0.003 0.03 ± each | mu += a
scale | mean scale 0.002 0.02 ± | mu += a * r | beyond a metre: mu += 1.5 * a * max(r - 1, 0)
quadratic | mean quadratic 0.001 0.005 ± | mu += a * r**2 | cubic: mu += a * r**3 / 3
warmup | mean amplitude 0.006 0.03 ± tau:120:500 | mu += a * (1 - exp(-all / tau)) | a hyperbola: mu += a * all / (all
  + tau) | two paces: mu += a * (1 - 0.5 * exp(-all / 40) - 0.5 * exp(-all / 500))
temperature | mean coefficient 0.0005 0.003 ± | mu += a * (temperature(all) - 20) | with the square: mu += a *
  (temperature(all) - 16)**2 / 10 | follows late: mu += a * (temperature(all - 90) - 20)
cyclic | mean amplitude 0.002 0.01 + wavelength:0.8:3.2 phase:-3:3 | mu += a * sin(2 * pi * r / wavelength + phase) |
  triangles: mu += a * 2 / pi * arcsin(sin(2 * pi * r / wavelength + phase)) | fades with range: mu += 2 * a * exp(-r /
  1.5) * sin(2 * pi * r / wavelength + phase)
incidence_bias | mean k 0.002 0.01 ± | mu += a * min(sec - 1, 5) | with the square: mu += a * slant**2 | beyond 45
  degrees: mu += 3 * a * max(slant - pi / 4, 0)
beam_bias | mean sd 0.001 0.005 + draw:0:1e+06 | mu += a * normals(draw, r.shape[1]) | facets of the mirror: mu += a *
  sign(sin(3 * beta + draw)) | a bow over the fan: mu += a * (beta**2 / 2 - 0.7)
range_noise | sd share 0.15 1.5 + | sd *= 1 + a | far only: sd *= 1 + 2 * a * max(r - 1.5, 0) | with the root of the
  range: sd *= 1 + 0.7 * a * sqrt(r)
incidence_noise | sd gain 0.15 1.5 + | sd *= 1 + a * min(sec - 1, 8) | beyond 45 degrees: sd *= 1 + 4 * a * max(slant -
  pi / 4, 0)
common_mode | eps sd 0.001 0.005 + rho:0:0.95 | eps += a / s.sd * chain(s, rho, 0) | hums: eps += 1.4 * a / s.sd *
  sin(all * 17.3)
beam_correlation | eps rho 0.15 0.6 + | eps = chain(s, a, 1) | three share: eps = (eps + a * roll(eps, 1, 1) + a *
  roll(eps, 2, 1)) / sqrt(1 + 2 * a * a)
heavy_tails | eps inverse_nu 0.2 0.28 + | eps = sqrt(1 - 2 * a) * rng.standard_t(1 / a, eps.shape) | a share is wild:
  eps *= where(rng.random(eps.shape) < 0.1 * a, 8, 1) | two-sided exponential: eps = rng.laplace(0, 0.71, eps.shape)
mixed_pixels | read probability 0.3 0.65 + | value = mixed(s, a, 0, 1) | the middle: value = mixed(s, a, 0.45, 0.55)
dropout | read probability 0.02 0.2 + | value = lost(s, a) | several beams at once: value = lost(s, a, 5) | beyond two
  metres: value = lost(s, clip(2 * a * (r - 2), 0, 1))
saturation | read inverse_far 0.28 0.5 + | value = where(value > 1 / a, 9.0, value) | reads the largest value: value =
  min(value, 1 / a)
crosstalk | read probability 0.1 0.5 + width:0.1:0.5 drift:-0.6:0.6 reach:3:4 | value = other(s, a, drift, width,
  reach) | in stripes: value = other(s, a, drift, 2.0, reach, 7)
quantisation | read step 0.008 0.03 + | value = steps(value, a) | coarser far out: value = where(value < 1, value,
  steps(value, 1.5 * a))
world.map_error | geo sd 0.004 0.02 + draw:0:1e+06 | walls = moved(walls, 0, a * normals(draw, len(walls))) | some
  walls only: walls = moved(walls, 0, 2 * a * (normals(draw, len(walls)) > 0.5)) | another scale: walls = moved(walls,
  a, 0)
""",
    "laser.",
)
