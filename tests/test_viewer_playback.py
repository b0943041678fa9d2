# SPDX-License-Identifier: BSD-3-Clause
"""A recording on its time line: any moment gives what the files have, whichever way one came there."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kurumaisu.errors import Error
from kurumaisu.viewer import Body, Fan, Hub, World
from kurumaisu.viewer.play_clock import PlayClock
from kurumaisu.viewer.playback import CHAIR, Playback
from kurumaisu.viewer.tape import Held, Tape, Track


def test_a_clock_plays_at_its_rate_and_holds_at_the_end():
    clock = PlayClock(100.0, 110.0)
    assert clock.at(5.0) == 100.0
    clock.play(True, 5.0)
    assert clock.at(7.0) == 102.0
    clock.set_rate(4.0, 7.0)
    assert clock.at(8.0) == 106.0
    clock.play(False, 8.0)
    assert clock.at(99.0) == 106.0
    clock.play(True, 99.0)
    assert clock.at(200.0) == 110.0
    assert not clock.playing
    clock.play(True, 300.0)  # at the end: from the beginning
    assert clock.at(300.5) == 102.0


def test_a_clock_that_plays_goes_on_from_where_it_is_put():
    clock = PlayClock(0.0, 10.0)
    clock.play(True, 0.0)
    clock.seek(8.0, 3.0)
    assert clock.at(4.0) == 9.0
    clock.seek(2.0, 4.0)  # back
    assert clock.at(5.0) == 3.0


@pytest.mark.parametrize("t", [-1.0, 10.1, float("inf")])
def test_what_is_not_on_the_line_is_refused(t):
    clock = PlayClock(0.0, 10.0)
    clock.seek(4.0, 0.0)
    with pytest.raises(Error, match=r"seek: t must be 0.000 to 10.000 s"):
        clock.seek(t, 0.0)
    assert clock.at(1.0) == 4.0


@pytest.mark.parametrize("rate", [0.0, -1.0, 1e9])
def test_a_rate_that_is_none_is_refused(rate):
    with pytest.raises(Error, match="rate: must be"):
        PlayClock(0.0, 1.0).set_rate(rate, 0.0)


def test_the_ends_as_a_report_writes_them_are_on_the_line():
    clock = PlayClock(100.00049, 109.99951)
    clock.seek(100.0, 0.0)
    assert clock.at(0.0) == 100.00049
    clock.seek(110.0, 0.0)
    assert clock.at(0.0) == 109.99951


TIMES = np.array([0.0, 0.1, 0.2, 5.0, 5.1])
POSES = np.column_stack([[0.0, 1.0, 2.0, 7.0, 8.0], [0.0, 0.0, 1.0, 1.0, 1.0], [0.0, 0.5, 7.0, 7.0, 7.0]])


def test_a_track_has_its_rows_and_lies_between_them():
    track = Track(TIMES, POSES)
    for t, pose in zip(TIMES, POSES, strict=True):
        assert track.at(t) == tuple(pose)
    assert track.at(0.05) == pytest.approx((0.5, 0.0, 0.25))


@pytest.mark.parametrize("t", [2.0, 4.99, -1.5, 6.2])
def test_nobody_fills_in_a_gap(t):
    assert Track(TIMES, POSES).at(t) is None


def test_a_track_is_where_it_was_a_little_before_and_after():
    track = Track(TIMES, POSES)
    assert track.at(-0.5) == tuple(POSES[0])
    assert track.at(5.6) == tuple(POSES[-1])
    assert Track(TIMES[:0], POSES[:0]).at(0.0) is None
    assert Track(TIMES[:1], POSES[:1]).at(0.4) == tuple(POSES[0])


def test_poses_that_are_always_far_apart_are_joined():
    assert Track(np.array([0.0, 4.0, 8.0]), POSES[:3]).at(2.0) == pytest.approx((0.5, 0.0, 0.25))


def test_a_piece_ends_where_the_next_begins():
    times = np.array([0.0, 0.1, 0.1, 0.2])
    poses = np.array([[0.0, 0, 0], [1.0, 0, 0], [5.0, 0, 0], [6.0, 0, 0]])
    track = Track(times, poses)
    assert track.at(0.05)[0] == pytest.approx(0.5)
    assert track.at(0.1)[0] == 5.0
    assert track.at(0.15)[0] == pytest.approx(5.5)
    assert track.line(100) == [(0.0, 0.0), (1.0, 0.0), None, (5.0, 0.0), (6.0, 0.0)]


@given(st.integers(0, 400), st.integers(1, 50))
def test_a_line_is_short_and_has_both_ends(count, most):
    times = np.arange(count) * 0.1
    line = Track(times, np.column_stack([times, times, times])).line(most)
    assert len(line) <= most + 1
    assert line == sorted(line)
    if count:
        assert line[0] == (0.0, 0.0)
        assert line[-1][0] == pytest.approx(times[-1])


def test_what_is_held_holds_until_the_next():
    held = Held(np.array([1.0, 2.0]), np.array([[0.1, 0.2], [0.3, 0.4]]))
    assert held.at(0.9) is None
    assert held.at(1.0) == held.at(1.99) == (0.1, 0.2)
    assert held.at(77.0) == (0.3, 0.4)


def test_a_scan_is_found_by_its_time_as_a_report_writes_it():
    times = np.array([1.0004, 1.1004, 1.2004])
    one = Tape("a", 1.0, 2.0, scan_times=times)
    assert [one.scan_at(float(f"{t:.3f}")) for t in times] == [0, 1, 2]
    assert [one.scan_at(t) for t in (0.9, 1.15, 2.1, 2.3)] == [-1, 1, 2, -1]


WORLD = World((Body(CHAIR, "chair", "robot", "#000000", False),), None, CHAIR)


def tape(name, begin):
    times = begin + np.arange(101) * 0.1
    poses = np.column_stack([times - begin, np.zeros(101), np.zeros(101)])
    number = {"asked": 0}

    def fan(i):
        number["asked"] += 1
        return Fan((float(i), 0.0, 0.0), 0.0, 0.1, 0.0, 4.0, np.full(3, float(i)))

    return Tape(name, begin, begin + 10.0, truth=Track(times, poses), scan_times=times[::10], fan=fan), number


class Deck:
    """Two tapes in a playback, and what a page would have of it."""

    def __init__(self):
        self.tapes = {"a": tape("a", 100.0), "b": tape("b", 5000.0)}
        self.hub = Hub()
        self.loaded = []
        self.playback = Playback(self.hub, "deck", list(self.tapes), self._load, WORLD, 30.0)

    def __enter__(self):
        self.playback.start()
        self.mailbox = self.hub.join(lambda: None)
        self.state = None
        self.news()
        return self

    def __exit__(self, *_):
        self.playback.close()

    def _load(self, name):
        self.loaded.append(name)
        return self.tapes[name][0]

    def news(self):
        """Return the new messages by type."""
        found = {}
        for payload in self.mailbox.take():
            message = json.loads(payload) if isinstance(payload, str) else {"type": "scan", "bytes": payload}
            found[message["type"]] = message
        self.state = found.get("state", self.state)
        return found

    def ask(self, name, **arguments):
        self.playback.command(name, arguments)
        return self.news()


def test_a_moment_is_the_same_from_before_and_from_behind():
    with Deck() as deck:
        for t in (103.3, 109.0, 103.3, 100.0, 110.0, 103.3):
            deck.ask("seek", t=t)
            assert deck.state["truth"] == pytest.approx([t - 100.0, 0, 0])
            assert deck.state["playback"]["t"] == pytest.approx(t)
            assert deck.state["t"] == pytest.approx(t - 100.0)
            assert deck.state["poses"][CHAIR] == deck.state["truth"]


def test_a_scan_is_sent_when_it_is_another_one():
    with Deck() as deck:
        count = deck.tapes["a"][1]
        assert "scan" in deck.ask("seek", t=104.2)
        before = count["asked"]
        assert "scan" not in deck.ask("seek", t=104.9)
        assert count["asked"] == before
        assert "scan" in deck.ask("seek", t=103.9)
        assert count["asked"] == before + 1


def test_runs_have_their_own_clocks():
    with Deck() as deck:
        deck.ask("seek", t=108.0)
        news = deck.ask("run", run="b")
        assert news["world"]
        assert news["paths"]["run"] == "b"
        playback = deck.state["playback"]
        assert (playback["from"], playback["to"], playback["t"]) == (5000.0, 5010.0, 5000.0)
        assert (playback["run"], playback["runs"]) == ("b", ["a", "b"])
        with pytest.raises(Error, match=r"seek: t must be 5000.000 to 5010.000 s: 108.000"):
            deck.ask("seek", t=108.0)
        deck.ask("run", run="a[2/6]")  # a piece, as the critic takes very long runs
        assert deck.state["playback"]["run"] == "a"


def test_the_same_run_is_not_loaded_again_and_stays_where_it_is():
    with Deck() as deck:
        deck.ask("seek", t=105.0)
        deck.ask("run", run="a")
        assert deck.loaded == ["a"]
        deck.ask("seek", t=105.0)
        assert deck.state["playback"]["t"] == 105.0


def test_a_run_that_there_is_not_is_named():
    with Deck() as deck, pytest.raises(Error, match=r"run: there is no run 'c'; there are: a, b"):
        deck.ask("run", run="c")


def test_it_plays_only_for_who_looks():
    with Deck() as deck:
        deck.ask("rate", value=100.0)
        deck.ask("play", on=True)
        deck.playback.watch(True)
        arrived = deck.mailbox  # ten seconds in a tenth of one
        for _ in range(500):
            deck.news()
            if deck.state["playback"]["t"] == 110.0:
                break
            deck.playback._thread.join(0.01)
        assert arrived is deck.mailbox
        assert deck.state["playback"]["t"] == 110.0
        assert not deck.state["playback"]["playing"]


def test_an_empty_scan_takes_the_place_of_one_long_past():
    begin = tape("a", 100.0)[0]
    gap = Tape("a", 100.0, 110.0, truth=begin.truth, scan_times=np.array([100.0]), fan=begin.fan)
    hub = Hub()
    playback = Playback(hub, "gap", ["a"], lambda _: gap, WORLD, 30.0)
    playback.start()
    mailbox = hub.join(lambda: None)
    try:
        counts = []
        for t in (100.5, 105.0, 100.2):
            playback.command("seek", {"t": t})
            counts += [int.from_bytes(p[2:4], "little") for p in mailbox.take() if isinstance(p, bytes)]
        assert counts == [3, 0, 3]
    finally:
        playback.close()
