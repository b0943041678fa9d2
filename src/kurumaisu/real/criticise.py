# SPDX-License-Identifier: BSD-3-Clause
"""Foreign data as a recording of the critic's, and its answer."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import yaml

from kurumaisu.critic.app import cli
from kurumaisu.critic.app.arrays import run_of
from kurumaisu.critic.app.job import Job
from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.data.csv_reader import write_csv_run
from kurumaisu.critic.values.verdict import Verdict
from kurumaisu.errors import Error
from kurumaisu.params import Robot
from kurumaisu.types import FloatArray
from kurumaisu.whole_files import write_whole


def recording(folder: Path, runs: Mapping[str, Mapping[str, FloatArray]], **meta: object) -> Path:
    """Write runs of tables, as critic.app.arrays takes them, with meta.yaml, and return their folder.

    Raise Error naming a table that is misshapen.
    """
    for name, tables in runs.items():
        write_csv_run(folder / name, run_of(name, tables, Faults()))
    write_whole({folder / "meta.yaml": yaml.safe_dump(meta, sort_keys=False)})
    return folder


def criticise(path: Path, output: Path, title: str, robot: Robot | None = None) -> Verdict | None:
    """Print what the critic says of a recording under a title, and return it; None where it refuses, which is said.

    robot: which it is, None: as the recording says.
    """
    print(f"\n## The critic: {title}")
    try:
        return cli.tell(Job(path, output / "criticism", robot=robot))
    except Error as error:
        print(f"refused: {error}")
        return None


def there(path: Path) -> Path:
    """Return the path. Raise Error where nothing is there."""
    if not path.exists():
        raise Error(f"{path}: is not there; docs/critic/real_data.md says where it is from")
    return path


def strangers(data: Path, name: str) -> Path:
    """Return the folder of a table that came as a recording already. Raise Error where it is not there."""
    beside = data.parent / "strangers/real" / name
    return beside if beside.exists() else there(data / name)
