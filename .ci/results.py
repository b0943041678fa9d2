# SPDX-License-Identifier: BSD-3-Clause
"""Counts of test results in xunit files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

LINES = 25  # of a failure's text that are shown


@dataclass(frozen=True)
class Counts:
    """How many tests passed, failed and were skipped."""

    passed: int = 0
    failed: int = 0
    skipped: int = 0

    def __add__(self, other: Counts) -> Counts:
        """Add field by field."""
        return Counts(self.passed + other.passed, self.failed + other.failed, self.skipped + other.skipped)

    def __str__(self) -> str:
        """Return the verdict line."""
        skipped = f", {self.skipped} skipped" if self.skipped else ""
        return f"{self.passed} passed, {self.failed} failed{skipped}"


def read(paths: list[Path]) -> Counts:
    """Return what the files of one test program say. No case at all, or an unreadable file, is a failure."""
    try:
        cases = [case for path in paths for case in ElementTree.parse(path).iter("testcase")]
    except (ElementTree.ParseError, OSError):
        return Counts(failed=1)
    total = sum((_verdict(case) for case in cases), Counts())
    return total if total != Counts() else Counts(failed=1)


def failures(paths: list[Path]) -> list[str]:
    """Return the lines that say what failed, readable files only."""
    lines = []
    for path in paths:
        try:
            cases = list(ElementTree.parse(path).iter("testcase"))
        except (ElementTree.ParseError, OSError):
            lines.append(f"{path}: unreadable")
            continue
        for case in cases:
            for element in [*case.findall("failure"), *case.findall("error")]:
                text = (element.text or element.get("message") or "").strip().splitlines()
                lines += [f"{case.get('classname')}.{case.get('name')}:", *(f"  {line}" for line in text[-LINES:])]
    return lines


def of(paths: list[Path], name: str) -> Counts | None:
    """Return what the files say of the module (or class) of a name, None if they have no case of it."""
    cases = _cases(paths, name)
    return sum((_verdict(case) for case in cases), Counts()) if cases else None


def seconds(paths: list[Path], name: str) -> float:
    """Return how long the cases of a module took."""
    return sum(float(case.get("time", 0.0)) for case in _cases(paths, name))


def _cases(paths: list[Path], name: str) -> list[ElementTree.Element]:
    try:
        cases = [case for path in paths for case in ElementTree.parse(path).iter("testcase")]
    except (ElementTree.ParseError, OSError):
        return []
    return [case for case in cases if name in case.get("classname", "").split(".")]


def _verdict(case: ElementTree.Element) -> Counts:
    if case.find("failure") is not None or case.find("error") is not None:
        return Counts(failed=1)
    if case.find("skipped") is not None or case.get("status") == "notrun":
        return Counts(skipped=1)
    # rostest's own case says that the test program ran; the program's cases are in another file.
    return Counts() if case.get("classname") == "rostest.runner.RosTest" else Counts(passed=1)
