# SPDX-License-Identifier: BSD-3-Clause
"""What README and docs tell a reader to type, and how test_docs.py runs it."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]

# What a reader puts in place of a word in capitals, in a folder that looks like the source tree.
SAMPLES = {
    "RECORDING": "drive.bag",  # that of the example of record.launch
    "DAY_1": "day_1",
    "DAY_2": "day_2",
    "FOLDER": "out/folder",
    "DEVICE.yaml": "mine.yaml",  # that of the example in dac.md
    "GUARD.yaml": "tmp/guard.yaml",  # that of the example in robot.md
    "META.yaml": "day_1/meta.yaml",
    "FILE.yaml": "worlds/maps/room.yaml",
    "FILE": "worlds/room.world",
    "NAME": "saved",
}

# Ports that somebody else on this computer may have taken are left to the system.
PORTS = {r"(viewer:=true)": r"\1 viewer_port:=0", r"(kurumaisu view .*)": r"\1 --port 0"}

# What cannot be run, and why.
NOT_RUN = {
    r"^scripts/(demo|test)\b": "installs packages; tests/test_demo.py runs the demonstration, and this is scripts/test",
    r"\bsudo\b|/sys/bus/iio": "needs root, and changes the computer",
    r"^ROS_NAMESPACE=": "needs a laser; two_chairs.test does the same",
    r"/dev/ttyACM0|192\.168\.": "needs a sensor",
    r"critic experiment": "needs a chair with room around it; experiment.launch runs the same program",
    r"python -m pytest": "scripts/test runs it",
    r"^(pip|kurumaisu) ": "is the wheel's: .ci/wheel.bash installs it, and runs its programs",
}

# Takes minutes: only its arguments are read. tests/test_bench*.py, test_paper*.py and test_riddles.py run parts of it.
READ_ONLY = r"^scripts/bench|rosrun kurumaisu paper |kurumaisu\.riddles"


@dataclass(frozen=True)
class Command:
    """A line of a page that a reader may type."""

    page: str
    line: int
    text: str

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


@dataclass(frozen=True)
class Step:
    """A command of a scene, found by a pattern: it ends by itself, unless something is said of when it is ready."""

    pattern: str
    topic: str = ""  # ready when something comes on it; TOPIC@NODE: from a node of that name
    says: str = ""  # ready when its output has this
    makes: str = ""  # ready when this file is there
    stays: bool = False  # goes on until an End or the end of the scene; else it is interrupted when it is ready
    codes: tuple[int, ...] = (0,)
    drives: bool = False  # the simulated chair has to move, and to hit nothing, for 10 s

    @property
    def ends(self) -> bool:
        """Whether it ends by itself."""
        return not (self.topic or self.says or self.makes or self.drives)


@dataclass(frozen=True)
class End:
    """Interrupts what a step left running."""

    pattern: str


_VERDICTS = (0, 3, 4, 5)
# Also 6, wrong data: recorded as it is driven, on a busy computer a chair may stand for want of commands.
_VERDICTS_LIVE = (*_VERDICTS, 6)
# Together, because one makes what the next one takes, or because starting the same nodes twice costs time.
SCENES: tuple[tuple[Step | End, ...], ...] = (
    (
        Step(r"roslaunch kurumaisu sim\.launch viewer:=true", topic="/scan", stays=True),
        Step(r"record\.launch", makes="drive.bag.active", stays=True),
        Step(r"rostopic pub .*cmd_vel", drives=True),
        End(r"record\.launch"),
        Step(r"rosservice call /viewer_node/clients"),
        Step(r"slam\.launch save:=", topic="/map", stays=True),
        Step(r"rosservice call /mapping_node/save_map"),
        End(r"slam\.launch save:="),
        Step(r"slam\.launch start_map:=", topic="/map"),
        Step(r"localization\.launch .*initial_pose", topic="/diagnostics@localization_node"),
        Step(r"rosrun kurumaisu map_server", topic="/map", stays=True),
        Step(r"rosrun kurumaisu map_saver"),
        End(r"rosrun kurumaisu map_server"),
        Step(r"critic watch", says="critic watch: "),
        Step(r"dynparam set /sim_node/live \"\{"),
        Step(r"rostopic echo -n 1 /sim_node/effects"),
        Step(r"dynparam set /sim_node/live base_lag_v_enabled false"),
        End(r"roslaunch kurumaisu sim\.launch viewer:=true"),
        Step(r"critic look RECORDING$"),
        Step(r"critic RECORDING$|critic drive\.bag", codes=_VERDICTS_LIVE),
        Step(r"kurumaisu map RECORDING"),
        Step(r"kurumaisu view RECORDING$", says="http://"),
        Step(r"replay\.launch bag:=\S+$", topic="/odom"),
    ),
    (Step(r"sim\.launch laser:=driver", topic="/scan"),),
    (Step(r"stageros\.launch", topic="/base_scan"),),
    (Step(r"round\.launch", topic="/scan"),),
    (Step(r"experiment\.launch"), Step(r"critic spin\.bag", codes=_VERDICTS_LIVE)),
    (Step(r"base\.launch", topic="/voltages"),),
    (
        Step(r"sed .*serial_ascii.yaml > /tmp/board\.yaml"),
        Step(r"sed .*launch/guard.yaml > /tmp/guard\.yaml"),
        Step(r"virtual_dac /tmp/board\.yaml", makes="tmp/dac", stays=True),
        Step(r"virtual_urg --pty", makes="tmp/urg", stays=True),
        Step(r"laser\.launch serial_port:=/tmp/urg", topic="/scan", stays=True),
        Step(r"dynparam set /laser_node"),
        End(r"laser\.launch serial_port:=/tmp/urg"),
        Step(r"robot\.launch dac:=guard", topic="/scan"),
        End(r"virtual_dac /tmp/board\.yaml"),
        Step(r"sed .*serial_ascii.yaml > mine\.yaml"),
        Step(r"virtual_dac mine\.yaml", makes="tmp/dac", stays=True),
        Step(r"set_voltages mine\.yaml"),
        Step(r"guard --neutral"),
        Step(r"rosrun kurumaisu guard DEVICE", makes="tmp/guard.sock"),
    ),
    (Step(r"virtual_urg .*--tcp", says="10940"),),
    (
        Step(r"echo .*> hidden\.yaml"),
        Step(r"critic rehearse .*hidden\.yaml"),
        Step(r"critic drives$", codes=_VERDICTS),
    ),
    (
        Step(r"launch/md100\.yaml; echo .*> wheels\.yaml"),
        Step(r"echo .*> wrong\.yaml"),
        Step(r"critic rehearse .*wrong\.yaml"),
        Step(r"critic look wheels$"),
        Step(r"critic wheels$", codes=_VERDICTS),
    ),
    (Step(r"critic DAY_1 DAY_2", codes=_VERDICTS),),
    (Step(r"critic rehearse spin_both_ways"),),
    (Step(r"critic plan"),),
    (Step(r"roslaunch --ros-args"),),
    (Step(r"check-world"),),
    (Step(r"export-world"),),
    (Step(r"calibrate plan"),),
    (Step(r"scripts/example_gym"),),
    (Step(r"scripts/example_numpy"),),
)


def blocks(page: Path, language: str) -> Iterator[tuple[int, str]]:
    """Yield the fenced blocks of a language, with the number of their first line."""
    start, inside, lines = 0, None, []
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        if fence := re.match(r"\s*```(\w*)\s*$", line):
            if inside is None:
                start, inside, lines = number + 1, fence[1], []
            else:
                if inside == language:
                    yield start, "\n".join(lines) + "\n"
                inside = None
        else:
            lines.append(line)


def commands() -> list[Command]:
    """Return every command of the pages: the lines of blocks of sh, and a benchmark's above its tables."""
    found = []
    for page in PAGES:
        name = str(page.relative_to(ROOT))
        lines = [(start + i, line) for start, text in blocks(page, "sh") for i, line in enumerate(text.splitlines())]
        for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
            if re.match(r"    scripts/bench", line):
                lines.append((number, line))
        found += [Command(name, number, re.sub(r"\s+#\s.*$", "", line).strip()) for number, line in lines]
    return [command for command in found if command.text]


def filled_in(text: str, scratch: Path) -> str:
    """Return the command with the samples in place of the words in capitals, and all of it below one folder."""
    for word, sample in SAMPLES.items():
        text = re.sub(rf"(?<![\w.]){re.escape(word)}(?![\w])", sample, text)
    for pattern, port in PORTS.items():
        text = re.sub(pattern, port, text)
    return re.sub(r"(?<![\w.])/tmp/", f"{scratch}/tmp/", text)
