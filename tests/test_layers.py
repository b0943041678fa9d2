# SPDX-License-Identifier: BSD-3-Clause
"""Dependencies point one way: scripts -> ros, critic -> sim -> effects, world -> model. ROS stays in its folders.

A folder of src/ holds few files, and no two folders import each other.
"""

import ast
import os
import pkgutil
import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from kurumaisu import effects

ROOT = Path(__file__).resolve().parents[1]
ROS_PYTHON = (
    r"(rospy|rosbag|dynamic_reconfigure|roslib|roslaunch|rospkg|rosgraph|rosnode|rosparam|rostopic|rosservice|roscpp|genpy|actionlib"
    r"|tf|tf2\w*|\w+_msgs|std_srvs|kurumaisu\.msg|kurumaisu\.srv)(\.|$)"
)
ROS_CPP = r"<(ros\w*|tf2?|tf2_\w+|xmlrpcpp|actionlib|nodelet|diagnostic_updater|\w+_msgs|std_srvs|kurumaisu)/"
ABSTRACT = {"base", "mechanism", "laser"}
MODULES = {module.name for module in pkgutil.iter_modules(effects.__path__)} - ABSTRACT | {r"laser\.\w+"}
CONCRETE = rf"kurumaisu\.effects\.({'|'.join([*MODULES, *(effect.__name__ for effect in effects.ALL)])})(\.|$)"
# C++ that rests on nothing
SHARED = r"command_line\.h|file_descriptor\.h|regular_file\.h|signals\.h|sleep_watch\.h|standard_streams\.h|steady\.h"
IDS = {effect.id for effect in effects.ALL}
LARGEST = 25  # files in a folder of src/; a C++ header and its source are one
ONE_PER_EFFECT = "kurumaisu/effects"  # as many files as there are effects
GATHERS = (
    "__init__.py",
    "bindings.cpp",
)  # may import what is in folders below their own, though these import the others there


@dataclass(frozen=True)
class Rule:
    """What (a regular expression) must not be reached from where (one over the file's path)."""

    where: str
    what: str
    why: str


PYTHON_RULES = [
    Rule(r"kurumaisu/(?!ros/)", ROS_PYTHON, "only kurumaisu/ros knows ROS"),
    Rule(r"kurumaisu/(?!sim/)", r"pymunk(\.|$)", "only kurumaisu/sim knows pymunk"),
    Rule(
        r"kurumaisu/(?!slam\.py|localization\.py|ros/)",
        r"kurumaisu\._slam$",
        "MRPT is reached through kurumaisu.slam",
    ),
    Rule(
        r"kurumaisu/(?!ros/|bench/|programs/|demo/)",
        r"kurumaisu\.ros(\.|$)",
        "only entry points come before kurumaisu/ros",
    ),
    Rule(
        r"kurumaisu/(?!critic/|ros/|bench/|programs/|demo/|paper/|real/|riddles/)",
        r"kurumaisu\.critic(\.|$)",
        "nothing rests on the critic",
    ),
    Rule(r"kurumaisu/(?!bench/|demo/)", r"kurumaisu\.(bench|demo)(\.|$)", "nothing rests on a benchmark or the demo"),
    Rule(r"kurumaisu/(?!programs/)", r"kurumaisu\.programs(\.|$)", "programs come first"),
    Rule(r"kurumaisu/(effects|world)/", r"kurumaisu\.sim(\.|$)", "the simulator rests on effects and world"),
    Rule(r"kurumaisu/world/", r"kurumaisu\.effects(\.|$)", "a world knows no chair"),
    Rule(r"kurumaisu/(effects|sim|world)/", r"kurumaisu\.experiments(\.|$)", "an experiment is done to the simulator"),
    Rule(r"kurumaisu/experiments/", r"kurumaisu\.(sim|effects)(\.|$)", "a script does not know who runs it"),
    Rule(
        r"kurumaisu/(critic|experiments|sim|world)/",
        rf"{CONCRETE}|effect id",
        "it iterates over effects.ALL and names none",
    ),
    Rule(r"kurumaisu/\w+\.py", r"kurumaisu\.(sim|world|viewer)(\.|$)", "what all share rests on nothing"),
]
CPP_RULES = [
    Rule(
        r"(?!.*_node\.cpp|kurumaisu/bench/drivers/|.*/messages\.(cpp|h)|params\.h|clock_watch\.h"
        r"|base/node/((command|odometry|diagnostics)_(in|out)put|limits_server|host_gate|master_watch|stop_request|topic_dac)\.(cpp|h)"
        r"|plausible/transform_input\.(cpp|h)|slam/nodes/((mapping_output|scan_feed)\.(cpp|h)|mapping_parameters\.h))",
        ROS_CPP,
        "ROS headers only in *_node.cpp, its messages.h, input.h and output.h, params.h and clock_watch.h, and peers",
    ),
    Rule(r"(?!laser/|slam/)", r"<mrpt/", "MRPT only in laser/ and slam/"),
    Rule(r"(?!.*bindings(\.(cpp|h)|/))", r"<pybind11/", "pybind11 only in bindings"),
    Rule(r"model/", r'"(?!model/)', "the equations rest on nothing"),
    Rule(r"plausible/", r'"(?!model/|plausible/|bindings\.h)', "what makes sense rests on the equations only"),
    Rule(r"follow/", r'"(?!follow/|bindings\.h)', "following rests on nothing"),
    Rule(r"scip/", r'"(?!scip/)', "the protocol rests on nothing"),
    Rule(r"guard/", rf'"(?!dac/|guard/|yaml\.h|{SHARED})', "the guard rests on the D/A converter only"),
    Rule(
        r"virtual_urg/", rf'"(?!scip/|virtual_urg/|bindings\.h|{SHARED})', "the virtual sensor shares the protocol only"
    ),
    Rule(
        r"laser/",
        rf'"(?!scip/|serial/|laser/|plausible/|params\.h|clock_watch\.h|{SHARED})',
        "the driver rests on the protocol, the port and what makes sense",
    ),
    Rule(r"serial/", rf'"(?!serial/|{SHARED})', "a port rests on nothing"),
    # a virtual board is plugged in and out as a virtual sensor is
    Rule(r"dac/(?!virtual/)", rf'"(?!dac/|serial/|yaml\.h|{SHARED})', "what moves the chair rests on the port only"),
    Rule(r"(kalman|raycast)/", r'"(?!model/|kalman/|raycast/|bindings\.h)', "numerics rest on the equations at most"),
]


def violations(root: Path) -> list[str]:
    """Return a line for each dependency in src/ and each script that the rules forbid."""
    found = []
    for path in sorted((root / "src/kurumaisu").rglob("*.py*")):
        if path.suffix in (".py", ".pyi"):
            found += _forbidden(path, path.relative_to(root / "src"), _imports(path, root / "src"), PYTHON_RULES)
    for path in sorted((root / "src").rglob("*.[ch]*")):
        if path.suffix in (".cpp", ".h"):
            found += _forbidden(path, path.relative_to(root / "src"), _includes(path), CPP_RULES)
    for path in sorted((root / "scripts").iterdir()) if (root / "scripts").exists() else []:
        lines = path.read_text().splitlines()
        if "python" in lines[0] and len(lines) >= 15:
            found.append(f"{path}:15: a Python script only calls main (less than 15 lines)")
    return found


def _forbidden(path: Path, place: Path, used: Iterator[tuple[int, str]], rules: list[Rule]) -> list[str]:
    return [
        f"{path}:{line}: {name}: {rule.why}"
        for line, name in used
        for rule in rules
        if re.match(rule.where, place.as_posix()) and re.match(rule.what, name)
    ]


def _includes(path: Path) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(path.read_text().splitlines(), 1):
        match = re.match(r'\s*#\s*include\s*(["<].*)', line)
        if match:
            yield number, match.group(1)


def _imports(path: Path, source: Path) -> Iterator[tuple[int, str]]:
    """Yield line and full name of every import, and of what else gives an effect away."""
    yield from _imported(path, source)
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.Attribute):
            # from kurumaisu import effects; effects.GainV
            yield node.lineno, f"kurumaisu.{ast.unparse(node)}"
        elif isinstance(node, ast.Constant) and node.value in IDS:
            yield node.lineno, f"effect id {node.value}"


def _imported(path: Path, source: Path) -> Iterator[tuple[int, str]]:
    """Yield line and full name of every import: at the top, in functions, relative, or by import_module."""
    package = path.relative_to(source).parent.parts
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join([*above, *([node.module] if node.module else [])])
            yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith(("import_module", "__import__")):
            yield node.lineno, str(getattr(node.args[0], "value", "a name that is not written out"))


def crowded(root: Path) -> list[str]:
    """Return a line for each folder of src/ that holds too many files."""
    found = []
    source = root / "src"
    for folder in sorted(path for path in [source, *source.rglob("*")] if path.is_dir()):
        place = folder.relative_to(source).as_posix()
        if folder.name == "__pycache__" or f"{place}/".startswith(f"{ONE_PER_EFFECT}/"):
            continue
        files = [path for path in folder.iterdir() if path.is_file()]
        units = {path.stem if path.suffix in (".cpp", ".h") else path.name for path in files}
        if len(units) > LARGEST:
            found.append(f"{folder}: {len(units)} files, at most {LARGEST}: what belongs together gets a folder")
    return found


def mutual(root: Path) -> list[str]:
    """Return a line for each two folders of src/ that import each other.

    Compared are, in each folder, those in it, each with all below it, and the files that are not in any of them.
    """
    source = root / "src"
    by_pair: dict[tuple[Path, Path], str] = {}
    for path, line, used in _uses(source):
        here, there = _apart(path, used)
        if here != there and not (path.name in GATHERS and here == path.parent):
            by_pair.setdefault((here, there), f"{path}:{line}")
    return [
        f"{here} and {there} import each other: {by_pair[here, there]}, {by_pair[there, here]}"
        for here, there in sorted(by_pair)
        if here < there and (there, here) in by_pair
    ]


def _apart(path: Path, used: Path) -> tuple[Path, Path]:
    """Return the folders of two files below the innermost that holds both; it itself for a file that is in no other."""
    common = Path(os.path.commonpath([path.parent, used.parent]))

    def below(file: Path) -> Path:
        parts = file.relative_to(common).parts
        return common / parts[0] if len(parts) > 1 else common

    return below(path), below(used)


def _uses(source: Path) -> Iterator[tuple[Path, int, Path]]:
    """Yield a file, a line of it, and the file in src/ that is imported or included there."""
    for path in sorted(source.rglob("*.[ch]*")):
        if path.suffix in (".cpp", ".h"):
            for line, name in _includes(path):
                used = source / name.strip('"<> ')
                if used.is_file():
                    yield path, line, used
    for path in sorted((source / "kurumaisu").rglob("*.py*")):
        if path.suffix in (".py", ".pyi"):
            for line, name in _imported(path, source):
                if name.startswith("kurumaisu."):
                    yield path, line, _module(source, name)


def _module(source: Path, name: str) -> Path:
    """Return the file of a module, or of the module that a name is in."""
    path = source.joinpath(*name.split("."))
    while path != source:
        if path.is_dir():
            return path / "__init__.py"
        if path.with_suffix(".py").is_file():
            return path.with_suffix(".py")
        path = path.parent
    return source / "kurumaisu/__init__.py"


def test_the_tree_keeps_the_rules():
    found = violations(ROOT)
    assert not found, "\n".join(found)


def test_no_folder_is_crowded():
    found = crowded(ROOT)
    assert not found, "\n".join(found)


def test_no_two_folders_import_each_other():
    found = mutual(ROOT)
    assert not found, "\n".join(found)


PLANTED = {
    "src/kurumaisu/critic/a.py": "import rospy",
    "src/kurumaisu/sim/b.py": "def f():\n    from sensor_msgs.msg import LaserScan",
    "src/kurumaisu/critic/c.py": "import rosbag",
    "src/kurumaisu/viewer/d.py": "from kurumaisu.msg import Voltages",
    "src/kurumaisu/critic/e.py": "import pymunk",
    "src/kurumaisu/world/f.py": "import kurumaisu._slam",
    "src/kurumaisu/sim/g.py": "from importlib import import_module\nimport_module('kurumaisu._slam')",
    "src/kurumaisu/sim/h.py": "from kurumaisu.critic import recording",
    "src/kurumaisu/sim/i.py": "from kurumaisu import critic",
    "src/kurumaisu/sim/j.py": "from ..critic import recording",
    "src/kurumaisu/critic/k.py": "from kurumaisu.ros import sim_node",
    "src/kurumaisu/effects/l.py": "from kurumaisu.sim.plant import Plant",
    "src/kurumaisu/critic/m.py": "from kurumaisu.effects.lag import LagV",
    "src/kurumaisu/critic/n.py": "from kurumaisu.effects import LagV",
    "src/kurumaisu/critic/o.py": "from kurumaisu import effects\neffects.LagV",
    "src/kurumaisu/critic/o2.py": "chosen = 'base.lag_v'",
    "src/kurumaisu/sim/o3.py": "from kurumaisu import experiments",
    "src/kurumaisu/experiments/o4.py": "from kurumaisu.sim import plant",
    "src/kurumaisu/experiments/o5.py": "import rospy",
    "src/kurumaisu/world/p.py": "from kurumaisu import effects",
    "src/kurumaisu/geometry.py": "from kurumaisu.sim import plant",
    "src/kurumaisu/sim/q.py": "from kurumaisu.bench import table",
    "src/model/r.cpp": "#include <ros/ros.h>",
    "src/base/s.h": "#include <geometry_msgs/Twist.h>",
    "src/base/t.cpp": "# include  <mrpt/random.h>",
    "src/slam/u.cpp": "#include <kurumaisu/Voltages.h>",
    "src/raycast/v.h": "#include <pybind11/numpy.h>",
    "src/model/w.h": '#include "slam/mapping/mapper.h"',
    "src/kalman/x.cpp": '#include "base/drive.h"',
    "scripts/y": "#!/usr/bin/env python3\n" + "pass\n" * 15,
}


@pytest.mark.parametrize("name", PLANTED)
def test_finds_a_planted_violation(tmp_path, name):
    (tmp_path / name).parent.mkdir(parents=True)
    (tmp_path / name).write_text(PLANTED[name] + "\n")
    found = violations(tmp_path)
    assert found
    assert all(str(tmp_path / name) in line for line in found)


ALLOWED = {
    "src/kurumaisu/ros/a.py": "import rospy\nfrom kurumaisu.sim import plant\nfrom kurumaisu.critic import recording",
    "src/kurumaisu/critic/b.py": "import rosbags\nfrom kurumaisu import effects\neffects.ALL, effects.base.Rate",
    "src/kurumaisu/critic/c.py": "from kurumaisu.effects import Context\nfrom kurumaisu.sim.plant import Plant",
    "src/kurumaisu/sim/d.py": "import pymunk",
    "src/base/node/base_node.cpp": "#include <ros/ros.h>",
    "src/slam/e.cpp": '#include <mrpt/random.h>\n#include "model/unicycle.h"',
    "scripts/f": "#!/usr/bin/env bash\n" + "true\n" * 30,
}


@pytest.mark.parametrize("name", ALLOWED)
def test_lets_pass_what_is_allowed(tmp_path, name):
    (tmp_path / name).parent.mkdir(parents=True)
    (tmp_path / name).write_text(ALLOWED[name] + "\n")
    assert violations(tmp_path) == []


def plant(root: Path, files: dict[str, str]) -> None:
    """Write files, by their paths."""
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text + "\n")


@pytest.mark.parametrize("folder", ["src/kurumaisu/sim", "src/kurumaisu/critic/report", "src/slam", "src/slam/filters"])
def test_finds_a_crowded_folder(tmp_path, folder):
    plant(tmp_path, {f"{folder}/f{i}.{end}": "" for i in range(LARGEST) for end in ("h", "cpp")})
    assert crowded(tmp_path) == []
    plant(tmp_path, {f"{folder}/more.py": ""})
    found = crowded(tmp_path)
    assert len(found) == 1
    assert str(tmp_path / folder) in found[0]


def test_effects_may_be_many(tmp_path):
    plant(
        tmp_path, {f"src/kurumaisu/effects/{place}f{i}.py": "" for i in range(2 * LARGEST) for place in ("", "laser/")}
    )
    assert crowded(tmp_path) == []


MUTUAL = {
    "siblings": {
        "src/kurumaisu/ros/viewer/node.py": "from kurumaisu.ros.sim import effects",
        "src/kurumaisu/ros/sim/effects.py": "from kurumaisu.ros.viewer.maps import Maps",
        "src/kurumaisu/ros/viewer/maps.py": "",
    },
    "at different depths": {
        "src/kurumaisu/sim/motion/bodies.py": "def f():\n    from ...virtual_urg import models",
        "src/kurumaisu/virtual_urg/feeds.py": "import importlib\nimportlib.import_module('kurumaisu.sim.chair')",
        "src/kurumaisu/sim/chair.py": "",
        "src/kurumaisu/virtual_urg/models.py": "",
    },
    "a folder and one in it": {
        "src/kurumaisu/bench/peers.py": "from kurumaisu.bench.slam import drive",
        "src/kurumaisu/bench/slam/office/bags.py": "from kurumaisu.bench import peers",
        "src/kurumaisu/bench/slam/drive.py": "",
    },
    "C++": {
        "src/slam/mapper.cpp": '#include "raycast/arena.h"',
        "src/raycast/arena.h": '#include "slam/filters/grid.h"',
        "src/slam/filters/grid.h": "",
    },
    "C++, a folder and one in it": {
        "src/slam/grid.h": '#  include "slam/filters/filter.h"',
        "src/slam/filters/filter.h": '#include "slam/grid.h"',
    },
}


@pytest.mark.parametrize("case", MUTUAL)
def test_finds_folders_that_import_each_other(tmp_path, case):
    plant(tmp_path, MUTUAL[case])
    assert len(mutual(tmp_path)) == 1


ONE_WAY = {
    "a chain": {
        "src/kurumaisu/ros/viewer/node.py": "from kurumaisu.ros.sim import effects",
        "src/kurumaisu/ros/sim/effects.py": "from kurumaisu.ros import rotation\nfrom kurumaisu.sim import plant",
        "src/kurumaisu/ros/rotation.py": "from kurumaisu.errors import Error",
        "src/kurumaisu/errors.py": "",
        "src/kurumaisu/sim/plant.py": "",
    },
    "a package that gathers what is public": {
        "src/kurumaisu/sim/__init__.py": "from kurumaisu.sim.robots.simulator import Simulator",
        "src/kurumaisu/sim/robots/simulator.py": "from kurumaisu.sim.options import Options",
        "src/kurumaisu/sim/options.py": "",
    },
    "bindings": {
        "src/bindings.cpp": '#include "contact/bindings.h"',
        "src/contact/bindings.h": '#include "bindings.h"',
        "src/bindings.h": "",
    },
    "a variable of a folder's name": {
        "src/kurumaisu/sim/plant.py": "def f(world):\n    return world.walls",
        "src/kurumaisu/world/walls.py": "from kurumaisu.sim import plant",
    },
}


@pytest.mark.parametrize("case", ONE_WAY)
def test_lets_pass_imports_one_way(tmp_path, case):
    plant(tmp_path, ONE_WAY[case])
    assert mutual(tmp_path) == []


def machine_paths(root: Path) -> list[str]:
    """Return the places in files that git tracks, or would, that name a folder of one machine."""
    # written in pieces, or this file would be one of them
    folders = ["/" + "work/", "/" + "root/", "/" + "tmp/bash_jobs", "/" + "home/"]
    pattern = re.compile("|".join([*map(re.escape, folders), re.escape(str(root)) + r"(?!\w)"]))
    listing = ["git", "-C", str(root), "ls-files", "-z", "-co", "--exclude-standard"]
    names = subprocess.run(listing, check=True, capture_output=True).stdout.split(b"\0")
    paths = (root / os.fsdecode(name) for name in names if name)
    return [
        f"{path}:{number}: {line}"
        for path in paths
        if path.is_file() and not path.is_symlink()
        for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1)
        if pattern.search(line)
    ]


def test_no_file_names_this_machine():
    found = machine_paths(ROOT)
    assert not found, "\n".join(found)


def test_finds_a_planted_machine_path(tmp_path):
    subprocess.run(["git", "init", "-q", str(tmp_path)], check=True)
    (tmp_path / "good").write_text("framework/ /tmp/x https://example.org/work\n")
    assert machine_paths(tmp_path) == []
    (tmp_path / "bad").write_text("cd /" + "work/tree\n")
    (tmp_path / "here").write_text(f"cd {tmp_path}\n")
    assert len(machine_paths(tmp_path)) == 2
