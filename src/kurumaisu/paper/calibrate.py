# SPDX-License-Identifier: BSD-3-Clause
"""One's own chair and laser: from recordings to model files, and what they are worth on data that were not fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from kurumaisu.critic.recording import Recording, Series
from kurumaisu.critic.reference import with_reference
from kurumaisu.errors import Error
from kurumaisu.paper import commands, commands_wall, drawing, held_out, laser_file
from kurumaisu.paper.options import load_options
from kurumaisu.paper.samples import samples_of
from kurumaisu.paper.wall import Ahead, ahead_of, places_of
from kurumaisu.params import Model, load_model


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
    lines.append("the new law is better" if better else "the new law is NO better: keep the model that you have")
    print("\n".join(lines))
    drawing.write(out / "held_out.txt", "\n".join(lines) + "\n")
    return int(not better)


def laser(
    model: Path, recordings: Sequence[Path], distances: Sequence[float], out: Path, *, settings: Path | None
) -> int:
    """Write the laser's equation (4) from every other scan of a wall; show before and after on the scans between them.

    Return 0, or 1 where the new law is no better. Raise Error for what is wrong with a file, or with the wall.
    """
    options = load_options(settings)
    whole = commands.read_all(recordings)
    train, test = (_every_other(whole, first) for first in (0, 1))
    halved = replace(options, wall=replace(options.wall, least_scans=max(2, options.wall.least_scans // 2)))
    law, ahead = commands_wall.fit(train, distances, model, options.wall.tape_sd, halved, out)
    head = [
        f"Equation (4) was identified from {', '.join(path.name for path in recordings)}: {len(ahead)} distances.",
        f"{100 * options.bootstrap.level:.0f} % intervals; distances taped to {1e3 * options.wall.tape_sd:g} mm:",
    ]
    laser_file.write_laser(model, law, head, out / "laser.yaml")
    print("\n".join(commands_wall.law_rows(law, laser_file.printed(model))))
    held = [ahead_of(p, options.wall) for p in places_of(test, distances, load_model(model).laser, halved.wall)]
    before, after = (_log_density(load_model(path), held) for path in (model, out / "laser.yaml"))
    told = f"log density of a held-out reading: before {before:.3f}, after {after:.3f} nats"
    better = after > before
    lines = [told, "the new law is better" if better else "the new law is NO better: keep the model that you have"]
    print("\n".join(lines))
    print(f"model with this law: {out / 'laser.yaml'}")
    drawing.write(out / "held_out_laser.txt", "\n".join(lines) + "\n")
    return int(not better)


def _log_density(model: Model, held: Sequence[Ahead]) -> float:
    """Return the mean log density of readings [nats per reading, of metres]."""
    error = model.laser.error
    found = []
    for place in held:
        sd = error.deviation(place.true)
        z = (place.readings - error.mean(place.true)) / sd
        found.append(np.mean(-0.5 * z**2 - np.log(sd) - 0.5 * np.log(2 * np.pi)))
    return float(np.mean(found))


def _every_other(recording: Recording, first: int) -> Recording:
    runs = []
    for run in recording.runs:
        if run.scan is not None:
            scan = Series(run.scan.t[first::2], run.scan.values[first::2], run.scan.columns)
            runs.append(replace(run, scan=scan))
    return replace(recording, runs=tuple(runs))
