# SPDX-License-Identifier: BSD-3-Clause
"""Sizes for a wanted z, and what the nearest rival leaves of a signal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.base.recordings import Scale
from kurumaisu.bench.hidden.base.whitening import Path, Whitener
from kurumaisu.bench.hidden.generator.motion import Fault, Sizes
from kurumaisu.bench.hidden.generator.noise import Regime
from kurumaisu.types import FloatArray

# Every id with a mean signal that a size can scale; the same list for everything that is hidden.
RIVALS = tuple(name for name, hidden in BASE.items() if hidden.scaled and name != "base.process_noise")
_CLIPS = (0.5, 0.7, 0.8, 0.9)  # sizes of clips: what they take of the fastest rates
_EVEN = 7  # noises that are louder all the time, from the usual one to the loudest that there is
_RANDOM = np.random.default_rng  # seeds below are fixed: rivals are the same for all recordings


def scaled_to(wanted: float, worth: Callable[[float], float], start: float, most: float) -> float:
    """Return the size, of the sign of start and at most `most`, whose worth is nearest to the wanted one.

    A secant in logarithms: worth is nearly a power of the size for everything that is hidden here.
    """
    sign, size = np.sign(start), min(abs(start), most)
    low, high = 0.0, most
    for _ in range(8):
        z = worth(float(sign * size))
        if abs(z / wanted - 1) < 0.02 or (z < wanted and size >= most):
            break
        if z < wanted:
            low = size
        else:
            high = size
        guess = size * (wanted / z) if z > 0 else 2 * size
        inside = low < guess < high
        size = guess if inside else (min(most, 2 * size) if z < wanted and high >= most else (low + high) / 2)
    return float(sign * size)


def size_for(scale: Scale, make: Callable[[Sizes], Fault], sizes: Sizes, most: float, wanted: float) -> Sizes:
    """Return the sizes with `size` such that the fault's z is the wanted one."""

    def worth(size: float) -> float:
        return float(np.linalg.norm(scale.signals([[make({**sizes, "size": size})]])))

    return {**sizes, "size": scaled_to(wanted, worth, sizes["size"], most)}


def rival_faults(part: float = 1.0) -> dict[str, list[Fault]]:
    """Return each rival at a part of its typical size, in its usual form; those with a free shape in several."""
    out: dict[str, list[Fault]] = {}
    for name in RIVALS:
        hidden = BASE[name]
        shapes = [{"size": hidden.typical, **hidden.extra(_RANDOM(seed))} for seed in range(3)]
        if name == "base.slope":
            shapes = [{"size": hidden.typical, "bearing": bearing} for bearing in (0.0, np.pi / 2)]
        if name == "base.saturation":
            shapes = [{**shapes[0], "axis": float(axis)} for axis in (0, 1)]
        if name == "base.payload":  # its two sizes are free: either alone is one, too
            shapes = [{"size": hidden.typical, "ratio": 0.01}, {"size": 1e-3, "ratio": 100.0}]
        many = shapes if len(shapes[0]) > 1 else shapes[:1]
        out[name] = [hidden.fault({**shape, "size": part * shape["size"]}, "plain") for shape in many]
    return out


def shares(scale: Scale, faults: Sequence[Fault]) -> tuple[FloatArray, FloatArray]:
    """Return the signal (n,) of faults together, and what each adds to that of the others, (n, faults)."""
    without = [[*faults[:i], *faults[i + 1 :]] for i in range(len(faults))]
    signals = scale.signals([faults, *without])
    return signals[:, 0], signals[:, :1] - signals[:, 1:]


def left_after_rivals(signal: FloatArray, columns: Mapping[str, FloatArray]) -> dict[str, float]:
    """Return the norm of what each name's columns (samples, k), fitted alone, leave of a signal."""
    out = {}
    for name, column in columns.items():
        kept = column[:, np.linalg.norm(column, axis=0) > 1e-9]
        fit = np.linalg.lstsq(kept, signal, rcond=None)[0]
        out[name] = float(np.linalg.norm(signal - kept @ fit))
    return out


def left_by_clips(scale: Scale, signal: FloatArray) -> float:
    """Return the norm of what the best of several clips leaves of a signal: at one speed they are a gain, but below 1.

    The typical clip lies beyond the speed of most drives at one speed.
    """
    hidden = BASE["base.saturation"]
    sizes = [{**hidden.draw(_RANDOM(0)), "axis": axis, "size": size} for axis in (0.0, 1.0) for size in _CLIPS]
    columns = scale.signals([[hidden.fault(one, "plain")] for one in sizes]).T
    along = [max(float(c @ signal), 0.0) / max(float(c @ c), 1e-9) for c in columns]
    return min(float(np.linalg.norm(signal - share * c)) for share, c in zip(along, columns, strict=True))


def rival_columns(
    scale: Scale, names: Sequence[str], company: Sequence[Fault] = (), part: float = 1.0
) -> dict[str, FloatArray]:
    """Return whitened columns of rivals at a part of their typical sizes, of what each adds to other faults."""
    faults = {name: forms for name, forms in rival_faults(part).items() if name in names}
    flat = scale.signals([[*company, fault] for forms in faults.values() for fault in forms])
    flat = flat - scale.signals([company])
    out, at = {}, 0
    for name, forms in faults.items():
        out[name] = flat[:, at : at + len(forms)]
        at += len(forms)
    return out


def spread_z(path: Path, regime: Regime, grown: FloatArray) -> float:
    """Return the root of twice the mean log likelihood ratio of noise whose amplitude has grown, (runs, n - 1) times.

    Drawn under the grown noise 16 times, from the filter that knows it; over the likeliest of noises that are louder
    all the time, as nobody knows how loud the usual one is.
    """
    louder = Whitener(Path(path.times, path.poses, path.gate * grown), regime)
    rng = _RANDOM(0)
    draws = louder.colour(rng.standard_normal((*path.poses.shape, 16)))
    even = np.geomspace(1.0, max(float(grown.max()), 1.0), _EVEN)
    usual = max(_likelihood(Whitener(Path(path.times, path.poses, path.gate * each), regime), draws) for each in even)
    return float(np.sqrt(2 * max(_likelihood(louder, draws) - usual, 0.0)))


def _likelihood(whitener: Whitener, draws: FloatArray) -> float:
    """Return the mean log likelihood of draws (runs, n, 3, draws), up to a constant."""
    return -0.5 * float((whitener.whiten(draws) ** 2).sum()) / draws.shape[-1] - 0.5 * whitener.log_determinant
