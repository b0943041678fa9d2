# SPDX-License-Identifier: BSD-3-Clause
"""view RECORDING: look at measured drives in the browser, moment by moment, beside the simulated ones."""

from __future__ import annotations

import argparse
import signal
import sys
import threading
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from kurumaisu import program, settings
from kurumaisu.critic.app.options import name_list
from kurumaisu.critic.base.replay import model_of
from kurumaisu.critic.values.recording import Recording
from kurumaisu.critic.view.tape import Showing, read_album
from kurumaisu.errors import Error, failed
from kurumaisu.params import Model, load_model, shipped
from kurumaisu.viewer import Hub, Server, Source, ViewerSettings, read_settings, report
from kurumaisu.viewer.playback import Playback
from kurumaisu.world import load_world

_GLANCE = 0.1  # [s] after which it is seen whether all is to end
_EPILOG = """\
examples:
  view drive.bag                           one drive
  view drives/ --report criticism          with the critic's report, which leads
                                           to moments and places
  view drives/ --runs 'monday_*' --port 0  some drives, at any free port

Open the address that is printed: it holds the right to move the recording,
once. Ctrl-C ends it. More: docs/viewer_bag.md"""
# Where a report is looked for inside a recording that is a folder.
_USUAL = ("criticism", "report")


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve until Ctrl-C; return 0, or 1 for an input that cannot be shown."""
    options = _parser().parse_args(arguments)
    try:
        _serve(options)
    except Error as error:
        return failed("view", error)
    except KeyboardInterrupt:
        return 0
    return 0


def _serve(options: argparse.Namespace) -> None:
    folder = _report_folder(options.recording, options.report)
    print(f"view: reading {options.recording}", file=sys.stderr, flush=True)
    server = opened(options.recording, options.runs, options.model, folder, viewer_settings(options.port))
    stay(server)


def stay(server: Opened) -> None:
    """Serve, and tell where, until Ctrl-C or SIGTERM."""
    ended = threading.Event()
    ends = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(each, lambda *_: ended.set()) for each in ends]
    try:
        with server:
            print(f"{server.told}\nopen {server.address}", flush=True)
            # Looked at now and then: a thread of a library's may get the signal, which does not wake this one.
            while not ended.wait(_GLANCE):
                pass
    finally:
        for each, handler in zip(ends, before, strict=True):
            signal.signal(each, handler)


class Live(Source, Protocol):
    """What is shown goes on by itself."""

    def start(self) -> None:
        """Begin."""

    def close(self) -> None:
        """Stop."""


class Opened:
    """Something that is being served; a context that ends it."""

    def __init__(self, source: Live, server: Server, told: str) -> None:
        self.source, self.server, self.told = source, server, told

    def __enter__(self) -> Opened:
        """Begin to serve. Raise Error for an address that cannot be had."""
        self.server.start()
        self.source.start()
        return self

    def __exit__(self, *_: object) -> None:
        """End all."""
        self.server.close()
        self.source.close()

    @property
    def address(self) -> str:
        """Where to look, with a token."""
        return self.server.new_address()


def opened(
    path: Path, wanted: Sequence[str], model_file: Path | None, folder: Path | None, how: ViewerSettings
) -> Opened:
    """Return a recording ready to be served. folder: of the critic's report. Raise Error for what cannot be shown."""
    page = None if folder is None else report.check(folder)
    album = read_album(path, wanted)
    recording = album.recording
    place = None if recording.world is None else load_world(recording.world)
    showing = Showing(album, models(recording, model_file, folder), place)
    hub = Hub()
    source = Playback(hub, recording.name, showing.runs, showing.tape, showing.world(), how.rate)
    server = Server(how, hub, source, control=True)
    if page is not None:
        server.reports = {report.NAME: page}
        hub.report = report.ADDRESS
    shown = f"{recording.name}: {len(showing.runs)} {'run' if len(showing.runs) == 1 else 'runs'}"
    return Opened(source, server, f"{shown}{'' if page is None else f', report {page}'}")


def models(recording: Recording, model_file: Path | None, folder: Path | None) -> dict[str, Model]:
    """Return the model that the recording is compared with, and the extended one that lies in the report's folder."""
    file = model_file or recording.model or shipped("launch/md100.yaml")
    found = {"model": model_of(recording, file, assume_law=model_file is not None)}
    extended = None if folder is None else folder / "extended.yaml"
    if extended is not None and extended.is_file():
        found["extended"] = load_model(extended)
    return found


def viewer_settings(port: int | None) -> ViewerSettings:
    """Return launch/viewer.yaml, with another port if one is given. Raise Error naming file and key."""
    top = settings.load(shipped("launch/viewer.yaml"))
    how = read_settings(top)  # the other keys are the node's
    return how if port is None else replace(how, port=port)


def _report_folder(recording: Path, given: Path | None) -> Path | None:
    if given is not None or not recording.is_dir():
        return given
    return next((recording / name for name in _USUAL if (recording / name / report.NAME).is_file()), None)


def port_number(text: str) -> int:
    """Return a port. Raise ArgumentTypeError for anything else."""
    if not text.isdecimal() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"must be a whole number of 0 to 65535: {text!r}")
    return int(text)


def _parser() -> argparse.ArgumentParser:
    parser = program.text_parser("view", "Look at a recording in the browser, moment by moment.", _EPILOG)
    add = parser.add_argument
    add("recording", type=Path, metavar="RECORDING", help="a bag, a folder of runs or CSV tables, or an MRPT rawlog")
    add("--report", type=Path, metavar="FOLDER", help="what the critic wrote (criticism or report in the recording)")
    add("--runs", type=name_list, default=(), metavar="A,B", help="only these runs; patterns like drive_* are allowed")
    add("--model", type=Path, metavar="FILE", help="model to compare with (the recording's, else md100.yaml)")
    add("--port", type=port_number, metavar="N", help="port to listen at; 0 takes a free one (launch/viewer.yaml's)")
    return parser
