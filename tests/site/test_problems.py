import pickle

import pytest
from pydantic import ValidationError

from blast_env.problems import MAX_PROBLEMS
from blast_env.site import Problem, Scenario, ScenarioError
from tests.site.documents import (
    KeyPath,
    changed,
    full_document,
    lines_for,
    minimal_document,
    without,
)

LEAST = "Input should be greater than or equal to"


@pytest.mark.parametrize(
    ("path", "value", "line"),
    [
        (("structures", 0, "rows"), 2.0, "structures[0].rows: is 2.0: Input should be a valid int"),
        (("site", "width_m"), True, "site.width_m: is true: Input should be a valid number"),
        (("site", "width_m"), 16**300, "site.width_m: is an integer of about 362 digits: Input"),
        (("structures",), {}, "structures: is a table: Input should be a valid tuple"),
        (("structures", 1, "name"), "a b", "structures[1].name: is 'a b', must be 1 to 40 letter"),
        (("structures", 1, "kind"), "ConcretSquare", "did you mean 'ConcreteSquare'?"),
        (("schema_version",), 1, "schema_version: is 1, must be 2, the version of this release"),
        (
            ("simulation", "overrides", "air", "jitter"),
            1.5,
            "simulation.overrides.air.jitter: is 1.5: Input should be less than or equal to 1",
        ),
        (
            ("simulation", "overrides", "explosive", "fan_phase"),
            "randm",
            "is 'randm': Input should be 'fixed' or 'random', did you mean 'random'?",
        ),
    ],
)
def test_bad_value_is_named_with_its_bound(path: KeyPath, value: object, line: str) -> None:
    lines = lines_for(changed(full_document(), path, value))
    assert any(line in case for case in lines), lines
    assert all(line.startswith("f.toml: ") for line in lines)


def test_misspelt_key_of_the_kind_gives_both_lines() -> None:
    document = without(full_document(), ("structures", 0, "kind"))
    document = changed(document, ("structures", 0, "knid"), "ModularObstacle")
    assert lines_for(document) == [
        "f.toml: structures[0].knid: unknown key, did you mean 'kind'?",
        "f.toml: structures[0].kind: missing, must be 'ModularObstacle', 'ConcreteSquare' or"
        " 'polygon'",
    ]


def test_bad_override_hides_neither_the_preset_nor_other_groups() -> None:
    document = changed(full_document(), ("simulation", "preset"), "none")
    document = changed(document, ("simulation", "overrides", "air"), 3)
    document = changed(document, ("simulation", "overrides", "explosive"), {"mass": 0})
    keys = [line.split(": ")[1] for line in lines_for(document)]
    assert keys == [
        "simulation.preset",
        "simulation.overrides.air",
        "simulation.overrides.explosive.mass",
    ]


def test_one_bad_structure_does_not_make_the_list_count_as_too_short() -> None:
    lines = lines_for(changed(minimal_document(), ("structures", 0, "side_modules"), 0))
    assert lines == [f"f.toml: structures[0].side_modules: is 0: {LEAST} 1"]


def test_long_values_and_keys_are_shortened() -> None:
    document = changed(minimal_document(), ("site", "width_m"), "x" * 10_000)
    document["y" * 10_000] = 1
    assert all(len(line) < 300 for line in lines_for(document))


def test_countless_problems_are_counted() -> None:
    document = {**minimal_document(), **{f"zz{number}": 0 for number in range(MAX_PROBLEMS + 5)}}
    lines = lines_for(document)
    assert len(lines) == MAX_PROBLEMS + 1
    assert "f.toml: 5 more problems" in lines


def test_models_made_in_code_are_checked_as_well() -> None:
    with pytest.raises(ValidationError, match="did you mean 'ballistic'"):
        Scenario.model_validate({**minimal_document(), "simulation": {"preset": "balistic"}})


def test_error_survives_pickling() -> None:
    error = ScenarioError("f.toml", [Problem("site", "missing"), Problem("", "is odd")])
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is ScenarioError
    assert (copy.source, copy.problems, str(copy)) == (error.source, error.problems, str(error))
    assert str(copy) == "f.toml: site: missing\nf.toml: is odd"
