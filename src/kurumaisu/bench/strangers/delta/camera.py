# SPDX-License-Identifier: BSD-3-Clause
"""The reference: cameras that track a marker, with noise, drift, gaps, bursts, and clocks."""

from collections.abc import Sequence

import numpy as np

from kurumaisu.bench.strangers.delta.core import Array, Cause, Drive, Path, Setup

MARKERS = ("base.marker_x", "base.marker_y", "base.marker_yaw", "base.clock_scale")


def true_time(t: Array, causes: Sequence[Cause]) -> Array:
    """When a row was really taken, by its stamp; other: the clock's quartz warms up."""
    for c in causes:
        if c.id == "base.clock_scale":
            t = t / (1 + c.size) if not c.other else t - c.size * t**2 / 120
    return t


def stamp_of(t: Array, causes: Sequence[Cause]) -> Array:
    """Stamp of a time: the inverse."""
    out = t
    for _ in range(8):
        out = out + t - true_time(out, causes)
    return out


def seen(setup: Setup, drive: Drive, path: Path, stamps: Array, causes: Sequence[Cause]) -> Array:
    """Poses (x, y, heading) that the cameras would give without noise."""
    x, y, th = path.at(true_time(stamps, causes))
    return markers(setup, drive, np.stack([x, y, th], -1), stamps, causes)


def markers(setup: Setup, drive: Drive, poses: Array, stamps: Array, causes: Sequence[Cause]) -> Array:
    """Poses of what the cameras track, by poses of the chair."""
    x, y, th = poses[..., 0], poses[..., 1], poses[..., 2]
    turned = th.copy()
    for c in causes:
        if c.id == "base.marker_x":
            x, y = x + c.size * np.cos(th), y + c.size * np.sin(th)
        elif c.id == "base.marker_y":
            x, y = x - c.size * np.sin(th), y + c.size * np.cos(th)
        elif c.id == "base.marker_yaw":
            turned = turned + c.size
        elif c.curve and c.curve.channel.startswith("reference."):
            covariate = c.curve.covariate
            known = {"x": x, "y": y, "heading": th, "time": stamps}
            q = known[covariate] if covariate in known else setup.columns[covariate](drive.session + stamps)
            e = c.size * c.curve.shape(q)
            channel = c.curve.channel
            x, y, turned = (u + e * (channel == n) for u, n in zip((x, y, turned), CHANNELS, strict=True))
    return np.stack([x, y, turned], -1)


CHANNELS = ("reference.x", "reference.y", "reference.heading")


def drift(rng: np.random.Generator, t: Array, sd: float, tau: float) -> Array:
    """Slow drift of the cameras: an Ornstein-Uhlenbeck process at the rows' times."""
    out, y = np.empty(len(t)), rng.normal(0, sd)
    for i, h in enumerate(np.diff(t, prepend=t[0]).tolist()):
        a = np.exp(-h / tau)
        y = a * y + sd * np.sqrt(1 - a * a) * rng.normal()
        out[i] = y
    return out


def record(setup: Setup, drive: Drive, causes: Sequence[Cause]) -> None:
    """Rows of the reference of a drive."""
    rng, noise = setup.rng, setup.noise
    h = 1 / setup.facts["pose_rate"]
    gaps = np.clip(rng.normal(1, 0.08, int(drive.length / h * 1.2)), 0.3, 2.0) * h
    t = np.cumsum(gaps) + 0.05
    for _ in range(int(rng.integers(0, 4))):
        begin = rng.uniform(5, drive.length - 10)
        t = t[(t < begin) | (t > begin + rng.uniform(0.3, 2.5))]
    if rng.random() < 0.4:
        begin = rng.uniform(5, drive.length - 10)
        inside = (t > begin) & (t < begin + 2)
        t = np.where(inside, begin + 0.25 * np.floor((t - begin) / 0.25) + 0.2 * np.mod(t - begin, 0.25), t)
    t = np.unique(np.round(np.concatenate([t, drive.scan_t[drive.asked_scans]]), 5))
    t = t[(t > 0.02) & (t < drive.length - 0.3)]
    poses = seen(setup, drive, drive.true_path(), t, causes)
    poses[:, :2] += rng.normal(0, noise.position, (len(t), 2))
    poses[:, 2] += rng.normal(0, noise.heading, len(t))
    for column, sd in ((0, noise.drift), (1, noise.drift), (2, 0.3 * noise.drift)):
        poses[:, column] += drift(rng, t, sd, noise.drift_tau)
    drive.odd = np.zeros(len(t))
    forbidden = np.isin(t, np.round(drive.scan_t[drive.asked_scans], 5))
    for k in rng.choice(len(t), int(rng.integers(0, 4)), replace=False):
        if not forbidden[k]:
            poses[k, :2] += rng.normal(0, 0.15, 2)
            drive.odd[k] = 1
    drive.rows, drive.poses = t, poses
