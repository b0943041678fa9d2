# SPDX-License-Identifier: BSD-3-Clause
"""Where on a time line a recording is that plays, holds, or is moved by hand."""

from __future__ import annotations

from kurumaisu.errors import Error

ROUNDED = 1e-3  # [s] that a time may be off because a report wrote it so
SLOWEST, FASTEST = 0.01, 100.0  # recorded seconds per second


class PlayClock:
    """Runs from begin to end [s], at a rate, and holds there. All methods take the time of a steady clock [s]."""

    def __init__(self, begin: float, end: float, rate: float = 1.0) -> None:
        self.begin, self.end, self.rate = begin, end, rate
        self.playing = False
        self._t, self._since = begin, 0.0

    def at(self, now: float) -> float:
        """Return where it is; holds once the end is reached."""
        if self.playing:
            t = self._t + self.rate * (now - self._since)
            if t < self.end:
                return t
            self._t, self.playing = self.end, False
        return self._t

    def seek(self, t: float, now: float) -> None:
        """Go to a time, forward or back, playing on. Raise Error for one that is not on the line."""
        if not self.begin - ROUNDED <= t <= self.end + ROUNDED:
            raise Error(f"seek: t must be {self.begin:.3f} to {self.end:.3f} s: {t:.3f}")
        self._t, self._since = min(max(t, self.begin), self.end), now

    def play(self, on: bool, now: float) -> None:
        """Play or hold; at the end, play begins anew."""
        t = self.at(now)
        self._t, self._since = self.begin if on and t >= self.end else t, now
        self.playing = on

    def set_rate(self, rate: float, now: float) -> None:
        """Play so many recorded seconds per second from here on. Raise Error for a rate that is none."""
        if not SLOWEST <= rate <= FASTEST:
            raise Error(f"rate: must be {SLOWEST:g} to {FASTEST:g}: {rate:g}")
        self._t, self._since = self.at(now), now
        self.rate = rate
