# SPDX-License-Identifier: BSD-3-Clause
"""A recording as a source: plays, holds, and shows any moment of any of its runs."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from kurumaisu.errors import Error
from kurumaisu.names import hint
from kurumaisu.viewer import protocol
from kurumaisu.viewer.hub import Hub
from kurumaisu.viewer.play_clock import PlayClock
from kurumaisu.viewer.protocol import Fan, Line, Paths, State, World
from kurumaisu.viewer.source import Outcome
from kurumaisu.viewer.tape import Held, Tape

CHAIR = "chair"  # id of the body that was measured
_LINE = 4000  # points of a path that is shown
_PIECE = re.compile(r"\[\d+/\d+\]$")  # the critic takes very long runs in pieces
_NO_SCAN = Fan((0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0, ())


class Playback:
    """Shows tapes in a hub.

    runs: their names; load: returns the tape of a run, and may take a while; world: has a body CHAIR; rate [Hz]: of
    frames while it plays. Nothing is shown before start.
    """

    mode = "bag"
    abilities = frozenset({"seek", "play", "rate", "run"})
    limits: Mapping[str, float] | None = None

    def __init__(
        self, hub: Hub, title: str, runs: Sequence[str], load: Callable[[str], Tape], world: World, rate: float
    ) -> None:
        self.title = title
        self._hub, self._runs, self._load, self._world = hub, tuple(runs), load, world
        self._pause = 1 / rate
        self._chair = next(i for i, body in enumerate(world.bodies) if body.id == CHAIR)
        self._news = threading.Condition()
        self._loading = threading.Lock()
        self._watched = self._closed = False
        self._tape = load(self._runs[0])
        self._clock = PlayClock(self._tape.begin, self._tape.end)
        self._shown = -1  # number of the scan that the clients have
        self._thread = threading.Thread(target=self._play, name="playback", daemon=True)

    def start(self) -> None:
        """Show the beginning of the first run, and be ready to play."""
        with self._news:
            self._begin(self._tape)
        self._thread.start()

    def close(self) -> None:
        """Stop."""
        with self._news:
            self._closed = True
            self._news.notify_all()
        self._thread.join()

    def watch(self, watched: bool) -> None:
        """Hear whether anybody looks: where nobody does, nothing is drawn, though time goes on."""
        with self._news:
            self._watched = watched
            self._news.notify_all()

    def command(self, name: str, arguments: Mapping[str, Any]) -> Outcome:
        """Obey. Raise Error for a time, rate or run that there is not."""
        if name == "run":
            self._change(arguments["run"])
            return Outcome("")
        with self._news:
            now = time.monotonic()
            if name == "seek":
                self._clock.seek(arguments["t"], now)
            elif name == "play":
                self._clock.play(arguments["on"], now)
            else:
                self._clock.set_rate(arguments["value"], now)
            self._show()
            self._news.notify_all()
        return Outcome("")

    def _change(self, name: str) -> None:
        run = name if name in self._runs else _PIECE.sub("", name)
        if run not in self._runs:
            raise Error(f"run: there is no run {name!r}; {hint(name, self._runs)}")
        with self._loading:
            if run == self._tape.name:
                return
            tape = self._load(run)  # may simulate: meanwhile the other one goes on
        with self._news:
            self._begin(tape)

    def _begin(self, tape: Tape) -> None:
        """Show another run from its beginning."""
        self._tape = tape
        self._clock = PlayClock(tape.begin, tape.end, self._clock.rate)
        self._shown = -1
        self._hub.world(self._world)
        tracks = {**tape.tracks, "truth": tape.truth, "odom": tape.odom}
        lines = (Line(body, tuple(track.line(_LINE))) for body, track in tracks.items() if track is not None)
        self._hub.paths(Paths(tape.name, tuple(lines)))
        self._show()

    def _show(self) -> None:
        t = self._clock.at(time.monotonic())
        number = self._tape.scan_at(t)
        scans = {}
        if number != self._shown:
            self._shown = number
            scans[self._chair, 0] = self._tape.fan(number) if number >= 0 and self._tape.fan is not None else _NO_SCAN
        self._hub.state(self._state(t), scans)

    def _state(self, t: float) -> State:
        tape, clock = self._tape, self._clock
        truth, odom = (track.at(t) if track is not None else None for track in (tape.truth, tape.odom))
        poses = {body: pose for body, track in tape.tracks.items() if (pose := track.at(t)) is not None}
        chair = truth if tape.truth is not None else odom
        if chair is not None:
            poses[CHAIR] = chair
        v, w = _pair(tape.rates, t) or (None, None)
        playback = protocol.PlaybackState(clock.begin, clock.end, t, clock.rate, clock.playing, tape.name, self._runs)
        return State(
            t=t - clock.begin,
            wall=time.time(),
            paused=not clock.playing,
            poses=poses,
            truth=truth,
            odom=odom,
            v=v,
            w=w,
            commanded=_pair(tape.asked, t),
            volts=_pair(tape.volts, t),
            notes=tape.notes,
            playback=playback,
        )

    def _play(self) -> None:
        with self._news:
            while not self._closed:
                moves = self._watched and self._clock.playing
                self._news.wait(self._pause if moves else None)
                if moves:
                    self._show()


def _pair(held: Held | None, t: float) -> tuple[float, float] | None:
    values = held.at(t) if held is not None else None
    return None if values is None else (values[0], values[1])
