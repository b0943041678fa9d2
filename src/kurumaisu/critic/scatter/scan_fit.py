# SPDX-License-Identifier: BSD-3-Clause
"""What common modes and errors of poses may have done to each scan, fitted to it and taken out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kurumaisu.critic.ranges.noise.reading_noise import expected_readings
from kurumaisu.critic.ranges.noise.shared_errors import Layout, ScanNoise, correlations
from kurumaisu.critic.ranges.search.normal_equations import Assembly
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import BoolArray, FloatArray, IntArray

_COMMON = 0.005  # [m] plausible common mode of a scan, when it is read off one scan alone
_OBLIQUE = np.radians(80.0)  # [rad] beyond which no reading counts
_LEVER = 0.5  # [m] from base_link to a laser, at most
_ROUNDS = 3
_SOME = 4  # every so-manieth reading says how wide all are


def basis_of(assembly: Assembly, noise: ScanNoise) -> tuple[FloatArray, FloatArray]:
    """Return (k, b, q) what readings do by a common mode and by errors of the poses, and their sds (k, q).

    Of the poses first x, y, yaw of what is the same for all under a scan: what lasts, and in a stand there is no other.
    """
    parts = [assembly.random_columns(k) for k in range(len(assembly.residual))]
    widest = max(part.shape[1] for part in parts)
    basis = np.zeros((len(parts), parts[0].shape[0], widest))
    size = np.full((len(parts), widest), 1e-6)
    plausible = replace(noise, common_sd=_COMMON)
    for k, part in enumerate(parts):
        basis[k, :, : part.shape[1]] = part
        size[k, : part.shape[1]] = assembly.random_sds(k, plausible)
    return basis, np.maximum(size, 1e-6)


def drawn_errors(size: FloatArray, layout: Layout, tau: float, rng: np.random.Generator) -> FloatArray:
    """Return errors (k, q) of sds (k, q) as of basis_of, of the poses alone; tau [s]: for which what lasts does so."""
    draws = rng.standard_normal(size.shape)
    for k, rho in enumerate(correlations(layout.times, layout.run, tau).tolist(), 1):
        draws[k, 1:4] = rho * draws[k - 1, 1:4] + np.sqrt(1 - rho**2) * draws[k, 1:4]
    for stand in np.unique(layout.stand[layout.stand >= 0]):  # scans of one pose have its one error
        draws[layout.stand == stand] = draws[np.flatnonzero(layout.stand == stand)[0]]
    draws[:, 0] = 0.0
    return draws * size


def steepest(ranges: FloatArray, angles: FloatArray) -> FloatArray:
    """Return how much the reading of a beam (k, b, 4) follows common mode, x, y [1] and yaw [m/rad] at most.

    A finite difference over the edge of a wall finds far more, where in truth the beam meets the one wall or the other.
    """
    along = 1 / np.cos(np.minimum(angles, _OBLIQUE))
    reach = np.where(np.isfinite(ranges), ranges, 0.0) + _LEVER
    return np.stack([np.ones_like(along), along, along, reach * along], axis=-1)


def fluctuating(z: FloatArray, inside: BoolArray, stand: IntArray) -> tuple[FloatArray, BoolArray]:
    """Return what of some numbers (k, b) differs from scan to scan, as far as if nothing were common, and where (k, b).

    inside (k, b): which of them count; stand (k,). What a beam reads in all scans of a stand, an offset of its own or a
    rough wall leaves: neighbours may share it, and by it readings may be farther off here than there, but it is no
    noise. Scans that stand alone, as in a drive, have what a beam keeps in all of them taken out.
    """
    _, group, count = np.unique(stand, return_inverse=True, return_counts=True)
    group = np.where((stand >= 0) & (count[group] > 1), group + 1, 0)
    member = (np.arange(len(count) + 1)[:, np.newaxis] == group).astype(float)
    number = member @ inside
    mean = (member @ np.where(inside, z, 0.0)) / np.maximum(number, 1.0)
    lost = np.sqrt(number / np.maximum(number - 1, 1.0))  # what is off a mean of two is off by less than each
    known = np.asarray(inside & (number > 1)[group])
    return np.where(known, (z - mean[group]) * lost[group], 0.0), known


class ScanFit:
    """The fit of some readings of each scan."""

    def __init__(
        self,
        basis: FloatArray,
        size: FloatArray,
        sd: FloatArray,
        trust: BoolArray,
        stand: IntArray,
        moved: FloatArray,
    ) -> None:
        """Take basis (k, b, q), sizes (k, q), deviations (k, b) [m], and stands (k,) as of a layout.

        trust (k, b): readings that say anything; moved (k, b) [m]: what errors of the poses do that are known already.
        """
        self._sd, self._trust, self._stand, self._moved = sd, trust, stand, moved / sd
        weighed = np.asarray(basis * (trust / sd)[:, :, np.newaxis])
        inner = np.asarray(weighed.transpose(0, 2, 1) @ weighed, dtype=np.float64)
        inner = inner + np.eye(inner.shape[1]) * (size**-2)[:, np.newaxis, :]
        inverse = np.linalg.inv(inner)
        self._solve = (inverse @ weighed.transpose(0, 2, 1)).astype(np.float32)  # half the memory, twice as fast
        self._fitted = (basis / sd[:, :, np.newaxis]).astype(np.float32)
        self._reach = np.sqrt(np.sum((basis * size[:, np.newaxis, :]) ** 2, axis=2)) / sd
        drawn = np.where(np.arange(size.shape[1]) > 0, size, 0.0)
        self._common_sd = _common_sd(inner, inverse, size, drawn)
        self._noise_sd = _common_sd(inner, inverse, size, np.zeros_like(size))

    def leftover(self, error: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what poses and common mode leave of the errors (k, b), and the common modes (k,), in deviations.

        Missing readings and outliers take the value that the others give them.
        """
        z = error / self._sd
        known = self._trust & np.isfinite(z)
        fitted, inside = expected_readings(z, known, self._reach, self._moved)
        coefficients = np.zeros(self._solve.shape[:2])
        for _ in range(_ROUNDS):
            filled = np.where(inside, np.nan_to_num(z), fitted).astype(np.float32)
            coefficients = (self._solve @ filled[:, :, np.newaxis])[:, :, 0]
            fitted = (self._fitted @ coefficients[:, :, np.newaxis])[:, :, 0]
            left = np.abs((z - fitted)[inside])[::_SOME]
            width = SIGMA_PER_MAD * float(np.median(left)) if left.size else 1.0
            inside = known & (np.abs(np.nan_to_num(z - fitted)) < 4.5 * max(width, 0.1))
        return np.where(known, z - fitted, np.nan), self._fluctuating(coefficients[:, 0])

    def _fluctuating(self, common: FloatArray) -> FloatArray:
        """Return common modes (k,) [m] in deviations, of a stand's scans what differs from one to the next.

        What all of them share, an error of the pose, of the map or of an equation leaves as well: it fluctuates not.
        """
        _, stand, count = np.unique(self._stand, return_inverse=True, return_counts=True)
        within = (self._stand >= 0) & (count[stand] > 1)
        mean = (np.bincount(stand, common) / count)[stand]
        alone = np.sqrt(count[stand] / np.maximum(count[stand] - 1, 1))
        return np.where(within, (common - mean) * alone / self._noise_sd, common / self._common_sd)


def _common_sd(inner: FloatArray, inverse: FloatArray, size: FloatArray, drawn: FloatArray) -> FloatArray:
    """Return the sds (k,) [m] of common modes that noise alone gives, and errors of poses of sds `drawn` (k, q).

    inner (k, q, q), size (k, q): of the fit. Where walls are all on one side, what looks like a common mode is mostly
    an error of the pose.
    """
    eye = np.eye(inner.shape[1])
    known = inner - eye * (size**-2)[:, np.newaxis, :]
    covariance = inverse @ (known @ (eye * (drawn**2)[:, np.newaxis, :]) @ known + known) @ inverse
    return np.asarray(np.sqrt(np.maximum(covariance[:, 0, 0], 1e-18)))
