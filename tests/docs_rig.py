# SPDX-License-Identifier: BSD-3-Clause
"""Runs the commands of docs_pages.py, each scene once, in a folder that looks like the source tree."""

import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
import xmlrpc.client
from collections.abc import Callable
from pathlib import Path
from typing import Any

from docs_pages import NOT_RUN, ROOT, SCENES, Command, End, Step, filled_in

PATIENCE = 300.0  # [s] for anything to come about: a busy machine may take a while
DRIVE = 10.0  # [s] of simulated time
FAULTS = re.compile(r"\[ ?(ERROR|FATAL)\]|Traceback|has died \[")  # in what a program or launch file prints


class CommandError(Exception):
    """A command did not do what its page says."""


class Running:
    """A command that goes on."""

    def __init__(self, text: str, folder: Path, environment: dict[str, str], log: Path) -> None:
        self.text, self._log = text, log
        with log.open("wb") as output:
            self.process = subprocess.Popen(
                ["bash", "-c", text],
                cwd=folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )

    @property
    def output(self) -> str:
        return self._log.read_text(encoding="utf-8", errors="replace")

    def wait(self, condition: Callable[[], object], what: str) -> None:
        """Return when the condition holds. Raise CommandError if the process ends before, or it takes too long."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            if self.process.poll() is not None:
                raise CommandError(f"ended with {self.process.returncode} before {what}:\n{self.output[-3000:]}")
            if time.monotonic() > deadline:
                raise CommandError(f"not within {PATIENCE:g} s: {what}\n{self.output[-3000:]}")
            time.sleep(0.05)

    def kill(self) -> None:
        """End it at once, with all that it started."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()

    def finish(self) -> int:
        """Wait for its end and return its exit code. Raise CommandError if it takes too long."""
        try:
            return self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.kill()
            raise CommandError(f"did not end within {PATIENCE:g} s:\n{self.output[-3000:]}") from None

    def interrupt(self) -> None:
        """End it as Ctrl-C does, and look at what it said."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGINT)
        try:
            self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.kill()
            raise CommandError(f"did not end after Ctrl-C:\n{self.output[-3000:]}") from None
        if FAULTS.search(self.output):
            raise CommandError(f"said:\n{self.output[-3000:]}")


class Reader:
    """Somebody who types what the pages say."""

    def __init__(self, folder: Path, commands: list[Command]) -> None:
        self.folder = folder
        self._commands = commands
        self._told: dict[str, str | None] = {}  # by the command as it is run: what is wrong with it
        self._processes: list[subprocess.Popen[Any]] = []
        self._started: list[Running] = []
        self._scratch()
        self._environment = os.environ | {"ROS_HOME": str(folder / "ros"), "PYTHONDONTWRITEBYTECODE": "1"}
        self._ear: subprocess.Popen[str] | None = None

    def close(self) -> None:
        for one in self._started:
            if one.process.poll() is None:
                one.kill()
        for process in reversed(self._processes):
            process.terminate()
            process.wait()

    def outcome(self, command: Command) -> str | None:
        """Run the scene that a command is in, unless it was; return what went wrong, or None. Raise KeyError."""
        text = filled_in(command.text, self.folder)
        if text not in self._told:
            scene = next((s for s in SCENES if any(re.search(step.pattern, command.text) for step in s)), None)
            if scene is None:
                raise KeyError(command.text)
            self._play(scene)
        return self._told[text]

    def start(self, text: str) -> Running:
        """Type something."""
        log = self.folder / f"out/{len(self._started) + 1}.log"
        self._started.append(Running(text, self.folder, self._environment, log))
        return self._started[-1]

    def _scratch(self) -> None:
        """Make the folder: links to the source tree, and a scripts/run that knows that it is in the environment."""
        for path in ROOT.iterdir():
            if path.name not in (".git", "scripts", "out"):
                (self.folder / path.name).symlink_to(path)
        for path in (self.folder / "scripts", self.folder / "tmp", self.folder / "out"):
            path.mkdir()
        for path in (ROOT / "scripts").iterdir():
            if path.name != "run":
                (self.folder / "scripts" / path.name).symlink_to(path)
        run = self.folder / "scripts/run"
        run.write_text('#!/bin/sh\nexec "$@"\n')
        run.chmod(0o755)

    def _ask(self, *question: str) -> Any:
        """Ask the listener; start it, and a master, at the first question."""
        if self._ear is None:
            with socket.socket() as probe:
                probe.bind(("localhost", 0))
                port = probe.getsockname()[1]
            self._environment |= {"ROS_MASTER_URI": f"http://localhost:{port}", "ROS_HOSTNAME": "localhost"}
            quiet = {"env": self._environment, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
            self._processes.append(subprocess.Popen(["rosmaster", "--core", "-p", str(port)], **quiet))
            self._ear = subprocess.Popen(
                [sys.executable, str(ROOT / "tests/docs_listener.py")],
                env=self._environment,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
            )
            self._processes.append(self._ear)
            assert self._ear.stdout is not None
            while self._ear.stdout.readline() not in ("ready\n", ""):  # rospy may say that it waits for the master
                continue
        assert self._ear.stdin is not None
        assert self._ear.stdout is not None
        print(*question, file=self._ear.stdin, flush=True)
        return json.loads(self._ear.stdout.readline())

    def _forget_parameters(self) -> None:
        """Leave nothing of the last scene on the parameter server, such as simulated time."""
        master = xmlrpc.client.ServerProxy(self._environment["ROS_MASTER_URI"])
        kept = ("/rosdistro", "/rosversion", "/run_id", "/roslaunch")
        for name in master.getParamNames("/docs")[2]:
            if not name.startswith(kept):
                master.deleteParam("/docs", name)

    def _play(self, scene: tuple[Step | End, ...]) -> None:
        self._ask("errors")
        self._forget_parameters()
        running: dict[str, Running] = {}
        for part in scene:
            if isinstance(part, End):
                self._judge(running[part.pattern].text, running.pop(part.pattern).interrupt)
                continue
            text = self._text(part)
            if text is None:
                continue
            self._judge(text, lambda part=part, text=text: self._do(part, text, running))
        for one in reversed(running.values()):
            self._judge(one.text, one.interrupt)

    def _judge(self, text: str, act: Callable[[], object]) -> None:
        """Do it, and note what went wrong, with what nodes logged as errors meanwhile."""
        try:
            act()
            errors = self._ask("errors")
            problem = f"nodes logged: {errors}" if errors else None
        except CommandError as error:
            problem = str(error)
        self._told[text] = self._told.get(text) or problem

    def _text(self, step: Step) -> str | None:
        """Return what to run for a step, None where no page has it any more."""
        run = [c for c in self._commands if not any(re.search(pattern, c.text) for pattern in NOT_RUN)]
        found = {filled_in(c.text, self.folder) for c in run if re.search(step.pattern, c.text)}
        assert len(found) <= 1, f"{step.pattern} is several commands: {found}"
        return found.pop() if found else None

    def _do(self, step: Step, text: str, running: dict[str, Running]) -> None:
        if step.ends:
            one = self.start(text)
            if (code := one.finish()) not in step.codes or FAULTS.search(one.output):
                raise CommandError(f"exit code {code}:\n{one.output[-3000:]}")
            return
        one = running[step.pattern] = self.start(text)
        try:
            if step.topic:
                one.wait(lambda: self._ask("topic", step.topic, "10"), f"something is on {step.topic}")
            if step.says:
                one.wait(lambda: step.says in one.output, f"it says {step.says}")
            if step.makes:
                one.wait((self.folder / step.makes).exists, f"{step.makes} is there")
            if step.drives:
                self._watch_drive()
        except CommandError:
            running.pop(step.pattern).kill()
            raise
        if not step.stays:
            running.pop(step.pattern).interrupt()

    def _watch_drive(self) -> None:
        """See the chair drive: it moves, and hits nothing."""
        seen = self._ask("drive", str(DRIVE), str(PATIENCE))
        if seen["seconds"] < DRIVE or seen["way"] < 0.3 or seen["turn"] < 1.0 or seen["hits"]:
            raise CommandError(f"the drive: {seen}")
