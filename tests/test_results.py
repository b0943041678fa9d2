# SPDX-License-Identifier: BSD-3-Clause
"""The verdict of scripts/test: what is silent or broken must never look like success."""

import checks
import inputs
import passed
import pytest
import results
import sources
from passed import Part
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


def test_counts_a_module_by_itself(tmp_path):
    path = tmp_path / "pytest.xml"
    path.write_text(PYTEST.replace('name="c"', 'name="c" time="1.5"'))
    assert results.of([path], "test_one") == Counts(passed=1, skipped=1)
    assert results.of([path], "test_two") == Counts(failed=1)
    assert results.of([path], "test_three") is None
    assert results.seconds([path], "test_two") == 1.5


def test_verdict_line():
    assert str(Counts(3, 0)) == "3 passed, 0 failed"
    assert str(Counts(3, 1) + Counts(skipped=2)) == "3 passed, 1 failed, 2 skipped"


def test_what_is_silent_fails(tmp_path):
    (tmp_path / "pytest.xml").write_text(PYTEST)
    parts = [Part(name, str, tmp_path / name) for name in ("test_one", "test_two", "test_three")]
    check = checks.Check("pytest", [], tuple(parts), tests=True)
    found = checks._counts(check, parts, [tmp_path / "pytest.xml"], "")
    assert [found[part].failed for part in parts] == [0, 1, 1]
    died = checks._counts(check, parts[:1], [tmp_path / "pytest.xml"], "exit status -9")
    assert died[parts[0]] == Counts(passed=1, failed=1, skipped=1)


def test_what_passed_is_known_until_something_changes(tmp_path, monkeypatch):
    monkeypatch.setattr(passed, "FOLDER", tmp_path)
    part, quick = Part("test_one", str), Part("test_one", str, quick=True)
    passed.keep(quick, "now", Counts(2, 0, 5), 0.1)
    assert passed.counts(quick, "now") == Counts(2, 0, 5)
    assert passed.counts(part, "now") is None  # without the long ones
    passed.keep(part, "later", Counts(7), 3.0)
    assert passed.counts(part, "later") == passed.counts(quick, "later") == Counts(7)
    assert passed.counts(part, "now") is None
    assert passed.counts(part, "") is None
    assert passed.seconds("test_one", 9.0) == 3.0
    assert passed.seconds("test_two", 9.0) == 9.0


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """A tree of some modules and tests of them."""
    texts = {
        "src/kurumaisu/__init__.py": "",
        "src/kurumaisu/law.py": "from kurumaisu.units import (\n    VOLT,\n)\n",
        "src/kurumaisu/units.py": "VOLT = 1\n",
        "src/kurumaisu/late.py": "def f():\n    from . import law\n",
        "src/kurumaisu/alone.py": "",
        "tests/helper.py": "import subprocess\n",
        "tests/conftest.py": "@pytest.fixture\ndef room():\n    from kurumaisu import alone\n",
        "tests/test_room.py": "def test_it(room):\n    pass\n",
        "tests/test_law.py": "from kurumaisu import law\n",
        "tests/test_late.py": 'import pytest, helper\nNAME = "kurumaisu.late.f"\n',
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(inputs, "ROOT", tmp_path)
    monkeypatch.setattr(inputs, "TESTS", tmp_path / "tests")
    monkeypatch.setattr(inputs, "ROOTS", (tmp_path / "src", tmp_path / "tests"))
    for kept in (inputs._text, inputs._imported, inputs._files):
        kept.cache_clear()
    yield tmp_path
    for kept in (inputs._text, inputs._imported, inputs._files):
        kept.cache_clear()


def test_a_test_depends_on_what_its_imports_reach(tree):
    def reached(name):
        return {path.stem for path in inputs.closure(tree / f"tests/{name}.py")}

    assert reached("test_law") == {"test_law", "__init__", "law", "units"}
    assert reached("test_late") == {"test_late", "helper", "__init__", "late", "law", "units"}


def test_what_a_shared_fixture_needs_counts_for_those_who_ask_for_it(tree):
    def reached(name):
        return {path.stem for path in inputs._with_fixtures(tree / f"tests/{name}.py")}

    assert reached("test_room") == {"test_room", "conftest", "__init__", "alone"}
    assert reached("test_law") == {"test_law", "conftest", "__init__", "law", "units"}


def test_what_waits_for_processes_is_told_from_sums(tree):
    assert not inputs.waits(tree / "tests/test_law.py")
    assert inputs.waits(tree / "tests/test_late.py")


def test_every_test_file_belongs_to_a_check():
    """Whatever is renamed or new."""
    chosen = checks.every_check(inputs.Inputs(), quick=False)
    every = [part.name for check in chosen for part in check.parts]
    assert len(set(every)) == len(every), "what passed is kept by name"
    names = set(every)
    tests = sources.ROOT / "tests"
    assert {path.stem for path in tests.glob("test_*.py")} <= names
    assert {path.name for path in tests.glob("*.test")} <= names
    assert checks.ALONE.keys() <= {path.stem for path in tests.glob("*.test")}
