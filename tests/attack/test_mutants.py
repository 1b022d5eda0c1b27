"""Wrong files that are wrong, of many kinds, and the same in every run."""

from tests.attack.mutants import mutants

SAMPLES = (b'name = "wall"\nside_m = 0.5\nplaces = [[1, 2], [3, 4]]\n', b'{"a": 1.5, "b": null}')
COUNT = 500


def test_a_seed_decides_all_of_them() -> None:
    first, again = (list(mutants(SAMPLES, COUNT, seed=7)) for _ in range(2))
    assert first == again
    assert first != list(mutants(SAMPLES, COUNT, seed=8))
    assert first[:100] == list(mutants(SAMPLES, 100, seed=7))


def test_nearly_all_are_others_than_what_they_are_made_from() -> None:
    made = list(mutants(SAMPLES, COUNT))
    assert len(made) == COUNT
    assert sum(each not in SAMPLES for each in made) > 0.9 * COUNT
    assert len(set(made)) > 0.8 * COUNT


def test_they_are_wrong_in_many_ways() -> None:
    made = list(mutants(SAMPLES, COUNT))
    assert min(map(len, made)) == 0
    assert max(map(len, made)) > 1000
    for sign in (b"1e308", b"nan", b"\x1b", b"\xff\xfe", b"[" * 1000, b"9" * 400):
        assert any(sign in each for each in made)
