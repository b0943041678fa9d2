# SPDX-License-Identifier: BSD-3-Clause
"""The folder that saved states are in: nothing outside of it is read or written, and no file that is no state."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from kurumaisu.bounded_files import MOST_STATE, read_bytes
from kurumaisu.errors import Error, told
from kurumaisu.sim.robots.state import MARK
from kurumaisu.whole_files import write_whole


@dataclass(frozen=True)
class StateFolder:
    """States by the names of their files, which may be in folders below. folder: made when the first one is saved."""

    folder: Path

    def write(self, name: str, saved: bytes) -> Path:
        """Write a state and return its path. Raise Error for a name that leads elsewhere, or to what is no state."""
        path = self._path(name)
        if path.exists() and not read_bytes(path, MOST_STATE).startswith(MARK):
            raise Error(f"{path}: is there already and is no saved state: it stays as it is")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise Error(f"{path.parent}: {error.strerror}") from error
        write_whole({path: saved})
        return path

    def read(self, name: str) -> bytes:
        """Return what is in a file. Raise Error for a name that leads elsewhere, or a file that cannot be read."""
        return read_bytes(self._path(name), MOST_STATE)

    def _path(self, name: str) -> Path:
        try:
            folder = self.folder.expanduser().resolve()
            path = (folder / name).resolve()
        except (OSError, ValueError, RuntimeError) as error:  # a null byte, a loop of links
            raise Error(f"{told(name)}: is no name of a file: {error}") from error
        if folder not in path.parents:
            raise Error(f"{told(name)}: must be a file in {folder}, the folder of saved states (parameter `states`)")
        return path
