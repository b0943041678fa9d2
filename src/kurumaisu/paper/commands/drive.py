# SPDX-License-Identifier: BSD-3-Clause
"""The commands of scripts/paper that need no ROS: each repeats some of the paper's figures."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.values.recording import Recording
from kurumaisu.paper.chair import drive, identify, law_file
from kurumaisu.paper.options import load_options
from kurumaisu.params import load_model
from kurumaisu.whole_files import write_whole


def say(line: str) -> None:
    """Print progress, beside what is asked for."""
    print(line, file=sys.stderr, flush=True)


def figures_drive(
    model: Path, recordings: Sequence[Path], out: Path, *, seed: int, keep: Sequence[str], settings: Path | None
) -> int:
    """Repeat figures 3 to 6 from recordings, or from a simulated drive where there is none; write the law.

    Return 0, or 1 where a branch is refused: then no law is written. Raise Error for what is wrong with a file.
    """
    options = load_options(settings)
    chair = load_model(model)
    recording = read_all(recordings) if recordings else drive.recorded(drive.uneven(chair), drive.IDENTIFICATION, seed)
    found = identify.identify(recording, options, say)
    identify.write(found, chair, out)
    told = identify.lines(found, (chair.translation, chair.steering))
    print("\n".join(told))
    write_whole({out / "equations_1_2.txt": "\n".join(told) + "\n"})
    kept = set(keep)
    if any(why.split(":")[0] not in kept for why in found.refused):
        print("no law is written: --keep takes a refused branch from the model")
        return 1
    where = ", ".join(path.name for path in recordings) or f"a simulated drive on {chair.name}, seed {seed}"
    laws = law_file.settled(model, found.fits, keep)
    head = provenance(where, found, options.bootstrap.level)
    law_file.write_law(model, found.fits, laws, head, out / "chair.yaml")
    print(f"model with this law: {out / 'chair.yaml'}")
    return 0


def provenance(where: str, found: identify.Identification, level: float) -> list[str]:
    """Return the comments at the head of a model file that was found."""
    return [
        f"The law `custom` was identified from {where}; errors in both variables, robust.",
        f"After each branch: its {100 * level:.0f} % interval by block bootstrap, and the rates that it was fitted at.",
        f"Reference pose: {found.source}. {int(found.samples.steady.sum())} steady samples.",
        *(f"NOTE: {words}" for words in found.warnings),
    ]


def read_all(paths: Sequence[Path]) -> Recording:
    """Return the runs of several recordings as one; the reference's error is the first one's that states it."""
    found = [read_recording(path) for path in paths]
    runs = tuple(run for recording in found for run in recording.runs)
    truth = next((recording.truth for recording in found if recording.truth is not None), None)
    problems = tuple(words for recording in found for words in recording.problems)
    invalid = tuple(words for recording in found for words in recording.invalid)
    name = found[0].name if len(found) == 1 else f"{len(found)} recordings"
    for words in problems:
        say(f"note: {words}")
    return replace(found[0], name=name, runs=runs, truth=truth, problems=problems, invalid=invalid)
