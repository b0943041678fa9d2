# SPDX-License-Identifier: BSD-3-Clause
"""One virtual sensor, served while it is open."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from kurumaisu._core import UrgClock, UrgOptions, UrgServer
from kurumaisu.errors import Error
from kurumaisu.types import FloatArray, IntArray
from kurumaisu.virtual_urg.models import Sensor


@dataclass(frozen=True)
class Pty:
    """A pseudo terminal; link: the name that leads to it while the sensor is plugged in."""

    link: Path


@dataclass(frozen=True)
class Tcp:
    """A TCP port, 0 for any that is free; host: an address in numbers, by default this computer alone."""

    port: int = 0
    host: str = "127.0.0.1"


@contextmanager
def _told() -> Iterator[None]:
    """Turn what the core raises into an Error."""
    try:
        yield
    except (OSError, RuntimeError, ValueError) as error:
        raise Error(f"virtual URG: {error.args[-1]}") from error


class VirtualUrg:
    """A sensor that clients take for a real one. A thread of its own serves them, without Python's lock."""

    def __init__(
        self,
        sensor: Sensor,
        at: Pty | Tcp,
        *,
        faults: Sequence[str] = (),
        drift: float = 0.0,
        fed: bool = False,
        patience: float = 0.2,
        line_rate: bool = False,
    ) -> None:
        """Put it where clients find it.

        faults: as `corrupt@5`, see `virtual_urg --faults`; drift [1]: what its clock gains; fed: its time and turns
        come from measure and advance, else its mirror turns by this computer's steady clock and a turn measures what
        was last shown, at first nothing within range; patience [s]: how long measure waits for a client that does not
        read; line_rate: bytes take the time that they take on a serial line.
        Raise Error for a place that is taken and for faults that are unknown.
        """
        self.sensor = sensor
        clock = UrgClock(start=0.0, drift=drift)
        options = UrgOptions(fed=fed, patience=patience, line_rate=line_rate)
        try:
            if isinstance(at, Pty):
                self._server = UrgServer.at_pty(sensor.model, faults, clock, options, str(at.link.absolute()))
            else:
                if not 0 <= at.port <= 65535:
                    raise Error(f"port: must be 0 to 65535: {at.port}")
                self._server = UrgServer.at_tcp(sensor.model, faults, clock, options, at.host, at.port)
        except (OSError, ValueError) as error:
            raise Error(f"virtual URG {sensor.model.name}: {error.args[-1]}") from error
        self.address = self._server.address

    @property
    def port(self) -> int:
        """The TCP port. Raise Error at a pty."""
        host, colon, port = self.address.rpartition(":")
        if not colon or "/" in host:
            raise Error(f"{self.address}: is not a TCP port")
        return int(port)

    @property
    def connected(self) -> bool:
        """True while a client has it open."""
        return self._server.connected

    @property
    def counters(self) -> dict[str, int]:
        """What happened so far; docs/virtual_urg.md says what each counts."""
        return self._server.counters

    def show(self, ranges: FloatArray, intensities: FloatArray | None = None, codes: IntArray | None = None) -> None:
        """Let turns measure this from now on, in real time.

        ranges (steps,) [m]: NaN an error, +inf no return; intensities (steps,), or none; codes (steps,): what is sent
        [mm] instead of ranges, or none. Raise Error for other shapes, and if the sensor has broken down.
        """
        with _told():
            self._server.show(ranges, intensities, codes)

    def measure(
        self,
        now: float,
        start: float,
        ranges: FloatArray,
        intensities: FloatArray | None = None,
        codes: IntArray | None = None,
    ) -> bool:
        """Complete a turn at a time [s], fed: its step 0 was at start [s]; the arrays as in show.

        Return False if the scan was dropped, because the client left no room for it. Raise Error as show.
        """
        with _told():
            return self._server.measure(now, start, ranges, intensities, codes)

    def advance(self, now: float) -> None:
        """Say what time it is [s], fed; it never goes back."""
        with _told():
            self._server.advance(now)

    def power_cycle(self) -> None:
        """Take its power away for a moment: it boots, and its clock begins at 0."""
        with _told():
            self._server.power_cycle()

    def close(self) -> None:
        """End it; its place is free then. A second call does nothing."""
        self._server.close()

    def __enter__(self) -> VirtualUrg:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
