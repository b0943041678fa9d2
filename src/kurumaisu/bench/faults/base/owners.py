# SPDX-License-Identifier: BSD-3-Clause
"""Faults 6 and 16: who else wants the D/A board or its guard, and files that describe it wrongly."""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Callable, Mapping
from typing import Any

import yaml

from kurumaisu import children
from kurumaisu.bench.faults.base.cases import Case, Seen
from kurumaisu.bench.faults.base.chain import Chain, Setup
from kurumaisu.bench.guard_rig import changed
from kurumaisu.bench.processes import PATIENCE, program
from kurumaisu.whole_files import write_whole

_SHORT = 0.5  # [V] a device's clamp that is narrower than the model's band
_WATCH = 0.4  # [s]


def second_guard(stage: Chain, seen: Seen) -> None:
    """Start a second guard on the same device."""
    stage.drive()
    stage.mark()
    code, said = _guard(stage, {"socket": str(stage.rig.folder / "another.sock")}, {})
    seen.check(code is None or code != 0, f"exit status {code}")
    seen.check("DAC_IN_USE" in said, said)
    seen.undisturbed(stage)
    seen.note("DAC_IN_USE; the first one's voltages as before")


def _second_program(stage: Chain, seen: Seen) -> None:
    stage.drive()
    stage.mark()
    command = [program("set_voltages"), str(stage.rig.device), "0.5", "0", "2.5"]
    done = subprocess.run(command, input="\n", capture_output=True, text=True, timeout=PATIENCE, check=False)
    seen.check(done.returncode != 0, "exit status 0")
    seen.check("DAC_IN_USE" in done.stderr, done.stderr)
    seen.undisturbed(stage)
    seen.note(f"exit status {done.returncode}, DAC_IN_USE; the guard's voltages as before")


def _second_client(stage: Chain, seen: Seen) -> None:
    stage.drive()
    stage.mark()
    name = "/second/base_node"
    stage.graph.set_parameter(name, stage.values)
    begin = time.monotonic()
    log = (stage.rig.folder / "second.log").open("a")
    second = stage.graph.run([program("base_node"), "__ns:=/second"], stdout=log, stderr=log)
    so = lambda e: e["name"].startswith("second") and "another client" in e["message"]  # noqa: E731
    seen.note(f"diagnostics: {stage.peer.wait('diagnostics', so, begin)['message']}")
    seen.said(stage, "GUARD_BUSY")
    second.send_signal(signal.SIGTERM)
    second.wait(PATIENCE)
    seen.undisturbed(stage)


def _guard(stage: Chain, guard: Mapping[str, Any], device: Mapping[str, Any]) -> tuple[int | None, str]:
    """Run a guard with changed files for a moment; return its exit status, None if it went on, and what it said."""
    paths = []
    for name, tree, changes in (("guard", stage.guard_values, guard), ("device", stage.device_values, device)):
        paths.append(stage.rig.folder / f"another_{name}.yaml")
        write_whole({paths[-1]: yaml.safe_dump(changed(tree, changes))})
    command = [program("guard"), str(paths[1]), str(paths[0])]
    with children.start(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            return process.wait(1.0), process.communicate()[1]
        except subprocess.TimeoutExpired:
            process.terminate()
            return None, process.communicate()[1]


def _bad_file(changes: Mapping[str, Any], words: str) -> Callable[[Chain, Seen], None]:
    def play(stage: Chain, seen: Seen) -> None:
        code, said = _guard(stage, {}, changes)
        seen.check(code == 1, f"exit status {code}")
        seen.check(words in said and "another_device.yaml" in said, said)
        seen.note(f"exit status {code}: {said.splitlines()[-1].split('another_')[-1]}")

    return play


def _narrow_device(stage: Chain, seen: Seen) -> None:
    stage.drive(0.2, 0.0)
    stage.peer.say(1.0, 0.0)
    stage.peer.wait("voltages", lambda e: e["volts"][0] > _SHORT - 0.002, stage.begun)
    time.sleep(_WATCH)
    volts = max(change.volts[0] for change in stage.changes() if change.volts)
    seen.check(volts <= _SHORT, f"{volts:.3f} V")
    told = stage.peer.heard("voltages")[-1]
    rate = (_SHORT - stage.law.translation.positive.intercept) / stage.law.translation.positive.slope
    seen.check(abs(told["v"] - rate) < 0.002, f"base_node tells {told['v']:.3f} m/s")
    seen.note(f"{volts:.3f} V; base_node tells {told['v']:.3f} m/s")


_ALONE = "refused; the first owner is not disturbed"

CASES = (
    Case("6", "two owners of the port", "a second guard", _ALONE, second_guard),
    Case("6", "two owners of the port", "set_voltages", _ALONE, _second_program),
    Case("6", "two clients of the guard", "a second base_node", _ALONE, _second_client),
    Case(
        "16",
        "template: code beyond bits",
        "bits: 10, codes to 4095",
        "refused at the start",
        _bad_file({"bits": 10}, "must be at most 1023"),
    ),
    Case(
        "16",
        "template: code beyond its digits",
        "W{ch}{code:02X}",
        "refused at the start",
        _bad_file({"write/send": "W{ch}{code:02X}", "write/expect": "OK {ch}{code:02X}"}, "does not fit"),
    ),
    Case(
        "16",
        "template: clamp beyond the codes",
        "volt to 3 V",
        "refused at the start",
        _bad_file({"channels/translation/volt/max": 3.0}, "volt reaches from"),
    ),
    Case(
        "16",
        "voltage beyond the device's clamp",
        f"1 m/s asked for, the device's clamp ends at {_SHORT} V",
        "clamped; odometry and `voltages` tell what is held",
        _narrow_device,
        Setup(device={"channels/translation/volt/max": _SHORT}),
    ),
)
