# SPDX-License-Identifier: BSD-3-Clause
"""verdict.json: what is written is valid, and says all."""

import json
import math
from dataclasses import asdict, replace

import jsonschema
import pytest
from recordings import PACKAGE
from stories import full_verdict

from kurumaisu.critic.values.verdict import Cause, Verdict, to_json, verdict_text
from kurumaisu.errors import Error


def test_a_verdict_is_written_as_it_is():
    for verdict in (full_verdict(), Verdict("none"), Verdict("invalid_data", problems=("a clock jumps",))):
        assert json.loads(verdict_text(verdict)) == {"schema": 1, **json.loads(json.dumps(asdict(verdict)))}


def test_the_schema_is_a_schema_and_the_file_has_the_contracts_fields():
    schema = json.loads((PACKAGE / "src/kurumaisu/critic/values/verdict.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    content = json.loads(verdict_text(full_verdict()))
    assert content["schema"] == 1
    assert content["causes"][0] == {
        "id": "base.lag_w",
        "p": 0.98,
        "parameters": {"tau": {"estimate": 0.2104, "lo90": 0.19, "hi90": 0.23, "unit": "s"}},
        "gain_nats": 41.0,
    }
    assert content["confounded"] == [["base.cross_w_to_v", "base.marker_y"]]
    assert content["gain"]["log_density_per_sample"]["gain"] == 0.37
    assert content["next_experiment"]["separates"] == ["base.lag_w", "base.delay"]


def cause(**changes):
    return replace(full_verdict().causes[0], **changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"causes": (cause(gain_nats=math.nan),)}, r"causes\.0\.gain_nats: must be a finite number: nan"),
        ({"causes": (cause(gain_nats=math.inf),)}, r"causes\.0\.gain_nats: must be a finite number: inf"),
        ({"causes": (cause(p=1.2),)}, r"causes\.0\.p: 1\.2 is greater than the maximum"),
        ({"causes": (cause(p=0.85),)}, r"causes\.0\.p: 0\.85 is less than the minimum of 0\.9"),
        ({"causes": (cause(id="lag"),)}, r"causes\.0\.id: 'lag' does not match"),
        ({"causes": ()}, "causes: "),
        ({"verdict": "none"}, "causes: .* is too long"),
        ({"verdict": "perhaps"}, "verdict: 'perhaps' is not one of"),
        ({"verdict": "invalid_data", "problems": (), "causes": ()}, "problems: "),
        ({"confounded": (("base.gain_v",),)}, r"confounded\.0: .* is too short"),
        ({"verdict": "unknown", "unknown": ()}, "unknown: "),
    ],
)
def test_what_makes_no_sense_is_refused(changes, message):
    with pytest.raises(Error, match=f"verdict: {message}"):
        verdict_text(replace(full_verdict(), **changes))


def test_an_interval_with_its_ends_swapped_is_refused():
    estimate = replace(full_verdict().causes[0].parameters["tau"], lo90=0.3)
    with pytest.raises(Error, match=r"causes\.0\.parameters\.tau: lo90 0\.3 is above hi90 0\.23"):
        to_json(replace(full_verdict(), causes=(Cause("base.lag_w", 0.98, {"tau": estimate}, 41.0),)))
