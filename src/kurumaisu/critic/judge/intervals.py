# SPDX-License-Identifier: BSD-3-Clause
"""What the size of a cause may be: where the likelihood ends, and what another form of its equation would change."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kurumaisu import effects, geometry
from kurumaisu.critic.base import replay
from kurumaisu.critic.engine.catalogue import Term
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.heldout.materiality import HORIZON, spans
from kurumaisu.critic.values.policy import FORM_ERROR, FORM_WAYS
from kurumaisu.critic.values.verdict import NORMAL90, Estimate
from kurumaisu.params import Model
from kurumaisu.types import FloatArray

_TRIES = 6  # residuals per end of an interval
_NEAR = 0.05  # of NORMAL90, by which an end may be off
_FARTHER = 3.0  # times as far as tried before, at most: a flat likelihood does not say how far it goes
_PEAK_DISTANCES = np.geomspace(1e-5, 1e-2, 24)  # shares of a size, at which what has many likely values is tried
_REFUSED = NORMAL90**2 / 2  # [nat] beyond which a peak is none


def estimates(problem: Problem, fit: Fit, name: str) -> dict[str, Estimate]:
    """Return the parameters of an effect of a fit with their 90 % intervals."""
    known = [i for i, term in enumerate(fit.terms) if not term.fixed]
    columns = problem.columns(fit.terms, fit.values, [fit.terms[i] for i in known])
    unit = np.array([fit.terms[i].step * fit.terms[i].parameter.scale for i in known])
    tight = np.array([fit.terms[i].step if fit.terms[i].shape else 0.0 for i in known])
    spread = np.linalg.inv(columns.T @ columns + np.diag(tight**2) + 1e-6 * np.eye(len(known)))
    doubt = _doubt(problem, fit, columns) if known else np.empty(0)
    order = _next_order(problem, fit, name)
    out = {}
    for at, term in enumerate(fit.terms):
        value = float(fit.values[at])
        if term.id == name and term.fixed:
            out[term.parameter.name] = _estimate(problem.model, term, value, value, value)
        elif term.id == name:
            k = known.index(at)
            sd = float(np.sqrt(spread[k, k])) * abs(float(unit[k]))
            ridge = np.zeros(len(fit.terms))  # where the others go with this one
            ridge[known] = spread[:, k] * unit / (spread[k, k] * unit[k])
            # Off its peak, the step of a converter fits nothing: the way then goes on beside the step as it is.
            held = np.array([other.rough and i != at for i, other in enumerate(fit.terms)])
            ways = [ridge, np.where(held, 0.0, ridge)] if (ridge[held] != 0).any() else [ridge]
            lows, highs = zip(*(ends_of(problem, fit, at, way, sd) for way in ways), strict=True)
            low, high = min(lows), max(highs)
            beyond = 0.0 if term.shape else order * abs(value - term.null)
            more = NORMAL90 * float(np.hypot(doubt[k] * sd, beyond))
            ends = value - np.hypot(value - low, more), value + np.hypot(high - value, more)
            out[term.parameter.name] = _estimate(problem.model, term, value, *map(float, ends))
    return out


def _doubt(problem: Problem, fit: Fit, columns: FloatArray) -> FloatArray:
    """Return, per column (n, k), what other forms of the causes may shift it by, in standard deviations.

    Nobody can refuse a form that differs by FORM_ERROR of the signal; what it does is like the signal, and is taken for
    other sizes of what does the like.
    """
    out, here = np.zeros(columns.shape[1]), problem.residual(fit.terms, fit.values)
    for name in sorted(fit.ids):
        if effects.by_id(name).empirical:
            terms = zip(fit.terms, fit.values, strict=True)
            null = np.array([term.null if term.id == name and not term.shape else value for term, value in terms])
            signal = problem.residual(fit.terms, null) - here  # what the effect does, whitened
            norms = np.linalg.norm(columns, axis=0) * np.linalg.norm(signal)
            power = FORM_ERROR**2 * float(signal @ signal)
            out += power / FORM_WAYS * (columns.T @ signal / np.maximum(norms, 1e-12)) ** 2
    return np.asarray(np.sqrt(out))


def _next_order(problem: Problem, fit: Fit, name: str) -> float:
    """Return the share of a size by which the next order of the equation may shift it, 1 sd; 0 of what has none.

    Where the first order moves the chair by a share of the way or turn that is left, the next one does by that share
    of the first, times a factor within -1 and 1. What went to and fro is as much way as what went on.
    """
    if not effects.by_id(name).empirical:
        return 0.0
    without = tuple(setting for setting in fit.settings if setting.id != name)
    changed, along, made = np.zeros(2), np.zeros(2), np.zeros(2)
    for drive in problem.drives:
        starts, stops = spans(drive, HORIZON)
        paths = [replay.path(drive, problem.model, some) for some in (fit.settings, without)]
        one, other = (geometry.between(path[starts], path[stops]) for path in paths)
        d = _amounts(one - other)
        travelled = [np.cumsum(_amounts(np.diff(path, axis=0, prepend=path[:1])), axis=0) for path in paths]
        m = np.minimum(*(way[stops] - way[starts] for way in travelled))
        changed, along, made = changed + (d**2).sum(axis=0), along + (d * m).sum(axis=0), made + (m**2).sum(axis=0)
    where = int(np.argmax(changed / np.maximum(made, 1e-12)))
    return float(min(changed[where] / max(along[where], 1e-12), 1.0) / np.sqrt(3))


def _amounts(moves: FloatArray) -> FloatArray:
    """Return how far (n, 3) moves go and turn, (n, 2)."""
    return np.asarray(np.abs(np.column_stack([moves[:, 0] + 1j * moves[:, 1], moves[:, 2]])))


def ends_of(problem: Problem, fit: Fit, at: int, ridge: FloatArray, sd: float) -> tuple[float, float]:
    """Return where the likelihood along a ridge has fallen as a Gaussian's at the ends of its 90 %."""
    value, parameter = float(fit.values[at]), fit.terms[at].parameter
    lower, upper = (np.array([getattr(term.parameter, side) for term in fit.terms]) for side in ("lower", "upper"))

    def fallen(offset: float) -> float:
        values = np.clip(fit.values + ridge * offset, lower, upper)
        left = problem.residual(fit.terms, values)
        shapes = sum(
            ((v - term.null) / term.parameter.scale) ** 2
            for term, v in zip(fit.terms, values, strict=True)
            if term.shape
        )
        return 0.5 * float(left @ left + shapes) - cost

    cost = 0.0
    cost = fallen(0.0)
    ends = []
    for sign, room in ((-1.0, value - parameter.lower), (1.0, parameter.upper - value)):
        # Of a step, the farthest place where the likelihood stands as high as at the ends of 90 %.
        shares = _PEAK_DISTANCES if fit.terms[at].rough else ()
        far = max((each * abs(value) for each in shares if fallen(sign * each * abs(value)) < _REFUSED), default=0.0)
        ends.append(value + sign * max(_end(fallen, sign, sd, room), min(far, room)))
    return ends[0], ends[1]


def _end(fallen: Callable[[float], float], sign: float, sd: float, room: float) -> float:
    """Return how far a smooth likelihood goes to one side, by the root of its fall; room: at most."""
    inside, outside = (0.0, 0.0), (np.inf, np.inf)  # offsets, and roots there, between which the end is
    offset = NORMAL90 * sd
    for _ in range(_TRIES):
        offset = min(offset, room)
        root = float(np.sqrt(2 * max(fallen(sign * offset), 0.0)))
        if abs(root - NORMAL90) < _NEAR * NORMAL90 or (offset >= room and root < NORMAL90):
            return offset
        inside, outside = ((offset, root), outside) if root < NORMAL90 else (inside, (offset, root))
        if np.isinf(outside[0]):
            offset *= min(NORMAL90 / max(root, 1e-9), _FARTHER)
        else:
            share = (NORMAL90 - inside[1]) / (outside[1] - inside[1])
            offset = inside[0] + float(np.clip(share, 0.2, 0.8)) * (outside[0] - inside[0])
    return offset


def _estimate(model: Model, term: Term, value: float, low: float, high: float) -> Estimate:
    """Return a fitted parameter with its 90 % interval, which its bounds cut."""
    unit = term.parameter.unit
    if unit == "V" and not model.robot.voltages:
        # Its volts are what it is asked for.
        unit = "m/s" if getattr(effects.by_id(term.id), "shows_in", None) is effects.Rate.V else "rad/s"
    return Estimate(float(value), max(low, term.parameter.lower), min(high, term.parameter.upper), unit)
