# SPDX-License-Identifier: BSD-3-Clause
"""What no effect of the catalogue does: curves over something, and events that come and go."""

from __future__ import annotations

import numpy as np

from kurumaisu.bench.strangers.reed.core import DT, Array, Effect, Motion, Use


def _since(flag: Array) -> Array:
    """Seconds since a flag last held."""
    k = np.arange(len(flag))
    return np.asarray((k - np.maximum.accumulate(np.where(flag > 0, k, 0))) * DT)


def _way(m: Motion) -> Array:
    """Distance driven."""
    return np.asarray(np.cumsum(np.abs(m.v)) * DT)


def _events(m: Motion, u: Use) -> Array:
    """Half a second of slip, now and then."""
    rng = np.random.default_rng(u.aux["seed"] + int(m.drive.start))
    out = np.zeros_like(m.t)
    for begin in np.cumsum(rng.uniform(4, 14, size=60)):
        out[(m.t > begin) & (m.t < begin + 0.7)] = 1.0
    return out


def _ref(k: int, law: str) -> Effect:
    """An error of the reference itself."""

    def shift(u: Use, t: Array, x: Array, y: Array, th: Array) -> Array:
        """The error at given times and places."""
        curve = {"heading": np.sin(2 * th), "x": np.sin(1.6 * x), "time": np.sin(0.21 * t)}[law]
        return np.asarray(u.size * curve[:, None] * np.eye(3)[k])

    return Effect(
        f"reference.{('x', 'y', 'heading')[k]}:{law}",
        5,
        0.02,
        0.5,
        "",
        "shift",
        lambda r, m, u, _: lambda t, x, y, th: shift(u, t, x, y, th),
    )


def _moving(m: Motion) -> Array:
    """1 where it drives."""
    return (np.abs(m.cv) > 1e-6).astype(float)


def _bump(a: Array, at: float, width: float) -> Array:
    """A bell."""
    return np.asarray(np.exp(-0.5 * ((a - at) / width) ** 2))


_ALL = [
    Effect(
        "base.w:distance",
        3,
        0.05,
        0.6,
        "",
        "w",
        lambda r, m, u, _: r + u.size * _moving(m) * np.sin(2 * np.pi * _way(m) / 1.07 + u.aux["phase"]),
    ),
    Effect(
        "base.v:distance",
        3,
        0.03,
        0.3,
        "",
        "v",
        lambda r, m, u, _: r + u.size * _moving(m) * np.sin(2 * np.pi * _way(m) / 1.07 + u.aux["phase"]),
    ),
    Effect(
        "base.w:pressure",
        3,
        0.05,
        0.6,
        "",
        "w",
        lambda r, m, u, _: r + u.size * _moving(m) * np.sin((m.drive.columns["pressure"] - 2.4) * 9),
    ),
    Effect(
        "base.v:pressure",
        3,
        0.1,
        0.8,
        "",
        "v",
        lambda r, m, u, _: r * (1 + u.size * np.sin((m.drive.columns["pressure"] - 2.4) * 9)),
    ),
    Effect(
        "base.v:x", 4, 0.1, 0.8, "", "v", lambda r, m, u, _: r * (1 - np.abs(u.size) * _bump(m.path.x[:-1], 0.3, 0.6))
    ),
    Effect("base.w:y", 4, 0.1, 0.6, "", "w", lambda r, m, u, _: r + u.size * _moving(m) * np.sin(2 * m.path.y[:-1])),
    Effect(
        "base.w:heading", 4, 0.05, 0.6, "", "w", lambda r, m, u, _: r + u.size * _moving(m) * np.sin(2 * m.path.th[:-1])
    ),
    Effect("base.w:abs_v", 3, 0.05, 0.6, "", "w", lambda r, m, u, _: r + u.size * _bump(np.abs(m.v), 0.4, 0.1)),
    Effect(
        "base.v:abs_w",
        3,
        0.05,
        0.4,
        "",
        "v",
        lambda r, m, u, _: r + u.size * _bump(np.abs(m.w), 0.45, 0.12) * _moving(m),
    ),
    Effect(
        "base.w:time_since_rest",
        3,
        0.1,
        0.8,
        "",
        "w",
        lambda r, m, u, _: (
            r + u.size * _moving(m) * _bump(_since((np.abs(m.cv) + np.abs(m.cw) < 1e-6).astype(float)), 3.0, 1.5)
        ),
    ),
    Effect("base.v:time", 3, 0.05, 0.7, "", "v", lambda r, m, u, _: r * (1 + u.size * np.sin(2 * np.pi * m.t / 23))),
    Effect("base.v:events", 3, 0.2, 0.9, "", "v", lambda r, m, u, _: r * (1 - np.abs(u.size) * _events(m, u))),
    _ref(2, "heading"),
    _ref(0, "x"),
    _ref(1, "time"),
    Effect("laser.range:abs_w", 11, 0.01, 0.1, "", "", lambda k, u: u.size * np.tanh(np.abs(k.w) / 0.2)),
    Effect("laser.range:time", 11, 0.01, 0.1, "", "", lambda k, u: u.size * np.sin(2 * np.pi * k.time / 37)),
    Effect(
        "laser.range:pressure", 11, 0.01, 0.1, "", "", lambda k, u: u.size * np.sin((k.columns["pressure"] - 2.4) * 9)
    ),
    Effect("laser.range:range", 11, 0.01, 0.1, "", "", lambda k, u: u.size * _bump(k.r, 1.6, 0.2)),
    Effect("laser.noise:bearing", 12, 1.0, 9.0, "", "", lambda k, u: 1 + np.abs(u.size) * _bump(k.bearing, 0.5, 0.3)),
    Effect("laser.noise:abs_v", 12, 1.0, 9.0, "", "", lambda k, u: 1 + np.abs(u.size) * np.abs(k.v) / 0.4),
    Effect("laser.noise:time", 12, 1.0, 9.0, "", "", lambda k, u: 1 + np.abs(u.size) * (np.sin(k.time / 5) > 0.3)),
]
UNKNOWN = {effect.id: effect for effect in _ALL}
MORE = {"distance": [], "abs_v": ["v"], "abs_w": ["w"], "events": [], "time_since_rest": ["time_since_command"]}


def accepted(u: Use) -> tuple[str, list[str]]:
    """Channel and covariates that a careful person would name."""
    channel, law = u.id.split(":")
    first = "time" if law == "events" else law
    return channel, [first, *MORE.get(law, [])]


def unknown(rng: np.random.Generator, name: str) -> Use:
    """Draw one."""
    aux = {"phase": float(rng.uniform(0, 6)), "seed": int(rng.integers(1 << 30)), "loops": 8}
    return Use(UNKNOWN[name], float(rng.choice([-1, 1])) * UNKNOWN[name].size, False, aux)
