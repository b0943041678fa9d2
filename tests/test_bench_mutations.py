# SPDX-License-Identifier: BSD-3-Clause
"""Mistakes that scripts/bench mutations makes: small, in code, and the same after files were moved and renamed."""

import shutil

import pytest

from kurumaisu.bench import mutations

PYTHON = '''"""Law - of 1 thing."""
import re

HALF = 5  # of 10


def law(volts, most):
    """Return volts - most."""
    left = volts - most
    if left < 3.5:
        print("1 - 2")
        raise ValueError(f"{left} - 1")
    return left
'''
CPP = """#include <vector>
// rate - 1
int law(int volts) {
  std::vector<int> seen;
  seen.push_back(volts);
  rate_ = volts + 2;
  return volts;
}
"""


def made(name, text):
    return {(each.kind, each.line + 1, each.new.strip()) for each in mutations.mutations(name, text.split("\n"))}


def test_each_changes_code_only():
    assert made("src/a.py", PYTHON) == {
        ("constant", 4, "HALF = 6  # of 10"),
        ("sign", 9, "left = volts + most"),
        ("removed", 9, "pass"),
        ("bound", 10, "if left <= 3.5:"),
        ("removed", 11, "pass"),
        ("removed", 12, "pass"),
    }
    assert made("src/a.cpp", CPP) == {
        ("removed", 5, ";"),
        ("sign", 6, "rate_ = volts - 2;"),
        ("constant", 6, "rate_ = volts + 3;"),
        ("removed", 6, ";"),
    }


@pytest.fixture
def tree(tmp_path):
    for name, text in {
        "src/kurumaisu/law.py": PYTHON,
        "src/kurumaisu/user.py": "from kurumaisu import law\n",
        "src/kurumaisu/bench/table.py": PYTHON,
        "src/base/law.cpp": CPP,
        "tests/test_law.py": "from kurumaisu.law import law\n",
        "tests/test_user.py": "import kurumaisu.user\n",
        "tests/test_else.py": "import math\n",
        "tests/test_core.py": "from kurumaisu import _core\n",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_the_same_are_drawn_after_a_move(tree):
    before = mutations.draw(tree, 30, 8)
    assert {each.kind for each in before} == set(mutations.KINDS)
    assert {each.path for each in before} == {"src/kurumaisu/law.py", "src/base/law.cpp"}  # not what measures
    assert mutations.draw(tree, 31, 8) != before
    (tree / "src/kurumaisu/rooms").mkdir()
    text = (tree / "src/kurumaisu/law.py").read_text().replace("volts", "tension")
    (tree / "src/kurumaisu/rooms/rule.py").write_text(text)
    (tree / "src/kurumaisu/law.py").unlink()
    shutil.move(tree / "src/base", tree / "src/drive")
    after = mutations.draw(tree, 30, 8)
    assert [(each.kind, each.change, each.line) for each in after] == [
        (each.kind, each.change, each.line) for each in before
    ]


def test_the_nearest_tests_come_first(tree):
    assert [path.name for path in mutations.nearest(tree, "src/kurumaisu/law.py")] == ["test_law.py", "test_user.py"]
    assert [path.name for path in mutations.nearest(tree, "src/base/law.cpp")] == ["test_core.py"]


class Checked(mutations.Copy):
    """A tree in which a test fails where a line is wrong, and another one always."""

    def run(self, *command):
        wrong = "volts + most" in (self.root / "src/kurumaisu/law.py").read_text()
        failing = [name for name, fails in (("tests/test_user.py::b", True), ("tests/test_law.py::a", wrong)) if fails]
        asked = [name for name in failing if "pytest" in command and f"--deselect={name}" not in command]
        if any("::" in word and not word.startswith("--") for word in command):
            asked = [name for name in asked if name in command]
        said = f"FAILED {asked[0]} - assert False\n" if asked else ""
        return mutations.subprocess.CompletedProcess(command, 0, said)


def test_what_fails_anyway_catches_nothing(tree):
    path = tree / "src/kurumaisu/law.py"
    copy, before = Checked(tree, end=0.0), path.read_text()
    every = {each.new.strip(): each for each in mutations.mutations("src/kurumaisu/law.py", before.split("\n"))}
    assert mutations.judged(copy, every["left = volts + most"]) == "tests/test_law.py::a"
    assert copy.unsure == {"tests/test_user.py::b"}
    assert mutations.judged(copy, every["if left <= 3.5:"]) is None
    assert path.read_text() == before
