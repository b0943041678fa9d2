# SPDX-License-Identifier: BSD-3-Clause
"""The critic: what a model gets wrong about a measured robot. pipeline.py tells the story.

What stands here is for programs of others and stays; the rooms behind it may change.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kurumaisu.critic.app.arrays import criticise_arrays
    from kurumaisu.critic.data.csv_reader import write_csv_run
    from kurumaisu.critic.data.meta import Meta
    from kurumaisu.critic.data.reading import read_recording
    from kurumaisu.critic.pipeline import criticise, write
    from kurumaisu.critic.values.recording import Recording
    from kurumaisu.critic.values.verdict import Verdict

__all__ = ["Meta", "Recording", "Verdict", "criticise", "criticise_arrays", "read_recording", "write", "write_csv_run"]

_ROOMS = {
    "Meta": "data.meta",
    "Recording": "values.recording",
    "Verdict": "values.verdict",
    "criticise": "pipeline",
    "criticise_arrays": "app.arrays",
    "read_recording": "data.reading",
    "write": "pipeline",
    "write_csv_run": "data.csv_reader",
}


def __getattr__(name: str) -> Any:
    """Return one of these names when it is asked for: who needs a type only does not wait for the whole critic."""
    if name not in _ROOMS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_ROOMS[name]}"), name)
