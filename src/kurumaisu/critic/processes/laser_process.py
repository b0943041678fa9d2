# SPDX-License-Identifier: BSD-3-Clause
"""The criticism of the scans in a process of its own, while that of the drives goes on in this one."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path

from kurumaisu.critic.judge.scan_verdict import scan_findings
from kurumaisu.critic.processes.worker import Worker
from kurumaisu.critic.ranges.scans.gathering import why_not_usable
from kurumaisu.critic.values.criticism import LaserFinding
from kurumaisu.critic.values.recording import Recording
from kurumaisu.params import Model, load_model

_FINDINGS = 2  # that scan_findings yields
_MANY = 500  # scans from which it is worth the second that another interpreter needs

Tell = Callable[[str], None]


@contextmanager
def criticise_in_own_process(
    recording: Recording, model: Model, model_file: Path, ids: frozenset[str] | None
) -> Iterator[Callable[[Tell], Iterator[LaserFinding]]]:
    """Give a function that yields what scan_findings does, which may have been found out meanwhile.

    model_file: of the model, whose laws of the voltages no scan depends on.
    It makes no difference to the result where that happens; what fails in the other process is done again in this one.
    """
    scans = sum(len(run.scan.t) for run in recording.runs if run.scan is not None)
    apart = scans >= _MANY and len(os.sched_getaffinity(0)) > 1 and why_not_usable(recording) is None
    worker = Worker() if apart else None
    if worker is not None:
        worker.send(_criticise, recording, model_file, ids)

    def findings(progress: Tell) -> Iterator[LaserFinding]:
        count = 0
        with suppress(EOFError):  # it has died, of whatever it was
            while worker is not None and count < _FINDINGS:
                if isinstance(found := worker.receive(), LaserFinding):
                    count += 1
                    yield found
        if count < _FINDINGS:
            yield from islice(scan_findings(recording, model, progress, ids), count, None)

    try:
        yield findings
    finally:
        if worker is not None:
            worker.close()


def _criticise(
    recording: Recording, model_file: Path, ids: frozenset[str] | None, progress: Tell
) -> Iterator[LaserFinding]:
    return scan_findings(recording, load_model(model_file), progress, ids)
