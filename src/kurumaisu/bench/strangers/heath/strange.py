# SPDX-License-Identifier: BSD-3-Clause
"""What is in no sentence of the catalogue, and data that contradict themselves."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .chair import DT, TOOLS, table
from .laser import Room, build, segments

Array = NDArray[Any]
Tables = list[dict[str, tuple[list[str], Array]]]
TOOLS |= {  # events that come and go, a bell, a bell over angles, acceleration over 0.3 s
    "now": lambda t, lasts, every: (
        np.abs(
            np.mod(t, every) - 0.75 * every * np.mod(43758.5453 * np.sin(12.9898 * np.floor(t / every)), 1) - lasts / 2
        )
        < lasts / 2
    ),
    "bump": lambda x, at, wide: np.exp(-(((x - at) / wide) ** 2)),
    "near": lambda x, at, wide: np.exp(-(((np.mod(x - at + np.pi, 2 * np.pi) - np.pi) / wide) ** 2)),
    "push": lambda v: np.clip(TOOLS["boxed"](np.diff(v, prepend=0.0) / DT, 0.3), -1.5, 1.5),
    "SIGNS": np.array([1, -0.8, 0.5, -1.2, 0.9, -0.4]),
}
COVARIATES = {
    "time": "time recording_time",
    "v": "v abs_v",
    "w": "w abs_w",
    "side": "direction bearing heading",
    "way": "heading direction",
    "rest": "since_rest since_change",
    "run": "run recording_time",
    "push": "acceleration_v since_change",
}
# in place of a parameter: channel/covariates
UNKNOWN = table("""
a wheel out of round turns it | rate base/distance 0.1 0.8 ± p:1:3 | w += a * v * sin(6.283 * cumsum(abs(v)) * DT / p)
ripples with the distance | rate base/distance 0.1 0.5 ± p:0.8:3 | v += a * v * sin(6.283 * cumsum(abs(v)) * DT / p)
speed by a column | rate base/extra 0.05 0.3 ± | v += a * v * extra(all)
yaw by a column | rate base/extra 0.02 0.15 ± | w += a * sign(abs(v) + abs(w)) * extra(all)
path bends by a column | rate base/extra 0.05 0.3 ± | w += a * v * extra(all)
pile of a carpet | kin base/way 0.08 0.4 ± f:-3.1:3.1 | v += a * v * cos(2 * theta - f)
speed swings with the time | rate base/time 0.08 0.4 ± f:-3.1:3.1 p:15:70 | v += a * v * sin(2 * pi * all / p + f)
yaw swings with the time | rate base/time 0.02 0.15 ± f:-3.1:3.1 p:15:70 | w += a * sign(abs(v) + abs(w)) * sin(2 * pi
  * all / p + f)
a band of speeds is slower | rate base/v 0.03 0.2 ± c:0.2:0.3 | v += a * sign(v) * bump(abs(v), c, 0.06)
a band of speeds pulls aside | rate base/v 0.03 0.2 ± c:0.2:0.35 | w += a * bump(v, c, 0.07)
a band of turns turns less | rate base/w 0.05 0.25 ± c:0.3:0.5 | w += a * sign(w) * bump(abs(w), c, 0.08)
pulls aside either way | rate base/v 0.08 0.4 ± | w += a * abs(v)
slow for seconds after a rest | rate base/rest 0.1 0.5 - p:3:8 | v *= 1 + a * exp(-since((vc == 0) & (wc == 0), t) / p)
yaw bias of each run's own | rate base/run 0.02 0.1 ± | w += a * sign(abs(v) + abs(w)) * SIGNS[run % 6]
pulled aside now and then | rate base/time 0.1 0.5 ± p:12:25 n:0.8:2 | w += a * sign(abs(v) + abs(w)) * now(all, n, p)
slips now and then | rate base/time 0.2 0.4 - p:12:25 n:0.8:2.5 | v += a * v * now(all, n, p)
pulls aside when speeding up | rate base/push 0.05 0.4 ± | w += a * push(v)
positions by the heading, twice | ref reference/way 0.01 0.06 ± f:-3.1:3.1 | x += a * cos(2 * theta - f)
positions swing with the time | ref reference/time 0.015 0.08 ± f:-3.1:3.1 p:15:70 | y += a * sin(2 * pi * all / p + f)
headings by the heading | ref reference/way 0.015 0.06 ± f:-3.1:3.1 | theta += a * sin(theta - f)
headings by the yaw rate | ref reference/w 0.02 0.12 ± | theta += a * w
positions by a column | ref reference/extra 0.01 0.06 ± | x += a * extra(all)
a bump over the range | mean range/range 0.004 0.02 ± c:1:2.2 | mu += a * bump(r, c, 0.15)
sun from one side | mean range/side 0.004 0.02 ± f:-3.1:3.1 | mu += a * near(direction, f, 0.5)
ranges swing with the time | mean range/time 0.003 0.012 ± f:-3.1:3.1 p:15:70 | mu += a * sin(2 * pi * all / p + f)
ranges by the speed | mean range/v 0.008 0.04 ± | mu += a * abs(v)
ranges by the yaw rate | mean range/w 0.006 0.03 ± | mu += a * w
ranges by a column | mean range/extra 0.003 0.015 ± | mu += a * extra(all)
a band of incidence | mean range/incidence 0.004 0.02 ± c:0.6:0.9 | mu += a * bump(slant, c, 0.12)
ranges off now and then | mean range/time 0.006 0.03 ± p:10:20 n:1.5:3 | mu += a * now(all, n, p)
scatter by the yaw rate | sd scatter/w 0.8 3 + | sd *= 1 + a * abs(w)
scatter by the speed | sd scatter/v 1 4 + | sd *= 1 + a * abs(v)
scatter grows with the time | sd scatter/time 0.3 1.5 + | sd *= 1 + a * t / 60
scatter by a column | sd scatter/extra 0.2 0.8 + | sd *= 1 + a * max(1 + extra(all), 0)
scatter of one direction | sd scatter/side 0.5 2 + f:-3.1:3.1 | sd *= 1 + a * near(direction, f, 0.6)
scatter of a run | sd scatter/run 0.2 1 + | sd *= 1 + a * (RUNS[run % 6] - 0.5)
scatter of some ranges | sd scatter/range 0.6 2 + c:1:2 | sd *= 1 + a * bump(r, c, 0.2)
""")
# what is wrong | table | what becomes of its rows r (c: the columns' numbers; late: 1 for the second half)
WRONG = dict(
    line.split(" | ", 1)
    for line in """
the times of the poses are in ms | pose | r * (1e3, 1, 1, 1)
the positions of the poses are in mm | pose | r * (1, 1e3, 1e3, 1)
the headings of the poses are in degrees | pose | r * (1, 1, 1, 57.29578)
the commanded speeds are in km/h | command | r * (1, 3.6, 1)
the commanded speeds are in mm/s | command | r * (1, 1e3, 1)
the commanded yaw rates are in degrees/s | command | r * (1, 1, 57.29578)
y of the poses has the wrong sign | pose | r * (1, 1, -1, 1)
the headings of the poses are clockwise | pose | r * (1, 1, 1, -1)
the headings of the poses are a compass's | pose | where(c == 3, mod(pi / 2 - r, 2 * pi), r)
x and y of the poses are swapped | pose | r[:, [0, 2, 1, 3]]
v and w of the commands are swapped | command | r[:, [0, 2, 1]]
v of the commands has the wrong sign | command | r * (1, -1, 1)
w of the commands has the wrong sign | command | r * (1, 1, -1)
the clock of the poses jumps 6 s forward in each drive | pose | r + late * (c == 0) * 6
the clock of the poses jumps 4 s back in each drive | pose | r - late * (c == 0) * 4
the poses are 3.5 s late | pose | r + (c == 0) * 3.5
the scans are 4 s late | scan | r + (c == 0) * 4
the scans are mirrored | scan | r[:, [0, *range(c[-1], 0, -1)]]
the scans are in mm | scan | r * where(c > 0, 1e3, 1)
the scans are turned by a quarter of their fan | scan | r[:, [0, *(1 + roll(c[:-1], c[-1] // 4))]]
the map is another room's | map | other
the map is mirrored | map | mirrored
the map is shifted | map | shifted
run_2 is run_1 once more, with other times | run | copy
run_1 and run_2 have each other's commands | run | inputs
the poses stand still for a part of each drive | pose | where(still & (c > 0), r[int(0.3 * len(r))], r)
the voltages are in mV | voltage | r * (1, 1e3, 1e3, 1, 1)
the voltages have the reference of 2.5 V in them | voltage | r + (0, 2.5, 2.5, 0, 0)
""".strip().split("\n")
)


def break_tables(wrong: str, tables: Tables, room: Room, rng: np.random.Generator) -> None:
    """Make a recording contradict itself."""
    name, rule = WRONG[wrong].split(" | ")
    if name == "map":
        if rule == "shifted":
            room.x0, room.y0 = (q + float(rng.choice([-1, 1]) * rng.uniform(0.8, 1.5)) for q in (room.x0, room.y0))
        elif rule == "other":
            other = build(rng)
            room.taken, room.pixel = other.taken, other.pixel
        else:
            room.taken = room.taken[:, ::-1]
        room.walls = segments(room.taken, room.pixel, room.x0, room.y0)
    elif rule == "copy":
        shift = np.round(tables[1]["pose"][1][0, 0] - tables[0]["pose"][1][0, 0], 6)
        tables[1] = {n: (heads, r + shift * (np.arange(r.shape[1]) == 0)) for n, (heads, r) in tables[0].items()}
    elif rule == "inputs":
        (heads, one), (_, two) = tables[0]["command"], tables[1]["command"]
        shift = (two[0, 0] - one[0, 0]) * np.array([1, 0, 0])
        tables[0]["command"], tables[1]["command"] = (heads, two - shift), (heads, one + shift)
    for run in tables if name not in ("map", "run") else []:
        heads, r = run[name]
        part = np.arange(len(r))[:, None] / len(r)
        known = {"r": r, "c": np.arange(r.shape[1]), "late": part >= 0.5, "still": (part > 0.3) & (part < 0.7)}
        run[name] = (heads, eval(rule, TOOLS | known))
