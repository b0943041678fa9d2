# SPDX-License-Identifier: BSD-3-Clause
"""Results are there whole or not at all, and nothing in the package writes files in another way."""

import ast
import os
import resource
import stat
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from kurumaisu.errors import Error
from kurumaisu.whole_files import write_whole

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src/kurumaisu"
# Calls that write a file where they are told, by the name they end with.
WRITERS = {
    *("write_text", "write_bytes", "savefig", "tofile", "imwrite", "to_csv", "copyfile", "copy2", "copytree"),
    *("savez", "savez_compressed", "savetxt", "NamedTemporaryFile", "Bag"),
}
# What may write otherwise, and why: by file, what is called there.
MADE = "a recording that its seed makes again"
EXCEPTIONS = {
    "whole_files.py": {"open": "it is the one that writes"},
    "demo/processes.py": {"open": "the log of a child process, which writes it line by line"},
    "ros/paper/launches.py": {"open": "the log of a child process"},
    "bench/processes.py": {"open": "the log of a child process"},
    "bench/faults/base/chain.py": {"open": "the log of a child process; a file of a virtual board's memory"},
    "bench/faults/base/owners.py": {"open": "the log of a child process"},
    "bench/faults/base/peers.py": {"open": "the log of a child process"},
    "bench/guard_rig.py": {"open": "the log of a child process"},
    "bench/rigs/laser.py": {"open": "the log of a child process"},
    "bench/speed/drive.py": {"open": "the log of a child process"},
    "bench/mutations.py": {"copytree": "a scratch copy of the tree"},
    "bench/critic/by_effect.py": {"open": "a list that grows by a line for each case of hours of work"},
    "bench/slam/peers.py": {"tofile": "scratch, handed to a peer's program", "open": "likewise"},
    "bench/slam/ours.py": {"savez": "scratch, handed to a process of our own"},
    "bench/peers.py": {"tofile": "scratch, handed to a peer's program"},
    "bench/strangers/fell/files.py": {"write_text": MADE},
    "bench/strangers/loess/writing.py": {"write_text": MADE},
    "bench/strangers/quay/writing.py": {"write_text": MADE},
    "bench/strangers/scree/writing.py": {"write_text": MADE},
}


def writes(path: Path) -> Iterator[tuple[int, str]]:
    """Yield line and name of each call that writes a file, or may."""
    tree = ast.parse(path.read_text(encoding="utf-8"), str(path))
    memories = {
        target.id
        for node in ast.walk(tree)
        if isinstance(node, ast.Assign) and ast.unparse(node.value).endswith(("BytesIO()", "StringIO()"))
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        in_memory = bool(node.args) and isinstance(node.args[0], ast.Name) and node.args[0].id in memories
        if name in WRITERS or (name == "save" and node.args):
            written = not in_memory and (name != "Bag" or _for_writing(node))
        else:
            written = (name == "open" and _for_writing(node)) or (name in ("dump", "safe_dump") and _has_stream(node))
        if written:
            yield node.lineno, name


def _for_writing(node: ast.Call) -> bool:
    own = isinstance(node.func, ast.Attribute) and node.func.attr == "open"  # path.open(mode), or os.open(path, flags)
    values = [*node.args[0 if own else 1 :], *(keyword.value for keyword in node.keywords if keyword.arg == "mode")]
    return any(_is_text(value, "wax+") or "O_CREAT" in ast.unparse(value) for value in values)


def _is_text(value: ast.expr, letters: str) -> bool:
    """Return whether it is a mode of files with one of these letters."""
    text = value.value if isinstance(value, ast.Constant) else None
    return (
        isinstance(text, str) and 0 < len(text) <= 3 and set(text) <= set("rwaxbt+") and bool(set(text) & set(letters))
    )


def _has_stream(node: ast.Call) -> bool:
    return len(node.args) > 1 or any(keyword.arg in ("stream", "fp") for keyword in node.keywords)


def test_nothing_else_in_the_package_writes_files() -> None:
    found = [
        f"{path}:{line}: {name}: use write_whole, or say in EXCEPTIONS why not"
        for path in sorted(PACKAGE.rglob("*.py"))
        for line, name in writes(path)
        if name not in EXCEPTIONS.get(path.relative_to(PACKAGE).as_posix(), {})
    ]
    assert not found, "\n".join(found)


def test_every_exception_is_still_one() -> None:
    for place, names in EXCEPTIONS.items():
        there = {name for _, name in writes(PACKAGE / place)} | {
            node.attr for node in ast.walk(ast.parse((PACKAGE / place).read_text())) if isinstance(node, ast.Attribute)
        }
        assert set(names) <= there, place


PLANTED = (
    "Path('a').write_text('x')",
    "open('a', 'w')",
    "Path('a').open(mode='ab')",
    "os.open('a', os.O_WRONLY | os.O_CREAT)",
    "np.save('a', x)",
    "np.savez('a', x=x)",
    "cv2.imwrite('a', x)",
    "figure.savefig(path)",
    "Image.fromarray(x).save(path)",
    "frame.to_csv('a')",
    "yaml.safe_dump(x, stream)",
    "json.dump(x, fp=stream)",
    "rosbag.Bag('a', 'w')",
)
ALLOWED = (
    "open('a')",
    "Path('a').open('rb')",
    "text = io.StringIO()\nfigure.savefig(text)",
    "yaml.safe_dump(x)",
    "s.save()",
)


@pytest.mark.parametrize("code", PLANTED)
def test_finds_a_planted_write(tmp_path: Path, code: str) -> None:
    (tmp_path / "a.py").write_text(code)
    assert list(writes(tmp_path / "a.py"))


@pytest.mark.parametrize("code", ALLOWED)
def test_lets_reading_pass(tmp_path: Path, code: str) -> None:
    (tmp_path / "a.py").write_text(code)
    assert not list(writes(tmp_path / "a.py"))


def in_little_room(code: str, room: int) -> subprocess.CompletedProcess[str]:
    """Run code in a process whose files may have so many bytes: a disk that is full after them looks the same."""
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))  # noqa: E731
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, preexec_fn=limit)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_files_of_one_result_change_together_or_not(tmp_path: Path) -> None:
    first, second = tmp_path / "a", tmp_path / "b"
    write_whole({first: "old", second: b"old"})
    code = f"""
from pathlib import Path
from kurumaisu.errors import Error
from kurumaisu.whole_files import write_whole
try:
    write_whole({{Path({str(first)!r}): "new", Path({str(second)!r}): bytes(20000)}})
except Error as error:
    print(error)
"""
    said = in_little_room(code, 5000)
    assert said.stdout == f"{second}: cannot be written: File too large\n", said.stderr
    assert (first.read_text(), second.read_text()) == ("old", "old")
    assert names(tmp_path) == ["a", "b"]
    write_whole({first: "new", second: "newer"})
    assert (first.read_text(), second.read_text()) == ("new", "newer")


def test_what_an_older_result_had_goes_with_it(tmp_path: Path) -> None:
    write_whole({tmp_path / "a": "1", tmp_path / "b": "1"})
    write_whole({tmp_path / "a": "2"}, gone=[tmp_path / "b", tmp_path / "c"])
    assert names(tmp_path) == ["a"]


def test_permissions_stay_and_links_are_followed(tmp_path: Path) -> None:
    real, link = tmp_path / "real", tmp_path / "link"
    real.write_text("old")
    real.chmod(0o640)
    link.symlink_to(real)
    write_whole({link: "new"})
    assert link.is_symlink()
    assert real.read_text() == "new"
    assert stat.S_IMODE(real.stat().st_mode) == 0o640
    new, umask = tmp_path / "new", os.umask(0o027)
    try:
        write_whole({new: ""})
    finally:
        os.umask(umask)
    assert stat.S_IMODE(new.stat().st_mode) == 0o640


def test_what_is_no_file_is_not_made_one(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path in (pipe, tmp_path, Path(os.devnull)):
        with pytest.raises(Error, match="no regular file"):
            write_whole({path: "x"})
    assert names(tmp_path) == ["pipe"]


@pytest.mark.parametrize("name", ["missing/a", "a\0b", "x" * 300])
def test_what_cannot_be_written_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(Error, match="cannot be written: "):
        write_whole({tmp_path / name: "x"})
    assert names(tmp_path) == []


def test_a_part_that_a_dead_process_left_is_no_obstacle(tmp_path: Path) -> None:

    (tmp_path / f".kurumaisu-{threading.get_native_id()}-0.part").write_text("rest")
    write_whole({tmp_path / "a": "whole"})
    assert (tmp_path / "a").read_text() == "whole"
    assert names(tmp_path) == ["a"]
