# SPDX-License-Identifier: BSD-3-Clause
"""One recording to criticise, and what came of it: values that can be sent to another process or machine."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from kurumaisu.critic import pipeline
from kurumaisu.critic.data.excerpt import WHOLE, Excerpt
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.data.reference import with_reference
from kurumaisu.critic.values.criticism import Criticism
from kurumaisu.critic.values.verdict import Verdict
from kurumaisu.errors import Error, one_line
from kurumaisu.params import Robot, shipped

# What a shell sees; 2 is a wrong command line (argparse), 130 Ctrl-C.
ERROR = 1
CODES = {"none": 0, "named": 3, "confounded": 4, "unknown": 5, "invalid_data": 6}


@dataclass(frozen=True)
class Job:
    """A recording, the folder to write into, and what was asked.

    name: for the table; model: None takes the recording's, else the package's; runs: only these, empty takes all;
    ids: effects that may be named, None takes all; seed: of the particle filter that makes a missing reference;
    slam: whether SLAM is run with both models; excerpt: what of each run is used; robot: which it is, None: as the
    recording says.
    """

    recording: Path
    output: Path
    name: str = ""
    model: Path | None = None
    runs: tuple[str, ...] = ()
    ids: frozenset[str] | None = None
    seed: int = 1
    slam: bool = False
    excerpt: Excerpt = WHOLE
    robot: Robot | None = None


@dataclass(frozen=True)
class Outcome:
    """What came of a job after so many seconds of wall time.

    next_drive: what to drive next, paste: lines for the robot's own software, or empty; error: why there is no
    verdict, on one line; trace: the stack, where that is the critic's own fault.
    """

    job: Job
    seconds: float
    verdict: Verdict | None = None
    headline: str = ""
    details: tuple[str, ...] = ()
    next_drive: str = ""
    paste: str = ""
    error: str = ""
    trace: str = ""

    @property
    def word(self) -> str:
        """Return the verdict's word, or 'error'."""
        return "error" if self.verdict is None else self.verdict.verdict

    @property
    def code(self) -> int:
        """Return the exit code that says so."""
        return ERROR if self.verdict is None else CODES[self.verdict.verdict]


def run(job: Job, progress: Callable[[str], None]) -> Outcome:
    """Criticise and write; whatever goes wrong is told in the outcome, so that other jobs go on."""
    start = time.monotonic()
    try:
        criticism = criticise(job, progress)
    except Exception as error:
        trace = "" if isinstance(error, Error) else traceback.format_exc()
        return Outcome(job, time.monotonic() - start, error=why_none(error), trace=trace)
    seconds = time.monotonic() - start
    story = criticism.story
    return Outcome(job, seconds, criticism.verdict, story.headline, story.details, story.next_drive, story.paste)


def why_none(error: Exception) -> str:
    """Return in one line why there is no verdict: by the input, or by the critic's own fault."""
    if isinstance(error, Error):
        return one_line(error)
    return f"the critic itself failed: {type(error).__name__}: {' '.join(str(error).split())}"


def criticise(job: Job, progress: Callable[[str], None]) -> Criticism:
    """Read, criticise and write into the job's folder. Raise Error naming what is wrong with the input."""
    progress(f"reading {job.recording}")
    read = read_recording(job.recording, job.runs, job.excerpt, job.robot)
    recording = with_reference(read, job.seed, progress)
    model = job.model or recording.model or shipped("launch/md100.yaml")
    criticism = pipeline.criticise(
        recording, model, progress, assume_law=job.model is not None, ids=job.ids, slam=job.slam
    )
    pipeline.write(criticism, model, job.output)
    return criticism
