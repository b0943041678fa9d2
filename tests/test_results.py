# SPDX-License-Identifier: BSD-3-Clause
"""The verdict of scripts/test: what is silent or broken must never look like success."""

import re

import checks
import pytest
import results
from results import Counts

GTEST = """<testsuites tests="3" failures="1"><testsuite name="Law">
<testcase name="good" status="run" classname="Law"/>
<testcase name="bad" status="run" classname="Law"><failure message="1 != 2"/></testcase>
<testcase name="off" status="notrun" classname="Law"/></testsuite></testsuites>"""
PYTEST = """<testsuites><testsuite><testcase classname="tests.test_one" name="a"/>
<testcase classname="tests.test_one.TestB" name="b"><skipped message="no data"/></testcase>
<testcase classname="test_two" name="c"><error message="fixture"/></testcase></testsuite></testsuites>"""
ROSTEST = """<testsuite tests="1"><testcase classname="rostest.runner.RosTest" name="testbase"/></testsuite>"""
ROSTEST_DIED = """<testsuite tests="1"><testcase classname="rostest.runner.RosTest" name="testbase">
<failure type="AssertionError">no results</failure></testcase></testsuite>"""
NODE = """<testsuite tests="1"><testcase classname="__main__.Test" name="test_odom"/></testsuite>"""
WAITS = re.compile(
    r"^(import|from) (asyncio|kurumaisu\.bench\.processes|rospy|socket|subprocess|threading|time)\b", re.M
)


@pytest.mark.parametrize(
    ("texts", "counts"),
    [
        ([GTEST], Counts(passed=1, failed=1, skipped=1)),
        ([PYTEST], Counts(passed=1, failed=1, skipped=1)),
        ([ROSTEST, NODE], Counts(passed=1)),
        ([ROSTEST_DIED], Counts(failed=1)),
        ([ROSTEST], Counts(failed=1)),
        (["<testsuite/>"], Counts(failed=1)),
        (["<testsuite><testcase"], Counts(failed=1)),
        ([NODE, ""], Counts(failed=1)),
        ([], Counts(failed=1)),
    ],
)
def test_counts(tmp_path, texts, counts):
    paths = [tmp_path / f"{i}.xml" for i in range(len(texts))]
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text)
    assert results.read(paths) == counts


def test_a_missing_file_is_a_failure(tmp_path):
    assert results.read([tmp_path / "none.xml"]) == Counts(failed=1)


def test_says_what_failed(tmp_path):
    path = tmp_path / "law.xml"
    path.write_text(GTEST)
    assert results.failures([path]) == ["Law.bad:", "  1 != 2"]
    path.write_text(ROSTEST_DIED.replace("no results", "\n".join(f"line {i}" for i in range(100))))
    assert results.failures([path]) == [
        "rostest.runner.RosTest.testbase:",
        *(f"  line {i}" for i in range(100 - results.LINES, 100)),
    ]
    path.write_text("<testsuite>")
    assert results.failures([path]) == [f"{path}: unreadable"]


def test_names_the_modules_that_ran(tmp_path):
    (tmp_path / "pytest.xml").write_text(PYTEST)
    assert {"test_one", "test_two"} <= results.classes(tmp_path / "pytest.xml")


def test_verdict_line():
    assert str(Counts(3, 0)) == "3 passed, 0 failed"
    assert str(Counts(3, 1) + Counts(skipped=2)) == "3 passed, 1 failed, 2 skipped"


def test_what_only_computes_waits_for_nothing():
    """It runs when nothing else wants the cores."""
    sums, others = checks.pytest_parts()
    assert len(sums) > 40
    assert {path.stem for path in others} >= checks.NO_SUMS
    for path in sums:
        assert not WAITS.search(path.read_text()), path
