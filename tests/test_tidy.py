# SPDX-License-Identifier: BSD-3-Clause
"""What .ci/tidy.py does in clang-tidy's stead where several sources are checked at once."""

import re
import shutil

import pytest
import sources
import tidy

DEFECTS = """#include <memory>
namespace %s {
int zero(int x) { int y = 0; if (x > 3) y = 1; return x / y; }
int moved(std::unique_ptr<int> p) { auto q = std::move(p); return *p + *q; }
}
"""


def test_at_once_as_much_is_found_as_alone(tmp_path, monkeypatch):
    """The analyzer, too, which leaves out what it takes for a header."""
    monkeypatch.setattr(tidy, "BUILD", tmp_path / "build")
    monkeypatch.setattr(tidy, "LINKS", tmp_path)
    monkeypatch.setattr(tidy, "WHOLE", tmp_path / "whole")
    (tmp_path / "src/base").mkdir(parents=True)
    tidy.WHOLE.mkdir()
    for folder in (tmp_path, tidy.WHOLE):
        shutil.copy(sources.ROOT / ".clang-tidy", folder)
    both = tuple(tmp_path / f"src/base/{name}.cpp" for name in ("one", "two"))
    for path in both:
        path.write_text(DEFECTS % path.stem)
    unit = tidy.Unit(["-std=c++17"], tmp_path / "build/kurumaisu/x.o", tmp_path, both)

    def found(text):
        return set(re.findall(r"(\w+\.cpp:\d+):\d+: error: .*\[(.*)\]", text))

    alone = set.union(*(found(tidy._tidy(unit, path)) for path in both))
    assert {check.split(",")[0] for _, check in alone} >= {"clang-analyzer-core.DivideZero", "bugprone-use-after-move"}
    assert found(tidy._tidy(unit, tidy._whole(unit))) == alone


def test_a_source_that_lacks_an_include_is_found_behind_another_that_has_it(tmp_path, monkeypatch):
    """The build reads them in order, clang-tidy the other way round."""
    monkeypatch.setattr(tidy, "BUILD", tmp_path / "build")
    monkeypatch.setattr(tidy, "LINKS", tmp_path)
    monkeypatch.setattr(tidy, "WHOLE", tmp_path / "whole")
    (tmp_path / "src").mkdir()
    tidy.WHOLE.mkdir()
    for folder in (tmp_path, tidy.WHOLE):
        shutil.copy(sources.ROOT / ".clang-tidy", folder)
    has, lacks = tmp_path / "src/has.cpp", tmp_path / "src/lacks.cpp"
    has.write_text("#include <vector>\nstd::vector<int> one();\n")
    lacks.write_text("std::vector<int> other();\n")
    unit = tidy.Unit(["-std=c++17"], tmp_path / "build/kurumaisu/x.o", tmp_path, (has, lacks))
    assert "lacks.cpp" in tidy._tidy(unit, tidy._whole(unit))


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("using std::map;\nmap<int, int> m;\n", None),
        ("using std::map;\nstd::map<int, int> m;\n", "map"),
        ('using std::map;\n// a map\nconst char* s = "the map";  /* map */\n', "map"),
        ("  using a::b::C;\n  C c;\n", None),
        ("  using a::b::C;\n  Cc c;\n", "C"),
        ("namespace py = pybind11;\nusing k::list;\nlist l;\n", "py"),
        ("namespace py = pybind11;\nvoid f(py::object o);\n", None),
        ("using Alias = std::map<int, int>;\nusing namespace std;\n", None),
    ],
)
def test_names_that_are_not_used(tmp_path, text, name):
    path = tmp_path / "a.cpp"
    path.write_text(text)
    assert tidy.unused(path) == ([f"{path}: {name} is not used"] if name else [])
