# SPDX-License-Identifier: BSD-3-Clause
"""What the command critic says: of one recording in words, of many as a table; for programs as JSON and CSV."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Sequence
from pathlib import Path

from kurumaisu.critic.app.display import aligned, cut, printable
from kurumaisu.critic.app.job import Outcome
from kurumaisu.critic.data.csv_reader import csv_text
from kurumaisu.critic.values.digits import bare, quantities
from kurumaisu.critic.values.verdict import Gain, Verdict, grouped, to_json
from kurumaisu.errors import Error
from kurumaisu.whole_files import write_whole

_NARROWEST = 12  # cells of a recording's name in a table
COLUMNS = (
    "recording",
    "verdict",
    "causes",
    "p",
    "confounded",
    "unknown",
    "gain_nats_per_sample",
    "gain_lo90",
    "gain_hi90",
    "problems",
    "seconds",
    "exit",
    "error",
    "output",
)


def summary(outcome: Outcome, width: int) -> str:
    """Return the verdict in words, lines at most so wide unless a word is wider; outcome must have one."""
    verdict = outcome.verdict
    assert verdict is not None
    lines = [f"verdict: {verdict.verdict}", outcome.headline, *(f"  {detail}" for detail in outcome.details)]
    for _, said in grouped([problem for problem in verdict.problems if problem not in outcome.details]):
        lines.append(f"  data: {said[0]}{f' (and {len(said) - 1} more like it)' if len(said) > 1 else ''}")
    if verdict.gain is not None:
        lines += _gain(verdict.gain)
    if outcome.paste:
        lines += ["for diff_drive_controller:", *(f"  {line}" for line in outcome.paste.split("\n"))]
    lines += [f"drive next: {outcome.next_drive}"] if outcome.next_drive else []
    return "\n".join(_wrapped(printable(line), width) for line in lines)


def _wrapped(line: str, width: int) -> str:
    """Return a line in several, all but the first indented further."""
    indent = " " * (len(line) - len(line.lstrip()))
    wrapper = textwrap.TextWrapper(
        width,
        initial_indent=indent,
        subsequent_indent=f"{indent}  ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    return "\n".join(wrapper.wrap(line.strip()))


def _gain(gain: Gain) -> list[str]:
    density = gain.log_density_per_sample
    interval = f"90 %: {density.lo90:+.3f} to {density.hi90:+.3f}"
    told = [f"gain on held-out data: {density.gain:+.3f} nats per sample ({interval})"]
    for name, error in gain.rmse.items():
        alone = [] if error.achievable is None else [error.achievable]
        before, after, *least = quantities([error.baseline, error.extended, *alone], error.unit)
        told.append(f"  {name}: rms error {bare(before)} -> {after}{f' (noise alone: {least[0]})' if least else ''}")
    for name, channel in gain.channels.items():
        told.append(f"  {name}: {channel.log_density_per_sample.gain:+.3g} nats per sample")
    return told


def as_json(outcome: Outcome, *, alone: bool) -> str:
    """Return one line of JSON: the verdict where it is the only one, else with the recording's name around it."""
    verdict = None if outcome.verdict is None else to_json(outcome.verdict)
    if alone and verdict is not None:
        return json.dumps(verdict, ensure_ascii=False, allow_nan=False)
    told = {
        "recording": str(outcome.job.recording),
        "output": None if verdict is None else str(outcome.job.output),
        "exit": outcome.code,
        "seconds": round(outcome.seconds, 1),
        "error": outcome.error or None,
        "verdict": verdict,
    }
    return json.dumps(told, ensure_ascii=False, allow_nan=False)


def table(outcomes: Sequence[Outcome], width: int) -> str:
    """Return a table of outcomes for people, each line at most so wide, and a line that counts the verdicts."""
    rows = [("recording", "verdict", "gain", "what")]
    for outcome in outcomes:
        gain = None if outcome.verdict is None else outcome.verdict.gain
        told = "" if gain is None else f"{gain.log_density_per_sample.gain:+.3f}"
        rows.append((outcome.job.name, outcome.word, told, _what(outcome)))
    longest = max(width // 3, _NARROWEST)
    lines = aligned([(cut(printable(name), longest), *others) for name, *others in rows], right=2)
    words = [outcome.word for outcome in outcomes]
    counts = ", ".join(f"{words.count(word)} {word}" for word in dict.fromkeys(sorted(words)))
    return "\n".join([*(cut(line, width) for line in lines), f"{len(outcomes)} recordings: {counts}"])


def write_table(path: Path, outcomes: Sequence[Outcome]) -> None:
    """Write a CSV table, one row for each outcome, whole or not at all. Raise Error when it cannot be written."""
    rows = [_row(outcome) for outcome in outcomes]
    try:
        write_whole({path: csv_text(COLUMNS, ([row.get(name, "") for name in COLUMNS] for row in rows))})
    except Error as error:
        raise Error(f"--table: {error}") from error


def _row(outcome: Outcome) -> dict[str, str | float | int]:
    row: dict[str, str | float | int] = {
        "recording": str(outcome.job.recording),
        "verdict": outcome.word,
        "seconds": f"{outcome.seconds:.1f}",
        "exit": outcome.code,
        "error": outcome.error,
    }
    verdict = outcome.verdict
    if verdict is None:
        return row
    row["output"] = str(outcome.job.output)
    row["causes"] = "; ".join(causes(verdict))
    row["p"] = "; ".join(f"{cause.p:.3f}" for cause in verdict.causes)
    row["confounded"] = "; ".join(" | ".join(group) for group in verdict.confounded)
    row["unknown"] = "; ".join(f"{item.channel} over {item.covariate}: {item.shape}" for item in verdict.unknown)
    row["problems"] = "; ".join(verdict.problems)
    if verdict.gain is not None:
        density = verdict.gain.log_density_per_sample
        row["gain_nats_per_sample"], row["gain_lo90"] = f"{density.gain:.4f}", f"{density.lo90:.4f}"
        row["gain_hi90"] = f"{density.hi90:.4f}"
    return row


def causes(verdict: Verdict) -> list[str]:
    """Return each cause with its parameters, on one line."""
    return [
        f"{cause.id} "
        + ", ".join(f"{name} {e.estimate:.3g}{'' if e.unit == '1' else f' {e.unit}'}" for name, e in values)
        for cause in verdict.causes
        for values in [cause.parameters.items()]
    ]


def _what(outcome: Outcome) -> str:
    """Return in short what is behind the verdict."""
    verdict = outcome.verdict
    if verdict is None:
        return outcome.error
    if verdict.verdict == "invalid_data":
        return verdict.problems[0] if verdict.problems else ""
    told = [*causes(verdict), *(f"one of {', '.join(group)}" for group in verdict.confounded)]
    told += [f"{item.channel} over {item.covariate}" for item in verdict.unknown]
    return "; ".join(told)
