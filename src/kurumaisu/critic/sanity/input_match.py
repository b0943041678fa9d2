# SPDX-License-Identifier: BSD-3-Clause
"""Input against reference: one may be late, swapped, reversed, or in another unit than the other.

What separates wrong data from an effect is size. Gains within a factor of five that are no known unit, delays up to
1.5 s and clocks that differ by up to 5 % are left to the catalogue; what no robot does is said here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kurumaisu.critic.rates.mean_rates import SPAN, STEP, Rates, ShiftCorrelation, shift_correlation
from kurumaisu.critic.sanity.headings import WIN
from kurumaisu.types import BoolArray, FloatArray

_LATE = 1.5  # [s] motion may come after its command by this much: a delay and a lag
_EARLY = -0.15  # [s] but not before it
_DRIFT = 0.006  # share of a drive by which a clock that runs at another speed is off, on the mean: 1.2 % at the end
_LONGEST = 120.0  # [s] shifts of clocks that are tried
_SCALES = np.exp(np.linspace(np.log(0.4), np.log(2.5), 185))  # of one clock against the other, in steps of 1 %
_SCALE = 0.05  # clocks may differ by this share
_PIECES = 240.0  # [s] of a drive that are compared
_OUTSET = 60.0  # [s] of the first drive likewise: clocks that were set together are together still
_FEWEST_TURNS = 12  # changes of the input below which nearly any pace of the clocks would do
_PIECE = 100.0  # [s] of the drive that the scales are tried on
_ALIKE = 0.7  # least correlation of a reading that is said
_UNLIKE = 0.5  # largest correlation, and factor, of a motion that has nothing to do with its input
_ENOUGH = 40.0  # independent samples from which that is said
_LEAST = (0.02, 0.02)  # [m/s], [rad/s] sd of an input below which it says nothing
_PLAIN = (0.2, 5.0)  # factors between asked and driven that the catalogue explains, unless they are a unit's
_NEAR = 0.2  # relative distance from a unit's factor, where the catalogue has factors like it
_ROUGHLY = 0.7  # and where it has none: an effect may come on top
# driven / asked: what it means. Of the length in v, of the angle in w, of the time in both.
_UNITS_V = {
    1000.0: "positions look like millimetres: try 0.001 * x, y",
    100.0: "positions look like centimetres: try 0.01 * x, y",
    1e-3: "the commanded speed looks like mm/s: try 0.001 * v",
    1e-2: "the commanded speed looks like cm/s: try 0.01 * v",
    1 / 3.6: "the commanded speed looks like km/h (or a wheel's rad/s): try v / 3.6",
    3.6: "the speed driven looks like km/h: try x, y / 3.6",
}
_UNITS_W = {
    180 / np.pi: "heading looks like degrees: try theta * pi / 180",
    np.pi / 180: "the commanded yaw rate looks like deg/s: try w * pi / 180",
    30 / np.pi: "heading or yaw rate look like revolutions per minute: try w * pi / 30",
    np.pi / 30: "the commanded yaw rate looks like revolutions per minute: try w * pi / 30",
    1e-3: "the commanded yaw rate looks like mrad/s: try 0.001 * w",
}


@dataclass(frozen=True)
class Match:
    """How the motion follows the input, after the best shift: lag [s]; per channel correlation and factor (2,)."""

    lag: float
    correlation: FloatArray
    factor: FloatArray
    words: tuple[str, ...]


class Line(NamedTuple):
    """One thing = offset + factor * another, and the correlation of both; 0 where too little of them is known."""

    correlation: float
    factor: float
    offset: float


def compare(asked: Rates, driven: Rates, name: str, *, longest: float = _PIECES, first: bool = False) -> Match:
    """Return how the motion follows an input of a name, and in words what is wrong with either.

    longest: of what is compared [s]; first: of all drives, at whose beginning no clock has drifted yet.
    """
    if first and (begun := compare(asked, driven, name, longest=_OUTSET)).lag < _EARLY:
        return begun
    asked, driven = _beginning(asked, driven, longest)
    drift = _DRIFT * float(driven.t[-1] - driven.t[0])
    pairs = _pairs(asked.values, driven.values)
    lags = pairs[0][0].lags
    straight, crossed = _total(pairs, swapped=False), _total(pairs, swapped=True)
    possible = (lags >= -STEP / 2) & (lags <= _LATE)
    base = float(straight[possible].max(initial=0.0))
    words = []
    swapped = float(crossed[possible].max(initial=0.0)) > base + WIN and _is_swap(pairs, crossed, possible)
    total = crossed if swapped else straight
    at = int(np.argmax(np.where(possible, total, -1.0)))
    best = int(np.argmax(total))
    strong = _strongest(pairs, best, swapped) > _ALIKE
    if not _EARLY - drift < lags[best] < _LATE + drift and total[best] > total[at] + WIN and strong:
        words.append(
            _shift_words(name, float(lags[best]), _strongest(pairs, best, swapped), _strongest(pairs, at, swapped))
        )
        at = best
    elif _strongest(pairs, at, swapped) < 0.85:
        words += _scale_words(asked, driven, name, max(float(total[at]), float(crossed[best]), float(straight[best])))
    if swapped:
        words.append(_swap_words(name, pairs, at))
    x = shifted(asked.values[:, ::-1] if swapped else asked.values, round(float(lags[at]) / STEP))
    lines = [line(x[:, i], driven.values[:, i], _LEAST[i]) for i in range(2)]
    correlation, factor = (np.array(each) for each in zip(*(one[:2] for one in lines), strict=True))
    return Match(float(lags[at]), correlation, factor, tuple(words))


def _beginning(asked: Rates, driven: Rates, longest: float) -> tuple[Rates, Rates]:
    """Return the first minutes in which something was asked for: later on, clocks may have drifted apart."""
    size = np.nan_to_num(np.abs(asked.values)).sum(axis=1) * np.isfinite(driven.values).all(axis=1)
    started = int(np.argmax(size > 0.3 * size.max(initial=0.0)))
    piece = slice(max(0, started - round(30 / STEP)), started + round(longest / STEP))
    return Rates(asked.t[piece], asked.values[piece]), Rates(driven.t[piece], driven.values[piece])


def _pairs(asked: FloatArray, driven: FloatArray) -> list[list[ShiftCorrelation]]:
    """Return how alike each channel driven (rows) is to each asked for."""
    noise = (1e-9, 1e-9)
    return [
        [shift_correlation(driven[:, i], asked[:, j], (noise[i], _LEAST[j]), _LONGEST) for j in range(2)]
        for i in range(2)
    ]


def _total(pairs: list[list[ShiftCorrelation]], *, swapped: bool) -> FloatArray:
    return np.asarray(sum(pairs[i][1 - i if swapped else i].nats for i in range(2)))


def _strongest(pairs: list[list[ShiftCorrelation]], at: int, swapped: bool) -> float:
    return float(max(abs(pairs[i][1 - i if swapped else i].correlation[at]) for i in range(2)))


def _is_swap(pairs: list[list[ShiftCorrelation]], crossed: FloatArray, possible: BoolArray) -> bool:
    """Whether the other channel explains one well, and its own neither: a chair that veers follows both."""
    at = int(np.argmax(np.where(possible, crossed, -1.0)))
    follows = [pairs[i][i].nats[possible].max(initial=0.0) > pairs[i][1 - i].nats[at] + WIN for i in range(2)]
    return _strongest(pairs, at, swapped=True) > _ALIKE and not any(follows)


def _shift_words(name: str, lag: float, alike: float, plain: float) -> str:
    way = "after" if lag > 0 else "before"
    return (
        f"clocks differ: the motion comes {abs(lag):.1f} s {way} its {name}; try t of the {name} "
        f"{lag:+.1f} s (correlation of the rates: {alike:.2f} then, {plain:.2f} as given)"
    )


def _swap_words(name: str, pairs: list[list[ShiftCorrelation]], at: int) -> str:
    cross = [abs(pairs[i][1 - i].correlation[at]) for i in range(2)]
    own = [abs(pairs[i][i].correlation[at]) for i in range(2)]
    return (
        f"channels of the {name} are swapped: the forward speed follows the yaw channel (correlation {cross[0]:.2f}, "
        f"own channel {own[0]:.2f}), the yaw rate the forward one ({cross[1]:.2f}, own {own[1]:.2f}); try to swap them"
    )


def _scale_words(asked: Rates, driven: Rates, name: str, base: float) -> list[str]:
    """Try clocks that run at other speeds, on a piece of the drive."""
    size = round(_PIECE / STEP)
    t, goal = driven.t[:size], driven.values[:size]
    best: tuple[float, float, float] = (base, 1.0, 0.0)
    known = np.isfinite(asked.values).all(axis=1)
    turns = int((np.abs(np.diff(asked.values[known], axis=0)) > _LEAST).any(axis=1).sum())
    if known.sum() < 20 or turns < _FEWEST_TURNS:
        return []
    for scale in _SCALES:
        if abs(scale - 1) < _SCALE:
            continue
        at = t[0] + (t - t[0]) / scale
        values = np.column_stack(
            [np.interp(at, asked.t[known], asked.values[known, i], left=np.nan, right=np.nan) for i in range(2)]
        )
        found = [shift_correlation(goal[:, i], values[:, i], (1e-9, _LEAST[i]), 30.0) for i in range(2)]
        total = np.asarray(found[0].nats + found[1].nats)
        k = int(np.argmax(total))
        alike = float(max(abs(one.correlation[k]) for one in found))
        if total[k] > best[0] and alike > _ALIKE + 0.1:
            best = float(total[k]), float(scale), alike
    if best[0] < base + 2 * WIN:
        return []
    return [
        f"clocks run at different speeds: {name} and motion agree if the clock of the motion runs "
        f"{best[1]:.3g} times as fast (correlation {best[2]:.2f}); try t / {best[1]:.3g}"
    ]


def line(x: FloatArray, y: FloatArray, least: float) -> Line:
    """Return the line of y (n,) over x (n,), which says nothing if its sd is below the least."""
    known = np.isfinite(x) & np.isfinite(y)
    a, b = x[known], y[known]
    if len(a) < 3 * SPAN / STEP or a.std() < least or b.std() == 0:
        return Line(0.0, np.nan, 0.0)
    return Line(float(np.corrcoef(a, b)[0, 1]), *map(float, np.polyfit(a, b, 1)))


def shifted(rows: FloatArray, by: int) -> FloatArray:
    """Return rows (n, m) moved down by a number of rows, nan where there are none."""
    out = np.full(rows.shape, np.nan)
    if abs(by) < len(rows):
        out[max(by, 0) : len(rows) + min(by, 0)] = rows[max(-by, 0) : len(rows) - max(by, 0)]
    return out


def sign_and_unit(match: Match, number: float, name: str) -> list[str]:
    """Return in words what signs and factors say. number: of independent samples."""
    words = [
        f"{quantity} of the {name} has the wrong sign (or that of the reference): factor {match.factor[i]:.2f}, "
        f"correlation {match.correlation[i]:.2f}; try -{symbol}"
        for i, (quantity, symbol) in enumerate((("forward speed", "v"), ("yaw rate", "w")))
        if match.correlation[i] < -_ALIKE and _sure(match.correlation[i], number)
    ]
    sizes = np.abs(match.factor)
    sure = [_sure(correlation, number) and abs(correlation) > _ALIKE for correlation in match.correlation]
    both = all(sure) and abs(np.log(sizes[0] / sizes[1])) < 0.5
    if both and (sizes[0] < 0.1 or sizes[0] > 10):
        return [*words, _time_words(float(np.sqrt(sizes.prod())), name)]
    for i, units in enumerate((_UNITS_V, _UNITS_W)):
        if sure[i]:
            words += _unit_words(float(sizes[i]), abs(float(match.correlation[i])), units, i)
    return words


def unrelated(match: Match, number: float, name: str) -> list[str]:
    """Return in words that a motion has nothing to do with its input, where it moves otherwise, whenever that was.

    number: of independent samples.
    """
    known = np.isfinite(match.factor)
    alike, factor = (np.abs(values[known]) for values in (match.correlation, match.factor))
    moves = bool((factor > _UNLIKE * alike).any())  # as much as was asked for: one that stands is held, or has no power
    unlike = bool(((alike < _UNLIKE) & (factor < _UNLIKE)).all())
    if match.words or number < _ENOUGH or not moves or not unlike:
        return []
    best = float(alike.max())
    return [
        f"the motion has nothing to do with its {name} (correlation of the rates: {best:.2f} at most): are the poses "
        f"those of another drive?"
    ]


def _sure(correlation: float, number: float) -> bool:
    return bool(-0.5 * number * np.log1p(-min(correlation**2, 0.9999)) > WIN / 2)


def _time_words(factor: float, name: str) -> str:
    return (
        f"the motion is {factor:.3g} times as fast as the {name} demands, in both channels: the times of the poses "
        f"look like another unit than seconds; try t * {factor:.3g}"
    )


def _unit_words(size: float, alike: float, units: dict[float, str], channel: int) -> list[str]:
    unit = min(units, key=lambda factor: abs(np.log(size / factor)))
    near = abs(np.log(size / unit)) < _NEAR
    outside = not _PLAIN[0] <= size <= _PLAIN[1]
    quantity = ("forward", "turning")[channel]
    measured = f"{quantity} {size:.4g} times as fast as commanded"
    if (near and alike > 0.9) or (outside and abs(np.log(size / unit)) < _ROUGHLY):
        return [f"{units[unit]}; {measured}"]
    if size > 2 * _PLAIN[1] or size < _PLAIN[0] / 2:
        return [f"{measured}: no known unit explains this; are both in SI units?"]
    return []
