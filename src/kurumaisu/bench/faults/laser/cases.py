# SPDX-License-Identifier: BSD-3-Clause
"""The eighteen ways in which a laser or its wire fails, and what a driver may lose by each."""

from __future__ import annotations

from dataclasses import dataclass, field

_SPAN = 20  # scans before the fault strikes: 2 s
_USB, _RS232 = "urg_04lx_ug01", "urg_04lx"


@dataclass(frozen=True)
class Case:
    """A fault of the virtual sensor, and the bounds of a good driver."""

    number: int
    faults: tuple[str, ...]
    lost: tuple[int, int] | None = (0, 0)  # scans, at least and at most; None: no scan is to come
    gap: float = 0.26  # [s] from scan to scan at most, beyond the outage: 0.2, and what a busy machine adds
    outage: float = 0.0  # [s] for which the sensor itself is away
    proof: str = ""  # what our diagnostics have then: it shows that the fault struck
    level: int = 0  # of our diagnostics at their worst, at least
    tcp: bool = False
    sensor: str = _USB
    parameters: dict[str, object] = field(default_factory=dict)  # of the driver, by urg_node's names

    @property
    def name(self) -> str:
        """Return the faults' names and the wire."""
        return f"{self.number:2d} {' '.join(self.faults)}{', TCP' if self.tcp else ''}"


_LOST_TWO = 0.36  # [s] likewise
_BACK = 0.75  # [s] at most 0.6 from the sensor's answer to the first scan, a turn, and what a busy machine adds
_SILENCE = 0.5  # [s] that laser_node waits before it asks why no scan comes (stale_timeout)

CASES = (
    Case(1, (f"corrupt@{_SPAN}",), (1, 1), proof="Bad Sums"),
    Case(2, (f"trunc@{_SPAN}",), (1, 2), _LOST_TWO, proof="Unreadable Replies"),
    Case(2, (f"noend@{_SPAN}",), (1, 2), _LOST_TWO, proof="Unreadable Replies"),
    Case(3, (f"badlf@{_SPAN}",), (1, 1), proof="Unreadable Replies"),
    Case(3, ("badlf@1",), proof="Unreadable Replies"),
    Case(4, ("garbage",), proof="Stray Bytes"),
    Case(5, (f"dup@{_SPAN}",), proof="Duplicate Scans"),
    Case(6, (f"err50@{_SPAN}",), (1, 1), proof="Errors of Status 50", level=2),
    Case(6, (f"err98@{_SPAN}",), (1, 1), proof="Errors of Status 98", level=1),
    Case(7, (f"stall@{_SPAN}",), (1, 12), _SILENCE + 0.3, proof="Reconnects"),
    Case(7, (f"stall@{_SPAN}=2",), (15, 32), _BACK, outage=2.0, proof="Reconnects"),
    Case(8, (f"close@{_SPAN}",), (0, 7), _BACK, proof="Reconnects", tcp=True),
    Case(8, (f"rst@{_SPAN}",), (0, 7), _BACK, proof="Reconnects", tcp=True),
    Case(8, ("rst-after-cmd@3",), proof="Attempts to Connect", tcp=True),
    Case(8, ("rst-after-cmd",), None, tcp=True),
    Case(8, ("close-on-accept=3",), proof="Attempts to Connect", tcp=True),
    Case(8, ("close-on-accept",), None, tcp=True),
    Case(9, (f"hangup@{_SPAN}=1",), (5, 18), _BACK, outage=1.0, proof="Reconnects"),
    Case(10, (f"reboot@{_SPAN}=1", "scip1"), (5, 18), _BACK, outage=1.0, proof="Reconnects"),
    Case(10, (f"reboot@{_SPAN}=1", "strict-baud"), (5, 18), _BACK, outage=1.0, proof="Reconnects", sensor=_RS232),
    Case(11, ("t0=16774716",)),
    Case(12, ("scip1", "strict-baud"), sensor=_RS232),
    Case(13, ("bm01",), None),
    Case(13, ("md0e",), None),
    Case(13, ("no-me",), proof="Last Error", parameters={"publish_intensity": True}),
    Case(14, ("dribble=0.05",)),
    Case(15, ("vv-badsum",), proof="Last Error"),
    Case(16, ("blackhole",), None, tcp=True),
    Case(17, (f"zeros@{_SPAN}",), (0, 1)),
    Case(17, (f"codes@{_SPAN}",), (0, 1)),
    Case(18, ("pp-ares0",), None),
    Case(18, ("pp-crossed",), None),
)
