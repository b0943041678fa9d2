# SPDX-License-Identifier: BSD-3-Clause
"""The criticism of the scans in a process of its own, while that of the drives goes on in this one."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.critic.processes.worker import ProgressMessage, Worker
from kurumaisu.critic.ranges.scans.gathering import why_not_usable
from kurumaisu.critic.values.criticism import LaserFinding
from kurumaisu.critic.values.recording import Recording
from kurumaisu.params import Model, load_model

_MANY = 500  # scans from which it is worth the second that another interpreter needs

Tell = Callable[[str], None]


@contextmanager
def criticise_in_own_process(
    recording: Recording, model: Model, model_file: Path, ids: frozenset[str] | None
) -> Iterator[Callable[[Tell], LaserFinding]]:
    """Give a function that returns what the scans say, which may have been found out meanwhile.

    model_file: of the model, whose laws of the voltages no scan depends on.
    It makes no difference to the result where that happens; what fails in the other process is done again in this one.
    """
    scans = sum(len(run.scan.t) for run in recording.runs if run.scan is not None)
    apart = scans >= _MANY and len(os.sched_getaffinity(0)) > 1 and why_not_usable(recording) is None
    worker = Worker() if apart else None
    if worker is not None:
        worker.send(_criticise, recording, model_file, ids)

    def finding(progress: Tell) -> LaserFinding:
        found = None
        with suppress(EOFError):  # it has died, of whatever it was
            while worker is not None and isinstance(found := worker.receive(), ProgressMessage):
                pass
        return found if isinstance(found, LaserFinding) else criticise_scans(recording, model, progress, ids)

    try:
        yield finding
    finally:
        if worker is not None:
            worker.close()


def _criticise(recording: Recording, model_file: Path, ids: frozenset[str] | None, progress: Tell) -> LaserFinding:
    return criticise_scans(recording, load_model(model_file), progress, ids)
