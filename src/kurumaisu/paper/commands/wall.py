# SPDX-License-Identifier: BSD-3-Clause
"""Figures 7, 8, 9 and equation (4); figures 11, 12 once their scans are there; the paper's conjecture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from kurumaisu._core import LaserError
from kurumaisu.critic.values.recording import Recording
from kurumaisu.errors import Error
from kurumaisu.paper import drawing
from kurumaisu.paper.commands.drive import read_all
from kurumaisu.paper.laser import conjecture, figures, law_file, wall_experiment
from kurumaisu.paper.laser import law as laser_law
from kurumaisu.paper.laser.law import NAMES, Agreement, LaserLaw
from kurumaisu.paper.laser.wall import Ahead, ahead_of, places_of
from kurumaisu.paper.options import PaperOptions, load_options
from kurumaisu.params import load_model
from kurumaisu.riddles import figure9, lab


def figures_wall_of(
    model: Path, recordings: Sequence[Path], out: Path, *, distances: Sequence[float], seed: int, settings: Path | None
) -> int:
    """Repeat figures 7 to 9 from recordings of a wall, or from the simulated board; write the law. Return 0.

    distances [m]: of the recordings' runs, in the order of their names; none: the paper's. Raise Error for what is
    wrong with a file, or with the wall.
    """
    options = load_options(settings)
    taped = list(distances) or list(options.wall.distances)
    if recordings:
        recording, laser_model, tape_sd = read_all(recordings), model, options.wall.tape_sd
    else:
        laser_model, tape_sd = bench(model, options, out), 0.0
        recording = wall_experiment.simulated(laser_model, options.wall, seed)
    law, ahead = fit(recording, taped, laser_model, tape_sd, options, out)
    told = judged(ahead, laser_model, options)
    figures.data(out / "figures_8_9.csv", ahead, told)
    lines = [*rows(told, ahead), *law_rows(law, law_file.printed(model))]
    print("\n".join(lines))
    drawing.write(out / "equation_4.txt", "\n".join(lines) + "\n")
    where = ", ".join(path.name for path in recordings) or f"a simulated board, seed {seed}"
    head = [
        f"Equation (4) was identified from {where}: {len(ahead)} distances, {len(ahead[0].readings)} scans each.",
        f"{100 * options.bootstrap.level:.0f} % intervals, scans drawn again, distances taped to {1e3 * tape_sd:g} mm:",
    ]
    law_file.write_laser(model, law, head, out / "laser.yaml")
    print(f"model with this law: {out / 'laser.yaml'}")
    return 0


def bench(model: Path, options: PaperOptions, out: Path) -> Path:
    """Write the bench's model file into a folder, and return its path."""
    path = out / "bench.yaml"
    drawing.write(path, "")
    wall_experiment.write_model(model, options.wall, path)
    return path


def fit(
    recording: Recording, distances: Sequence[float], model: Path, tape_sd: float, options: PaperOptions, out: Path
) -> tuple[LaserLaw, list[Ahead]]:
    """Return equation (4) of a recording and what it is made of; draw figures 7, 8 and 9."""
    if recording.invalid:
        raise Error(f"{recording.name}: {'; '.join(recording.invalid)}")
    laser = load_model(model).laser
    places = places_of(recording, distances, laser, options.wall)
    ahead = [ahead_of(place, options.wall) for place in places]
    law = laser_law.fit(ahead, wall_experiment.resolution(model), tape_sd, options.bootstrap)
    metre = min(places, key=lambda place: abs(place.distance - 1.0))
    figures.scan(out / "figure_7.svg", metre)
    figures.against_distance(out / "figures_8_9.svg", ahead, law, laser.error)
    figures.coefficients(out / "equation_4.csv", law, law_file.printed(model))
    return law, ahead


def judged(ahead: Sequence[Ahead], model: Path, options: PaperOptions) -> list[Agreement]:
    """Return how each distance agrees with the model's (4)."""
    error: LaserError = load_model(model).laser.error
    resolution = wall_experiment.resolution(model)
    return [laser_law.agreement(place, error, resolution, options.wall) for place in ahead]


def rows(told: Sequence[Agreement], ahead: Sequence[Ahead]) -> list[str]:
    """Return each distance against (4), as text."""
    lines = ["distance    mean [m]   by (4)   off [se]   sd [mm]   by (4)   p      all of the wall: x [m], sd [mm]"]
    for one, place in zip(told, ahead, strict=True):
        lines.append(
            f"{one.distance:5.1f} m   {one.mean:9.5f}{one.expected_mean:9.5f}{one.off:+9.2f}   {1e3 * one.sd:7.3f}"
            f"{1e3 * one.expected_sd:9.3f}   {one.p:.3f}   {place.flat_mean:.5f}, {1e3 * place.flat_sd:.2f}"
        )
    return lines


def law_rows(law: LaserLaw, printed: Sequence[float]) -> list[str]:
    """Return the coefficients with their intervals beside the model's, as text."""
    lines = [f"{'coefficient':14s}{'found':>11s}{'interval':>26s}{'model':>11s}"]
    for name, c, own in zip(NAMES, law.coefficients, printed, strict=True):
        lines.append(f"{name:14s}{c.value:11.6f}{f'{c.low:.6f} to {c.high:.6f}':>26s}{own:11.6f}")
    lines.append(
        f"means lie {1e3 * law.bend:.3f} mm off the line; noise and tape alone: {1e3 * law.bend_by_noise:.3f} mm"
    )
    return lines


def figure_12(recordings: Sequence[Path], bench_model: Path, out: Path, settings: Path | None) -> int:
    """Draw figures 11, 12 of scans of the simulated wall, test whether these agree with (4); return 1 if not."""
    options = load_options(settings)
    laser = load_model(bench_model).laser
    places = places_of(read_all(recordings), options.wall.distances, laser, options.wall)
    ahead = [ahead_of(place, options.wall) for place in places]
    told = judged(ahead, bench_model, options)
    figures.setting(out / "figure_11.svg", places, wall_experiment.walls())
    figures.simulated(out / "figure_12.svg", ahead, told, laser.error, options.wall.agree)
    figures.data(out / "figure_12.csv", ahead, told)
    lines = rows(told, ahead)
    print("\n".join(lines))
    drawing.write(out / "figure_12.txt", "\n".join(lines) + "\n")
    wrong = [one for one in told if not one.agrees]
    for one in wrong:
        print(f"at {one.distance:g} m it does not agree with (4)")
    return int(bool(wrong))


def asked(
    model: Path,
    recordings: Sequence[Path],
    out: Path,
    *,
    distances: Sequence[float],
    seed: int,
    settings: Path | None,
    say: Callable[[str], None],
) -> int:
    """Ask the critic whether noise rises with range or with incidence: of recordings, or of data made either way.

    distances [m]: of the runs, in the order of their names; then the law of the beams straight ahead is found first.
    """
    options, lines = load_options(settings), []
    if recordings:
        whole, own = read_all(recordings), load_model(model)
        if distances:
            found = conjecture.answer(whole, distances, own, wall_experiment.resolution(model), options)
            words = "held against the law of the beams straight ahead"
        else:
            found = lab.laser_answer(whole, own, conjecture.ASKED)
            words = f"held against the law of {model.name}; with --distances against that of the beams straight ahead"
        lines.append(f"range or incidence, by every beam, {words}: {found.told()}")
        print(lines[-1])
    else:
        for line in (*figure9.tell(seed), *conjecture.tell(seed, wall_experiment.resolution(model), options)):
            print(line, flush=True)
            lines.append(line)
    drawing.write(out / "conjecture.txt", "\n".join(lines) + "\n")
    say(f"written: {out / 'conjecture.txt'}")
    return 0
