# SPDX-License-Identifier: BSD-3-Clause
"""Many recordings: on processes of this machine, or on a Dask cluster that is there."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from multiprocessing.connection import Connection, wait
from typing import Any

from kurumaisu.critic.app.display import Display
from kurumaisu.critic.app.job import Job, Outcome, run
from kurumaisu.critic.processes.worker import ProgressMessage, Worker
from kurumaisu.errors import Error

_TICK = 0.5  # [s] between looks at the clock of the display
_HELLO = 10.0  # [s] in which a cluster's scheduler must answer


def on_processes(jobs: Sequence[Job], count: int, display: Display) -> Iterator[Outcome]:
    """Yield outcomes as they come, of so many jobs at a time; a process that dies costs its job only."""
    waiting = deque(jobs)
    idle = [Worker() for _ in range(min(count, len(jobs)))]
    busy: dict[Connection, tuple[Worker, Job]] = {}
    try:
        while waiting or busy:
            while waiting and idle:
                worker, job = idle.pop(), waiting.popleft()
                busy[worker.connection] = worker, job
                worker.send(run, job)
                display.start(job.name)
            display.draw()
            for ready in wait(list(busy), _TICK):
                assert isinstance(ready, Connection)
                worker, job = busy[ready]
                try:
                    message = worker.receive()
                except EOFError:
                    message = Outcome(job, 0.0, error=worker.died_of())
                if isinstance(message, ProgressMessage):
                    display.tell(job.name, message.message)
                    continue
                del busy[ready]
                if message.verdict is None:  # it may be dead, or out of memory
                    worker.close()
                    worker = Worker()
                idle.append(worker)
                display.end(message)
                yield message
    finally:
        for worker in [*idle, *(worker for worker, _ in busy.values())]:
            worker.close()


def on_dask(jobs: Sequence[Job], address: str, display: Display) -> Iterator[Outcome]:
    """Yield outcomes as a cluster delivers them; its workers must know this package and see the same folders.

    Raise Error when Dask is not installed or nobody answers.
    """
    try:
        from distributed import Client, as_completed
    except ImportError as error:
        install = "apt-get install python3-distributed, or pip install distributed"
        raise Error(f"--dask: needs Dask's package distributed ({install}): {error}") from error
    try:
        client = Client(address, timeout=_HELLO, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise Error(f"--dask: {address}: no scheduler answers within {_HELLO:g} s: {error}") from error
    # One by one: a worker that a job kills is taken up by Dask again, but not for the same job.
    futures: dict[Any, Job] = {}
    try:
        for job in jobs:
            futures[client.submit(run_quietly, _absolute(job), pure=False, retries=0)] = job
        for future in as_completed(list(futures), loop=client.loop):
            outcome = _outcome(future, futures[future])
            display.end(outcome)
            yield outcome
    finally:
        client.cancel(list(futures), force=True)
        client.close()


def run_quietly(job: Job) -> Outcome:
    """Run a job where nobody hears of its progress."""
    return run(job, lambda _: None)


def _outcome(future: Any, job: Job) -> Outcome:
    error = future.exception()
    if error is not None:
        return Outcome(job, 0.0, error=f"on the cluster: {type(error).__name__}: {' '.join(str(error).split())}")
    outcome: Outcome = future.result()
    return replace(outcome, job=job)


def _absolute(job: Job) -> Job:
    """Return the job with paths that mean the same from another folder."""
    model = None if job.model is None else job.model.resolve()
    return replace(job, recording=job.recording.resolve(), output=job.output.resolve(), model=model)
