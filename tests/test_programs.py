# SPDX-License-Identifier: BSD-3-Clause
"""Every installed program: --help and a wrong option without a master, missing files, and rviz where there is none."""

from __future__ import annotations

import ast
import functools
import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import pytest
import roslib.packages

TREE = Path(__file__).resolve().parents[1]
NOBODY = "http://127.0.0.1:1/"  # no master is there
LIMIT = 120.0  # [s] that a loaded machine may take; one that waits for a master takes for ever
WORK = 3.0  # [s] of processor time
COLUMNS = 80
USAGE = 2
PARTS = {
    "calibrate": ("plan", "record", "drive", "laser"),
    "critic": ("experiment", "plan", "rehearse", "watch"),
    "paper": ("drive", "wall", "conjecture", "dac", "simulated-wall", "all", "odometry"),
}
# Names that a library advertises, by what is in the source then.
LIBRARIES = {
    "/tf": "TransformBroadcaster|TransformListener",
    "/tf_static": "StaticTransformBroadcaster|TransformListener",
    "/diagnostics": "diagnostic_updater",
}


def python_programs() -> list[str]:
    """Return the programs in Python that CMake installs."""
    cmake = (TREE / "CMakeLists.txt").read_text()
    (block,) = re.findall(r"catkin_install_python\(PROGRAMS([^)]*) DESTINATION", cmake)
    return re.findall(r"scripts/([\w-]+)", block)


def cpp_programs() -> dict[str, Path]:
    """Return the programs in C++ that CMake installs, with the source of each one's main."""
    found = {}
    for cmake in (TREE / "src").rglob("CMakeLists.txt"):
        text = re.sub(r"foreach\((\w+) ([^)]*)\)(.*?)endforeach\(\)", unrolled, cmake.read_text(), flags=re.DOTALL)
        for names in re.findall(r"install\(TARGETS ([^)]*) RUNTIME DESTINATION", text):
            for name in names.split():
                (source,) = re.findall(rf"add_executable\({name}\s+([\w./]+)", text)
                found[name] = cmake.parent / source
    return found


def unrolled(loop: re.Match[str]) -> str:
    variable, values, body = loop.groups()
    return "".join(body.replace(f"${{{variable}}}", value) for value in values.split())


PROGRAMS = [*python_programs(), *cpp_programs()]
COMMANDS = [*((name,) for name in PROGRAMS), *((name, part) for name, parts in PARTS.items() for part in parts)]


def run(*command: str) -> subprocess.CompletedProcess[str]:
    (program,) = roslib.packages.find_node("kurumaisu", command[0])
    environment = {**os.environ, "ROS_MASTER_URI": NOBODY, "COLUMNS": str(COLUMNS)}
    return subprocess.run(
        [program, *command[1:]],
        env=environment,
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
        stdin=subprocess.DEVNULL,
    )


@functools.cache
def asked(*command: str) -> tuple[subprocess.CompletedProcess[str], float]:
    """Return what --help says, and the processor time [s] that it takes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = run(*command, "--help")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return done, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def help_of(name: str) -> str:
    return asked(name)[0].stdout


def test_all_programs_are_found():
    assert {"critic", "sim_node", "stageros", "viewer", "check-world"} < set(python_programs())
    assert {"base_node", "laser_node", "mapping_node", "localization_node", "guard", "getID"} < set(cpp_programs())


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_help_comes_without_a_master(command):
    done, work = asked(*command)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"usage: {' '.join(command)}")
    assert len(done.stdout.splitlines()) > 3
    assert [line for line in done.stdout.splitlines() if len(line) > COLUMNS] == []
    assert [page for page in re.findall(r"docs/\w+\.md", done.stdout) if not (TREE / page).exists()] == []
    assert work < WORK


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_wrong_option_is_said_without_a_master(name):
    """ROS's own words are no options."""
    done = run(name, "--no-such-option", "a:=b", "__name:=x")
    assert (done.returncode, done.stdout) == (USAGE, "")
    assert "usage: " in done.stderr


@pytest.mark.parametrize("name", cpp_programs())
def test_h_is_help(name):
    done = run(name, "-h", "a:=b", "__name:=x")
    assert (done.returncode, done.stdout) == (0, help_of(name))


def names_in(text: str) -> list[str]:
    """Return the topics and services that a help lists."""
    found = []
    listed = False
    for line in text.splitlines():
        if line and not line.startswith(" "):
            listed = line.startswith(("subscribes to", "publishes", "services"))
        elif listed and (match := re.match(r"  ((?:[~/\w]+, )*[~/\w]+)(?:  |$|: |, or )", line)):
            found += match[1].split(", ")
    return found


def source_of(name: str) -> str:
    """Return the text of a program's source: its own files and those that they take in."""
    if name in cpp_programs():
        return "".join(path.read_text() for path in taken_in(cpp_programs()[name], included))
    return "".join(path.read_text() for path in taken_in(TREE / "scripts" / name, imported))


def taken_in(path: Path, more) -> set[Path]:
    found, waiting = set(), [path]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += more(path)
    return found


def included(path: Path) -> list[Path]:
    headers = [TREE / "src" / name for name in re.findall(r'#include "([\w/.]+)"', path.read_text())]
    both = [*headers, *(header.with_suffix(".cpp") for header in headers)]
    return [file for file in both if file.exists()]


def imported(path: Path) -> list[Path]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("kurumaisu"):
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    places = [TREE / "src" / name.replace(".", "/") for name in names]
    return [file for place in places for file in (place.with_suffix(".py"), place / "__init__.py") if file.exists()]


NODES = [
    *("sim_node", "stageros", "viewer", "waypoint_node", "replay_odometry", "odom_to_tf", "map_server", "map_saver"),
    *("joystick", "teleop_joy", "teleop_keyboard", "base_node", "laser_node", "mapping_node", "localization_node"),
]


@pytest.mark.parametrize("name", NODES)
def test_what_the_help_lists_is_in_the_source(name):
    text, source = help_of(name), source_of(name)
    settings = re.findall(r"launch/\w+\.(?:yaml|launch)", text)
    assert [file for file in settings if not (TREE / file).exists()] == []
    source += "".join((TREE / file).read_text() for file in settings)
    listed = names_in(text)
    assert listed
    assert [topic for topic in listed if not is_in(topic, source)] == []


def is_in(topic: str, source: str) -> bool:
    word = topic.rpartition("/")[2].lstrip("~")
    library = LIBRARIES.get(topic)
    return bool(re.search(rf'["/~]{word}"|topic: {word}\b', source) or (library and re.search(library, source)))


ADVERTISED = [
    r'rospy\.(?:Publisher|Subscriber|Service)\(\s*f?"([^"]+)"',
    r'(?:advertise|subscribe|advertiseService)(?:<[^>]*>)?\(\s*"([^"]+)"',
]

UNUSED = {"joystick": ["dead_man"]}  # of a class that the node imports and does not use


@pytest.mark.parametrize("name", NODES)
def test_what_the_source_advertises_is_in_the_help(name):
    text, source = help_of(name), source_of(name)
    names = {found for pattern in ADVERTISED for found in re.findall(pattern, source)}
    words = {*re.findall(r"\w+", text), *UNUSED.get(name, ())}
    assert {found for found in names if re.split(r"[/~]", found)[-1] not in words} == set()


LOST = "lost/file.yaml"
FILES = [
    ("critic", LOST),
    ("critic", "rehearse", LOST),
    ("critic", "plan", "--detect", "base.lag_v", "--model", LOST),
    ("critic", "watch", "--model", LOST),
    ("critic", "watch", "--meta", LOST),
    ("critic", "experiment", "mine", "--file", LOST),
    ("map", LOST),
    ("view", LOST),
    ("check-world", LOST),
    ("export-world", LOST),
    ("paper", "drive", LOST, "--out", "out"),
    ("paper", "wall", LOST, "--out", "out"),
    ("paper", "conjecture", LOST, "--out", "out"),
    ("paper", "odometry", LOST),
    ("calibrate", "--settings", LOST, "plan"),
    ("calibrate", "drive", LOST, "--test", LOST, "--out", "out"),
    ("calibrate", "laser", LOST, "--distances", "1", "--out", "out"),
    ("urdf", LOST, "base_link"),
    ("frame", LOST, "laser/frame"),
    ("virtual_urg", "--tcp", "0", "--sensor", LOST),
    ("virtual_urg", "--tcp", "0", "--world", LOST, "--pose", "0", "0", "0"),
    ("example_numpy", LOST),
    ("guard", LOST, LOST),
    ("guard", "--neutral", LOST, LOST),
    ("set_voltages", LOST, "0", "0", "2.5"),
    ("virtual_dac", LOST, "dac"),
    ("getID", "/lost/file.yaml"),
]


@pytest.mark.parametrize("command", FILES, ids=" ".join)
def test_a_missing_file_has_one_exit_code(command, tmp_path, monkeypatch):
    """Those of nodes that read theirs from parameters are in their rostests."""
    monkeypatch.chdir(tmp_path)
    done = run(*command)
    assert (done.returncode, done.stdout) == (1, "")
    assert "lost/file.yaml" in done.stderr
    assert "Traceback" not in done.stderr


def test_rviz_is_explained(tmp_path):
    """With no rviz on the path, whatever this machine has."""
    (program,) = roslib.packages.find_node("kurumaisu", "rviz")
    environment = {**os.environ, "PATH": str(tmp_path)}
    done = subprocess.run([program], env=environment, capture_output=True, text=True, timeout=LIMIT, check=False)
    assert done.returncode == 1
    assert "scripts/setup --gui, or apt-get install rviz" in done.stderr


def test_rviz_gets_its_arguments(tmp_path):
    stand_in = tmp_path / "rviz"
    stand_in.write_text('#!/bin/sh\necho "$@"\n')
    stand_in.chmod(0o755)
    (program,) = roslib.packages.find_node("kurumaisu", "rviz")
    environment = {**os.environ, "PATH": f"{tmp_path}:/bin"}
    words = ["-d", "a.rviz", "__name:=rviz", "__log:=log"]
    done = subprocess.run(
        [program, *words], env=environment, capture_output=True, text=True, timeout=LIMIT, check=False
    )
    assert (done.returncode, done.stdout) == (0, " ".join(words) + "\n")


def test_launch_files_start_our_rviz():
    """Else roslaunch would say that it cannot launch a node, and not how to get it."""
    launches = [path for path in (TREE / "launch").glob("*.launch") if 'name="gui"' in path.read_text()]
    text = "".join(path.read_text() for path in launches)
    assert 'pkg="kurumaisu" type="rviz"' in text
    assert 'pkg="rviz"' not in text


def test_a_stream_that_was_closed_is_no_files_number(tmp_path):
    code = "import sys, os; from kurumaisu import program; program.words(); print(os.open(sys.argv[1], os.O_CREAT))"
    command = ["bash", "-c", '"$@" 2>&- <&-', "-", sys.executable, "-c", code, str(tmp_path / "file")]
    said = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
    assert int(said) > 2
