# SPDX-License-Identifier: BSD-3-Clause
"""Good drives spoilt in the ways in which data go wrong, each with the word that must be in what is said of it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kurumaisu.bench.critic.drives import Tables
from kurumaisu.types import FloatArray

_Spoil = Callable[[Tables, np.random.Generator], Tables]


def _scaled(part: str, *factors: float) -> _Spoil:
    return lambda tables, _: {**tables, part: tables[part] * np.array(factors)}


def _ordered(part: str, *columns: int) -> _Spoil:
    return lambda tables, _: {**tables, part: tables[part][:, list(columns)]}


def _heading(change: Callable[[FloatArray], FloatArray]) -> _Spoil:
    def spoil(tables: Tables, _: np.random.Generator) -> Tables:
        pose = tables["pose"].copy()
        pose[:, 3] = change(pose[:, 3])
        return {**tables, "pose": pose}

    return spoil


def _wrapped(theta: FloatArray) -> FloatArray:
    return np.asarray(np.angle(np.exp(1j * theta)))


def _shifted(tables: Tables, rng: np.random.Generator) -> Tables:
    by = float(rng.uniform(2.5, 15) * rng.choice([-1, 1]))
    return {**tables, "pose": tables["pose"] + np.array([by, 0, 0, 0])}


def _early(tables: Tables, rng: np.random.Generator) -> Tables:
    return {**tables, "pose": tables["pose"] - np.array([rng.uniform(1.0, 2.0), 0, 0, 0])}


def _stretched(tables: Tables, rng: np.random.Generator) -> Tables:
    by = float(np.exp(rng.choice([-1, 1]) * rng.uniform(np.log(1.15), np.log(2.2))))
    return {**tables, "pose": tables["pose"] * np.array([by, 1, 1, 1])}


def _relocalised(tables: Tables, rng: np.random.Generator) -> Tables:
    pose = tables["pose"].copy()
    at = int(rng.uniform(0.2, 0.8) * len(pose))
    bearing = rng.uniform(-np.pi, np.pi)
    pose[at:, 1:3] += rng.uniform(0.7, 3) * np.array([np.cos(bearing), np.sin(bearing)])
    pose[at:, 3] += rng.uniform(-0.5, 0.5)
    return {**tables, "pose": pose}


def _frozen(tables: Tables, rng: np.random.Generator) -> Tables:
    pose = tables["pose"].copy()
    length = int(rng.uniform(0.15, 0.5) * len(pose))
    at = int(rng.uniform(0.1, 0.9) * (len(pose) - length))
    pose[at : at + length, 1:] = pose[at, 1:]
    return {**tables, "pose": pose}


def _blocks(tables: Tables, rng: np.random.Generator) -> Tables:
    """Rows of one stretch written over those of another, under the other's times."""
    pose = tables["pose"].copy()
    length = int(rng.uniform(0.1, 0.3) * len(pose))
    at = int(rng.uniform(0, 1) * (len(pose) - 2 * length))
    pose[at + length : at + 2 * length, 1:] = pose[at : at + length, 1:]
    return {**tables, "pose": pose}


def _held(tables: Tables, rng: np.random.Generator) -> Tables:
    """Each pose written several times under new times."""
    pose = tables["pose"].copy()
    times = int(rng.integers(4, 9))
    pose[:, 1:] = pose[np.arange(len(pose)) // times * times, 1:]
    return {**tables, "pose": pose}


def _coarse(tables: Tables, rng: np.random.Generator) -> Tables:
    pose = tables["pose"].copy()
    grid = float(rng.choice([0.25, 0.5, 1.0]))
    pose[:, 1:3] = np.round(pose[:, 1:3] / grid) * grid
    return {**tables, "pose": pose}


def _queued(tables: Tables, rng: np.random.Generator) -> Tables:
    """Poses that wait where the matching of scans falls behind, stamped when they come: in quick succession."""
    t = tables["pose"][:, 0].copy()
    apart = 0.2 * float(np.median(np.diff(t)))
    until = t[0]
    for i in range(1, len(t)):
        if rng.random() < (t[i] - t[i - 1]) / 3.0:
            until = max(until, t[i]) + rng.uniform(0.5, 1.0)
        t[i] = max(t[i], until, t[i - 1] + apart)
    return {**tables, "pose": np.column_stack([t, tables["pose"][:, 1:]])}


def _counts(tables: Tables, rng: np.random.Generator) -> Tables:
    volts = tables["voltage"].copy()
    volts[:, 1:] = np.round(2048 + volts[:, 1:] * rng.choice([204.8, 409.6]))
    return {**tables, "voltage": volts}


def _with_reference(tables: Tables, _: np.random.Generator) -> Tables:
    return {**tables, "voltage": tables["voltage"] + np.array([0, 2.5, 2.5])}


SPOILT: dict[str, tuple[_Spoil, str]] = {
    "positions in mm": (_scaled("pose", 1, 1e3, 1e3, 1), "millimetres"),
    "positions in cm": (_scaled("pose", 1, 1e2, 1e2, 1), "centimetres"),
    "heading in degrees": (_scaled("pose", 1, 1, 1, 180 / np.pi), "degrees"),
    "heading in degrees, wrapped": (_heading(lambda a: np.degrees(_wrapped(a))), "degrees"),
    "command w in deg/s": (_scaled("command", 1, 1, 180 / np.pi), "deg/s"),
    "command v in km/h": (_scaled("command", 1, 3.6, 1), "km/h"),
    "command v in mm/s": (_scaled("command", 1, 1000, 1), "mm/s"),
    "times of poses in ms": (_scaled("pose", 1e3, 1, 1, 1), "milliseconds"),
    "times of poses in us": (_scaled("pose", 1e6, 1, 1, 1), "microseconds"),
    "all times in ms": (
        lambda d, _: {k: d[k] * np.array([1e3, *[1] * (d[k].shape[1] - 1)]) for k in d},
        "milliseconds",
    ),
    "command w reversed": (_scaled("command", 1, 1, -1), "yaw rate"),
    "command v reversed": (_scaled("command", 1, -1, 1), "forward speed"),
    "command v and w swapped": (_ordered("command", 0, 2, 1), "swapped"),
    "heading clockwise": (_heading(lambda a: -a), "clockwise"),
    "heading as of a compass": (_heading(lambda a: np.pi / 2 - a), "compass"),
    "heading off by 90 deg": (_heading(lambda a: a + np.pi / 2), "off the direction"),
    "x and y swapped": (_ordered("pose", 0, 2, 1, 3), "x and y of the reference pose are swapped"),
    "x reversed": (_scaled("pose", 1, -1, 1, 1), "x of the reference pose has"),
    "y reversed": (_scaled("pose", 1, 1, -1, 1), "y of the reference pose has"),
    "heading of atan for atan2": (_heading(lambda a: np.arctan(np.tan(a))), "half a turn"),
    "heading without its sign": (_heading(lambda a: abs(_wrapped(a))), "folded"),
    "clock shifted": (_shifted, "clocks differ"),
    "clock 1-2 s early": (_early, "clocks differ"),
    "poses stamped on arrival": (_queued, "times of arrival"),
    "clock scaled": (_stretched, "different speeds"),
    "relocalised": (_relocalised, "jumps"),
    "frozen": (_frozen, "stand"),
    "rows repeated blockwise": (_blocks, "repeat"),
    "each pose several times": (_held, "repeat"),
    "coarse grid": (_coarse, "grid"),
    "voltages in mV": (_scaled("voltage", 1, 1e3, 1e3), "mV"),
    "voltages with the reference": (_with_reference, "reference voltage"),
    "voltages as counts": (_counts, "counts"),
    "voltages swapped": (_ordered("voltage", 0, 2, 1), "swapped"),
    "voltage v_s reversed": (_scaled("voltage", 1, 1, -1), "yaw"),
    "voltage v_f reversed": (_scaled("voltage", 1, -1, 1), "forward"),
}
