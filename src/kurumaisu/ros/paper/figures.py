# SPDX-License-Identifier: BSD-3-Clause
"""The commands of scripts/paper that run ROS programs, and all of them in a row."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kurumaisu.paper import drawing
from kurumaisu.paper.chair import dac_line
from kurumaisu.paper.chair import drive as drives
from kurumaisu.paper.commands import drive as commands
from kurumaisu.paper.commands import wall
from kurumaisu.paper.options import load_options
from kurumaisu.params import load_model, shipped
from kurumaisu.ros.paper import launches

LAWS = {"custom": "intercept 0.1 V", "published": "equation (1)"}
_RIDDLE_SEED = 1000  # of docs/paper/open_questions.md
_CODES = 1.5  # half a step of V_f, half a step of the reference, and rounding


def drive(model: Path, out: Path, *, seed: int, speed: float, settings: Path | None) -> int:
    """Drive the simulator through base_node, record, and repeat figures 3 to 6 from the bag."""
    bag = out.resolve() / "drive.bag"
    launches.drive(model.resolve(), drives.IDENTIFICATION, bag, seed=seed, speed=speed)
    return commands.figures_drive(model, [bag], out, seed=seed, keep=[], settings=settings)


def dac(model: Path, out: Path, file: Path | None) -> int:
    """Repeat figure 10 with both laws; return 1 where a voltage is off its law by more than the converter's steps."""
    folder = out.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    script = (file or shipped("launch/paper/figure_10.yaml")).resolve()
    series, lines, worst = [], [], 0.0
    step = _step()
    for law, name in LAWS.items():
        found = launches.dac(model.resolve(), law, script, folder)
        own = load_model(folder / f"figure_10_{law}.yaml").translation
        off = dac_line.off(found, own)
        worst = max(worst, float(np.abs(off).max()))
        series.append((name, found, own))
        lines.append(
            f"{name}: {len(found)} speeds, off by {1e3 * np.abs(off).max():.2f} mV at most, "
            f"{1e3 * np.sqrt(np.mean(off**2)):.2f} mV rms; a step is {1e3 * step:.2f} mV"
        )
    dac_line.draw(folder / "figure_10.svg", series)
    print("\n".join(lines))
    drawing.write(folder / "figure_10.txt", "\n".join(lines) + "\n")
    return int(worst > _CODES * step)


def _step() -> float:
    """Return the D/A converter's step [V]: of the example board's translation channel."""
    from kurumaisu import settings

    channel = settings.load(shipped(launches.DEVICE)).section("channels").section("translation")
    return 1 / channel.section("code").number("per_volt", above=0)


def simulated_wall(model: Path, out: Path, *, seed: int, speed: float, settings: Path | None) -> int:
    """Repeat figures 11 and 12 through laser_node and the virtual URG; return 1 where they do not agree with (4)."""
    folder = out.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    launches.wall(model.resolve(), load_options(settings), folder, seed=seed, speed=speed)
    return wall.figure_12([folder / "scans"], folder / "bench.yaml", folder, settings)


def everything(model: Path, out: Path, *, seed: int, settings: Path | None) -> int:
    """Repeat all figures one after the other; return 1 when one of them failed."""
    code = 0
    for title, part in (
        ("Figures 3 to 6, equations (1) and (2)", lambda: drive(model, out, seed=seed, speed=4.0, settings=settings)),
        (
            "Figures 7 to 9, equation (4)",
            lambda: wall.figures_wall_of(model, [], out, distances=(), seed=seed, settings=settings),
        ),
        (
            "The conjecture: range, or incidence",
            lambda: wall.asked(model, [], out, distances=(), seed=_RIDDLE_SEED, settings=settings, say=commands.say),
        ),
        ("Figure 10", lambda: dac(model, out, None)),
        (
            "Figures 11 and 12",
            lambda: simulated_wall(model, out, seed=seed, speed=2.0, settings=settings),
        ),
    ):
        print(f"\n{title}", flush=True)
        code |= part()
    return code
