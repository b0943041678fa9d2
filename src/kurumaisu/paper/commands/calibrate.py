# SPDX-License-Identifier: BSD-3-Clause
"""One's own chair and laser: from recordings to model files, and what they are worth on data that were not fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from kurumaisu.critic.data.reference import with_reference
from kurumaisu.critic.values.recording import Recording, Series
from kurumaisu.errors import Error
from kurumaisu.paper import drawing
from kurumaisu.paper.chair import held_out
from kurumaisu.paper.chair.samples import samples_of
from kurumaisu.paper.commands import drive as commands
from kurumaisu.paper.commands import wall as commands_wall
from kurumaisu.paper.laser import held_out as held_out_laser
from kurumaisu.paper.laser import law_file, wall_experiment
from kurumaisu.paper.laser.wall import ahead_of, places_of
from kurumaisu.paper.options import load_options
from kurumaisu.params import load_model

BETTER, NO_BETTER = "the new law is better", "the new law is NO better: keep the model that you have"


def drive(
    model: Path, train: Sequence[Path], test: Sequence[Path], out: Path, *, keep: Sequence[str], settings: Path | None
) -> int:
    """Write the chair's law from drives, and show before and after on others.

    Return 0, or 1 where a branch is refused (nothing is written), or where the new law is no better than the model's.
    Raise Error for what is wrong with a file.
    """
    options = load_options(settings)
    code = commands.figures_drive(model, train, out, seed=0, keep=keep, settings=settings)
    if code:
        return code
    judged = with_reference(commands.read_all(test), options.bootstrap.seed, commands.say)
    runs = [run for run in judged.runs if run.voltage is not None and run.pose is not None]
    if not runs:
        raise Error(f"{judged.name}: the held-out drive has no voltages together with poses")
    samples = samples_of(runs, judged.truth, options.drive)
    before, after = (held_out.errors(load_model(path), samples, runs) for path in (model, out / "chair.yaml"))
    lines = held_out.lines(before, after)
    better = after.better_than(before, options.drive.better)
    lines.append(BETTER if better else NO_BETTER)
    print("\n".join(lines))
    drawing.write(out / "held_out.txt", "\n".join(lines) + "\n")
    return int(not better)


def laser(
    model: Path,
    recordings: Sequence[Path],
    distances: Sequence[float],
    out: Path,
    *,
    test: Sequence[Path],
    settings: Path | None,
) -> int:
    """Write the laser's equation (4) from scans of a wall; show before and after on others.

    test: of the wall, put up again at the same distances; where there is none, every other scan is held out. Return 0,
    or 1 where the new law is no better. Raise Error for what is wrong with a file, or with the wall.
    """
    options = load_options(settings)
    fitted, held, wall = commands.read_all(recordings), commands.read_all(test) if test else None, options.wall
    if held is None:
        wall = replace(wall, least_scans=max(2, wall.least_scans // 2))
        fitted, held = (_every_other(fitted, first) for first in (0, 1))
    law, ahead = commands_wall.fit(fitted, distances, model, wall.tape_sd, replace(options, wall=wall), out)
    head = [
        f"Equation (4) was identified from {', '.join(path.name for path in recordings)}: {len(ahead)} distances.",
        f"{100 * options.bootstrap.level:.0f} % intervals; distances taped to {1e3 * wall.tape_sd:g} mm:",
    ]
    law_file.write_laser(model, law, head, out / "laser.yaml")
    print("\n".join(commands_wall.law_rows(law, law_file.printed(model))))
    places = [ahead_of(place, wall) for place in places_of(held, distances, load_model(model).laser, wall)]
    laws = load_model(model).laser.error, load_model(out / "laser.yaml").laser.error
    judged = held_out_laser.judge(laws, places, wall_experiment.resolution(model), options.bootstrap.level)
    lines = held_out_laser.lines(judged, options.bootstrap.level)
    lines.append(BETTER if judged.better else NO_BETTER)
    print("\n".join(lines))
    print(f"model with this law: {out / 'laser.yaml'}")
    drawing.write(out / "held_out_laser.txt", "\n".join(lines) + "\n")
    return int(not judged.better)


def _every_other(recording: Recording, first: int) -> Recording:
    runs = []
    for run in recording.runs:
        if run.scan is not None:
            scan = Series(run.scan.t[first::2], run.scan.values[first::2], run.scan.columns)
            runs.append(replace(run, scan=scan))
    return replace(recording, runs=tuple(runs))
