# SPDX-License-Identifier: BSD-3-Clause
"""critic RECORDING: say what a model gets wrong about a measured robot."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from kurumaisu.critic import pipeline
from kurumaisu.critic.explain import Criticism
from kurumaisu.critic.reading import read_recording
from kurumaisu.critic.reference import with_reference
from kurumaisu.errors import Error, one_line
from kurumaisu.params import shipped

_WIDTH = 100  # characters of a line of progress


def main(arguments: Sequence[str] | None = None) -> int:
    """Criticise a recording; return 0, or 2 when the input cannot be used."""
    options = _parser().parse_args(arguments)
    try:
        criticism = run(options.recording, options.output, options.model, options.seed)
    except Error as error:
        print(f"critic: {one_line(error)}", file=sys.stderr)
        return 2
    print(summary(criticism))
    print(f"report: {options.output / 'report.html'}")
    return 0


def run(recording_path: Path, output: Path, model: Path | None, seed: int) -> Criticism:
    """Read, criticise and write into a folder. Raise Error naming what is wrong with the input."""

    def progress(message: str) -> None:
        """Overwrite one line of a terminal; elsewhere keep every line."""
        start, end = ("\r\033[K", "") if sys.stderr.isatty() else ("", "\n")
        print(f"{start}critic: {message}"[:_WIDTH], end=end, file=sys.stderr, flush=True)

    progress(f"reading {recording_path}")
    recording = read_recording(recording_path)
    recording = with_reference(recording, seed, progress)
    model_file = model or recording.model or shipped("launch/md100.yaml")
    criticism = pipeline.criticise(recording, model_file, progress, assume_law=model is not None)
    pipeline.write(criticism, model_file, output)
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr, flush=True)
    return criticism


def summary(criticism: Criticism) -> str:
    """Return the verdict for a terminal."""
    verdict, story = criticism.verdict, criticism.story
    lines = [f"verdict: {verdict.verdict}", story.headline, *(f"  {detail}" for detail in story.details)]
    if verdict.gain is not None:
        density = verdict.gain.log_density_per_sample
        interval = f"90 % {density.lo90:+.3f} to {density.hi90:+.3f}"
        lines.append(f"gain on held-out data: {density.gain:+.3f} nats per sample ({interval})")
        lines += [
            f"  {name}: rms error {error.baseline:.3f} -> {error.extended:.3f} {error.unit}"
            for name, error in verdict.gain.rmse.items()
        ]
    return "\n".join(lines)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="critic", description="Say what a model gets wrong about a measured robot.")
    parser.add_argument("recording", type=Path, help="a bag, a folder of runs or CSV tables, or an MRPT rawlog")
    parser.add_argument("-o", "--output", type=Path, default=Path("criticism"), help="folder to write into")
    parser.add_argument("--model", type=Path, help="model to criticise (default: the recording's, else md100.yaml)")
    parser.add_argument("--seed", type=int, default=1, help="of the particle filter that makes a missing reference")
    return parser
