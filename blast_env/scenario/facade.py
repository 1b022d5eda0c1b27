"""Facades: which components stand in which bays of a structure's walls.

    [structures.facade]
    storey_m = 3.5
    glazing = "window_annealed_6"
    wall = "brick_215"

    [[structures.facade.parts]]         # other components in some of the bays
    walls = ["west"]
    storeys = [1]
    glazing = "window_laminated_12"

    [components.our_window]             # own components, beside those of the catalogue
    kind = "glazing"
    ...

No result of a blast depends on it, but what the blast does to the building.
"""

from collections.abc import Iterator, Mapping
from typing import Final

from blast_env.errors import BlastEnvError
from blast_env.response.components import Glazing, Wall, catalogue
from blast_env.response.facade import FilledBay, divide
from blast_env.scenario.problems import Problem, unknown_name
from blast_env.scenario.sections import AnyStructure, FacadeSection

MOST_BAYS: Final = 5_000
"""Of a scenario: a block of 20 storeys and 750 m of walls."""

Components = Mapping[str, Glazing | Wall]


def facade_bays(structure: AnyStructure, own: Components) -> tuple[FilledBay, ...]:
    """Return the bays of a structure with what stands in them; none without a facade.

    Args:
        structure: The structure; its facade names sound components.
        own: The scenario's own components.

    Raises:
        BlastEnvError: If a bay is empty, or a pane larger than its bay.
    """
    facade = structure.facade
    if facade is None or structure.height_m is None:
        return ()
    known = {**catalogue(), **own}
    bays = divide(
        structure.name,
        structure.rectangle_m,
        structure.height_m,
        structure.faces,
        facade.storey_m,
        facade.bay_m,
    )
    filled = []
    for bay in bays:
        chosen = {"glazing": facade.glazing, "wall": facade.wall}
        for part in facade.parts:
            if part.covers(bay):
                chosen = {key: getattr(part, key) or name for key, name in chosen.items()}
        glazing, wall = (None if name is None else known[name] for name in chosen.values())
        assert glazing is None or isinstance(glazing, Glazing)
        assert wall is None or isinstance(wall, Wall)
        filled.append(FilledBay(bay, glazing, wall))
    return tuple(filled)


def facade_problems(structures: Mapping[int, AnyStructure], own: Components) -> Iterator[Problem]:
    """Yield what is wrong with the facades of a scenario.

    Args:
        structures: The sound structures, by their index.
        own: The scenario's own components.
    """
    known = {**catalogue(), **own}
    bays = 0
    for index, structure in structures.items():
        facade = structure.facade
        if facade is None:
            continue
        where = f"structures[{index}].facade"
        if structure.height_m is None:
            yield Problem(where, "needs the structure's height_m: bays are storeys high")
            continue
        problems = list(_name_problems(facade, where, known))
        yield from problems
        if problems:
            continue
        try:
            bays += len(facade_bays(structure, own))
        except BlastEnvError as error:
            yield Problem(where, str(error))
    if bays > MOST_BAYS:
        yield Problem("structures", f"have {bays:,} bays in all, must be at most {MOST_BAYS:,}")


def _name_problems(facade: FacadeSection, where: str, known: Components) -> Iterator[Problem]:
    for key, name in facade.names():
        kind = Glazing if key.endswith("glazing") else Wall
        fitting = [each for each, component in known.items() if isinstance(component, kind)]
        if name not in fitting:
            yield Problem(f"{where}.{key}", unknown_name("component", name, fitting))
