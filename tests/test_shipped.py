# SPDX-License-Identifier: BSD-3-Clause
"""Everything shipped loads: configuration, launch files with their nodes, worlds, and scripts where rosrun looks.

Run twice: in the devel space, and by .ci/install_space.bash in the install space.
"""

import importlib
import os
import re
import subprocess
from pathlib import Path

import pytest
import roslaunch.xmlloader
import roslib.packages
import rospkg
import yaml

TREE = Path(__file__).resolve().parents[1]
SHARE = Path(rospkg.RosPack().get_path("kurumaisu"))
YAMLS = sorted((SHARE / "launch").glob("*.yaml"))
LAUNCHES = sorted((SHARE / "launch").glob("*.launch"))
WORLDS = sorted((SHARE / "worlds").glob("*.world"))
SOURCE_TREE_TOOLS = {"bench", "demo", "real", "run", "setup", "test"}  # they build or need the source tree
OF_THE_WHEEL = {"kurumaisu"}  # its parts are programs of their own here
CONFIGURATIONS = {"Base.cfg", "Laser.cfg"}  # dynamic_reconfigure runs them when this package is built

# The strict readers of private parameters, by node type. Nodes in C++ read theirs when they start: rostests.
READERS = {
    "sim_node": "kurumaisu.ros.sim.settings:read_settings",
    "map_server": "kurumaisu.ros.maps.server:read_settings",
    "stageros": "kurumaisu.ros.stageros.settings:read_settings",
    "viewer": "kurumaisu.ros.viewer.settings:read_settings",
}


def name(path):
    return path.name


def call(target, *arguments):
    module, function = target.split(":")
    return getattr(importlib.import_module(module), function)(*arguments)


def scalars(node, keys=()):
    """Yield (line, keys, value as YAML reads it) of every scalar; a key given twice fails."""
    if isinstance(node, yaml.MappingNode):
        names = [key.value for key, _ in node.value]
        twice = sorted({key for key in names if names.count(key) > 1})
        assert not twice, f"line {node.start_mark.line + 1}: given twice: {twice}"
        for key, value in node.value:
            yield from scalars(value, (*keys, key.value))
    elif isinstance(node, yaml.SequenceNode):
        for value in node.value:
            yield from scalars(value, keys)
    else:
        yield node.start_mark.line + 1, keys, yaml.safe_load(yaml.serialize(node))


def looks_like_a_number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True


@pytest.mark.parametrize("path", YAMLS, ids=name)
def test_yaml_numbers_are_numbers(path):
    """YAML takes 1e-3 for text, and the last of two equal keys without a word."""
    found = list(scalars(yaml.compose(path.read_text())))
    assert found
    assert [entry for entry in found if isinstance(entry[2], str) and looks_like_a_number(entry[2])] == []


@pytest.mark.parametrize("text", ["a: 1e-3", "a: {b: 1, b: 2}", "a: [1.0, '2']"])
def test_finds_numbers_that_are_none(tmp_path, text):
    (tmp_path / "bad.yaml").write_text(text)
    with pytest.raises(AssertionError):
        test_yaml_numbers_are_numbers(tmp_path / "bad.yaml")


@pytest.mark.parametrize("path", YAMLS, ids=name)
def test_every_yaml_has_a_reader(path):
    """A file that no launch file and no line of code names is never loaded."""
    places = [*LAUNCHES, *(TREE / "src").rglob("*.py"), *(TREE / "src").rglob("*.cpp")]
    readers = [place for place in places if re.search(rf"\b{re.escape(path.name)}\b", place.read_text())]
    assert readers


def load(path):
    """Load a launch file as roslaunch does; what it leaves to the user gets the argument's name."""
    loader = roslaunch.xmlloader.XmlLoader()
    config = roslaunch.config.ROSLaunchConfig()
    unset = re.findall(r'<arg name="(\w+)"(?![^>]*(?:default|value)=)', path.read_text())
    loader.load(str(path), config, argv=[f"{argument}:={argument}" for argument in unset], verbose=False)
    return config


def parameters(config, node):
    """Return the private parameters of a node as one tree."""
    tree = {}
    prefix = f"{node.namespace}{node.name}/"
    for key, parameter in config.params.items():
        if key.startswith(prefix):
            *sections, leaf = key[len(prefix) :].split("/")
            place = tree
            for section in sections:
                place = place.setdefault(section, {})
            place[leaf] = parameter.value
    return tree


def leaves(tree):
    for key, value in tree.items():
        yield key
        if isinstance(value, dict):
            yield from leaves(value)


@pytest.mark.parametrize("path", LAUNCHES, ids=name)
def test_launch_file_loads_and_its_nodes_exist(path):
    config = load(path)
    assert config.config_errors == []
    assert config.nodes
    for node in config.nodes:
        assert roslib.packages.find_node(node.package, node.type), f"{node.package}/{node.type}"


@pytest.mark.parametrize("path", LAUNCHES, ids=name)
def test_launch_file_gives_its_nodes_what_they_read(path):
    config = load(path)
    sources = [path for kind in ("cpp", "h", "py") for path in (TREE / "src").rglob(f"*.{kind}")]
    text = "".join(source.read_text() for source in sources)
    # names that are the user's
    base = yaml.safe_load((SHARE / "launch/base_node.yaml").read_text())
    laws = yaml.safe_load((SHARE / "launch/md100.yaml").read_text())["voltage_laws"]
    own = {*laws, *base["inputs"], *base["locks"], *base["limits"]}
    for node in config.nodes:
        if node.package == "kurumaisu":
            tree = parameters(config, node)
            # a key that is in no source is misspelt, or no longer read
            assert [key for key in leaves(tree) if key not in own and f'"{key}"' not in text] == []
            if node.type in READERS:
                call(READERS[node.type], tree, path.name)


@pytest.mark.parametrize("path", LAUNCHES, ids=name)
def test_files_that_a_launch_file_names_exist(path):
    """Also those of a branch that load() does not take, as with gui."""
    named = re.findall(r"\$\(find kurumaisu\)/([\w./-]+)", path.read_text())
    assert [file for file in named if not (TREE / file).exists()] == []


@pytest.mark.parametrize("path", WORLDS, ids=name)
def test_world_loads(path):
    call("kurumaisu.world:load_world", path)


def test_unit_names_what_is_installed():
    """A service starts without any environment: its paths are whole ones."""
    unit = SHARE / "launch/systemd/kurumaisu-guard.service"
    prefix = SHARE.parents[1]
    if not (prefix / "lib/kurumaisu/guard").exists():
        pytest.skip("the unit is made by installing")
    paths = re.findall(rf"{re.escape(str(prefix))}/[\w./]+", unit.read_text())
    assert f"ExecStart={prefix}/lib/kurumaisu/guard" in unit.read_text()
    assert len(paths) >= 5
    assert [path for path in paths if not Path(path).exists()] == []


def test_model_loads():
    call("kurumaisu.params:load_model", SHARE / "launch/md100.yaml")


def test_all_that_the_tree_ships_is_here():
    for folder in ("launch", "worlds"):
        names = {path.name for path in (TREE / folder).iterdir()}
        assert names == {path.name for path in (SHARE / folder).iterdir()}


def test_scripts_are_installed_or_executable():
    """rosrun has every script but the wheel's, and those that build or need the source tree.

    In the source tree only the latter may be executable: rosrun would find the others twice and ask which is meant.
    """
    cmake = (TREE / "CMakeLists.txt").read_text()
    installed = set(re.findall(r"scripts/([\w-]+)", "".join(re.findall(r"catkin_install_python\([^)]*\)", cmake))))
    there = {path.name for path in (TREE / "scripts").iterdir() if not path.suffix}
    assert there - SOURCE_TREE_TOOLS - OF_THE_WHEEL == installed
    assert {name for name in there if os.access(TREE / "scripts" / name, os.X_OK)} == SOURCE_TREE_TOOLS


def test_test_nodes_are_where_rostest_looks():
    """Found in the source tree, a test node would run with the python on the path, which may not be the right one."""
    cmake = (TREE / "tests/CMakeLists.txt").read_text()
    made = re.findall(r"(\w+_test\.py)", "".join(re.findall(r"foreach\(node[^)]*\)", cmake)))
    assert sorted(made) == sorted(path.name for path in (TREE / "tests").glob("*_test.py"))


def completed(tmp_path):
    """Return the programs that rosrun kurumaisu offers for completion, as Debian's bash completion finds them."""
    # by links, for it leaves out what is in hidden folders, as the source tree's workspace is
    (prefix,) = [path for path in os.environ["CMAKE_PREFIX_PATH"].split(":") if Path(path, "lib/kurumaisu").exists()]
    (tmp_path / "space").symlink_to(prefix)
    (tmp_path / "packages").mkdir()
    (tmp_path / "packages/kurumaisu").symlink_to(SHARE)
    package = tmp_path / ("packages" if (SHARE / "src").exists() else "space/share")
    script = """
        source /usr/share/bash-completion/completions/rosbash
        COMP_WORDS=(rosrun kurumaisu "") COMP_CWORD=2
        _roscomplete_exe
        printf '%s\n' "${COMPREPLY[@]}"
        """
    environment = os.environ | {"CMAKE_PREFIX_PATH": f"{tmp_path}/space", "ROS_PACKAGE_PATH": str(package)}
    run = subprocess.run(["bash", "-c", script], check=True, capture_output=True, text=True, env=environment)
    return set(run.stdout.split())


def test_completion_offers_what_a_user_starts(tmp_path):
    """A page or a launch file names each program, so no test node is among them; all that pages start are there."""
    offered = completed(tmp_path)
    pages = [path for pattern in ("*.md", "docs/*.md", "launch/*.launch") for path in TREE.glob(pattern)]
    text = "\n".join(path.read_text() for path in pages)
    named = set(re.findall(r"[\w-]+", text))
    started = set(re.findall(r"rosrun kurumaisu ([\w-]+)", text))
    assert offered - CONFIGURATIONS - named == set()
    assert started - offered == set()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("sim.launch wrld:=a", "roslaunch: wrld:=a: sim.launch: no argument wrld; did you mean world?"),
        ("round.launch bag:=b viewr:=true", "no argument viewr; did you mean viewer"),  # of the sim.launch inside
        ("stageros.launch world:=a headless_rate:=1.0", ""),
        ("experiment.launch experiment:=a bag:=b speed:=2 laser:=driver", ""),
    ],
)
def test_a_mistyped_argument_ends_roslaunch(words, said):
    command = ["roslaunch", "--dump-params", "kurumaisu", *words.split()]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert bool(done.stdout) != bool(said), done.stderr  # the exit code is 0 either way
    assert said in done.stderr


def test_arguments_of_other_launch_files_are_left_alone(tmp_path):
    (tmp_path / "mine.launch").write_text(
        '<launch><arg name="mine"/><include file="$(find kurumaisu)/launch/sim.launch"/></launch>'
    )
    command = ["roslaunch", "--dump-params", str(tmp_path / "mine.launch"), "mine:=1", "other:=1"]
    subprocess.run(command, capture_output=True, check=True)
