# SPDX-License-Identifier: BSD-3-Clause
"""What .ci/tidy.py does in clang-tidy's stead where several sources are checked at once."""

import pytest
import tidy


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
