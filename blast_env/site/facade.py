"""Facades: the components in the bays of a structure's walls.

    [structures.facade]
    storey_m = 3.5
    glazing = "window_annealed_6"
    pane_width_m = 1.2                  # else the size of the component
    wall = "brick_215"

    [[structures.facade.parts]]         # other components in some of the bays
    walls = ["west"]
    storeys = [1]
    glazing = "window_laminated_12"

    [components.our_window]             # further components, beside those of the catalogue
    kind = "glazing"
    ...

Measures of the build zone may put stronger components in some bays at a cost (`Hardening`).
Loads do not depend on a facade; the response of the building does.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from blast_env.bays import Bay, bays_in, divide
from blast_env.errors import BlastEnvError
from blast_env.problems import Problem, unknown_name
from blast_env.response.components import Alternatives, FacadeBay, Glazing, Wall, catalogue
from blast_env.site.catalogue import Hardening
from blast_env.site.structures import AnyStructure, FacadeSection

MOST_BAYS: Final = 5_000
"""Most bays of a scenario: a block of 20 storeys and 750 m of walls."""

Components = Mapping[str, Glazing | Wall]


@dataclass(frozen=True)
class BayComponents:
    """A bay with the names of its components.

    Attributes:
        window: Component of its windows in the facade, which has their sizes and sills.
        glazing: Component of their glass.
        wall: Component of its wall panel.
        pane_m: Width and height of the panes, where the facade states them.
    """

    bay: Bay
    window: str | None
    glazing: str | None
    wall: str | None
    pane_m: tuple[float | None, float | None] = (None, None)

    def hardened(self, measures: Sequence[Hardening]) -> "BayComponents":
        """Return it with measures taken; the last one for a component counts."""
        glazing, wall = self.glazing, self.wall
        for measure in measures:
            if measure.covers(self.bay):
                glazing = glazing and (measure.glazing or glazing)
                wall = wall and (measure.wall or wall)
        return replace(self, glazing=glazing, wall=wall)

    def filled(self, known: Components) -> FacadeBay:
        """Return it with its components."""
        window, glass, wall = (
            None if name is None else known[name] for name in (self.window, self.glazing, self.wall)
        )
        assert window is None or isinstance(window, Glazing)
        assert wall is None or isinstance(wall, Wall)
        # 1. The window of the facade, with panes as large as stated; 2. other glass in it.
        stated = zip(("width_m", "height_m"), self.pane_m, strict=True)
        sides_m = {side: value for side, value in stated if value is not None}
        if window is not None and sides_m:
            window = window.model_copy(update=sides_m)
        if window is not None and self.glazing != self.window:
            assert isinstance(glass, Glazing)
            window = with_glass(window, glass)
        return FacadeBay(self.bay, window, wall)

    def alternatives(self, measures: Sequence[Hardening], known: Components) -> Alternatives:
        """Return its components, and those that measures would put there."""
        # Measures one by one: each component that one of them would put here.
        reached = [self.hardened([measure]) for measure in measures]
        glasses = dict.fromkeys(bay.glazing for bay in (self, *reached) if bay.glazing)
        walls = dict.fromkeys(bay.wall for bay in (self, *reached) if bay.wall)
        return Alternatives(
            self.bay.name,
            self.bay.structure,
            {name: replace(self, glazing=name, wall=None).filled(known) for name in glasses},
            {
                name: replace(self, window=None, glazing=None, wall=name).filled(known)
                for name in walls
            },
        )


def with_glass(window: Glazing, glass: Glazing) -> Glazing:
    """Return windows with other glass; sizes and sills stay."""
    kept = {name: getattr(window, name) for name in ("width_m", "height_m", "sill_m")}
    return glass.model_copy(update=kept)


def bay_count_problems(structures: Iterable[AnyStructure]) -> Iterator[Problem]:
    """Yield a problem if the facades have too many bays, which are counted but not made."""
    bays = sum(map(_bay_count, structures))
    if bays > MOST_BAYS:
        yield Problem("structures", f"have {bays:,} bays in all, must be at most {MOST_BAYS:,}")


def _bay_count(structure: AnyStructure) -> int:
    facade = structure.facade
    rise_m = (structure.height_m or 0.0) - structure.base_m
    if facade is None or rise_m <= 0.0:
        return 0
    walls = () if structure.footprint is None else structure.footprint.walls
    plan = structure.rectangle_m, rise_m, structure.faces
    return bays_in(*plan, facade.storey_m, facade.bay_m, walls, facade.storeys)


def named_bays(structure: AnyStructure) -> tuple[BayComponents, ...]:
    """Return the bays of a structure with the names of their components; none without a facade.

    Walls of a polygon that are shorter than half a bay have no windows.
    """
    facade = structure.facade
    if facade is None or structure.height_m is None:
        return ()
    bays = divide(
        structure.name,
        structure.rectangle_m,
        structure.height_m,
        structure.faces,
        facade.storey_m,
        facade.bay_m,
        structure.base_m,
        () if structure.footprint is None else structure.footprint.walls,
        facade.storeys,
    )
    named = []
    for bay in bays:
        glazing, wall = facade.glazing, facade.wall
        # Of several parts on a bay the last one counts, component by component.
        for part in facade.parts:
            if part.covers(bay):
                glazing, wall = part.glazing or glazing, part.wall or wall
        if bay.line is not None and bay.width_m < 0.5 * facade.bay_m:
            glazing = None
        if glazing or wall or bay.line is None:
            pane_m = facade.pane_width_m, facade.pane_height_m
            named.append(BayComponents(bay, glazing, glazing, wall, pane_m))
    return tuple(named)


def facade_problems(structures: Iterable[AnyStructure], own: Components) -> Iterator[Problem]:
    """Yield the problems of the facades of a scenario without `bay_count_problems`.

    Args:
        own: The components that the scenario defines.
    """
    for index, structure in enumerate(structures):
        facade = structure.facade
        if facade is None:
            continue
        known = {**catalogue(), **own}  # here, because sites without facades do without it
        where = f"structures[{index}].facade"
        if structure.height_m is None:
            yield Problem(where, "needs the structure's height_m: bays are storeys high")
            continue
        problems = list(_name_problems(facade, where, known))
        yield from problems
        if problems:
            continue
        try:
            for bay in named_bays(structure):
                bay.filled(known)
        except BlastEnvError as error:
            yield Problem(where, str(error))


def hardening_problems(
    structures: Sequence[AnyStructure], own: Components, measures: Sequence[Hardening]
) -> Iterator[Problem]:
    """Yield the problems of the measures that harden facades.

    Args:
        own: The components that the scenario defines.
    """
    known = {**catalogue(), **own}
    names = [structure.name for structure in structures]
    bays = [bay for structure in structures for bay in named_bays(structure)]
    for index, measure in enumerate(measures):
        where = f"build_zone.hardening[{index}]"
        unknown = {i: name for i, name in enumerate(measure.structures or ()) if name not in names}
        for place, name in unknown.items():
            problem = unknown_name("structure", name, names)
            yield Problem(f"{where}.structures[{place}]", problem)
        if unknown:
            continue
        covered = [bay for bay in bays if measure.covers(bay.bay)]
        for key, what in (("glazing", "windows"), ("wall", "a wall panel")):
            name = getattr(measure, key)
            if name is None:
                continue
            problems = list(_kind_problem(f"{where}.{key}", name, known))
            yield from problems
            if not problems and all(getattr(bay, key) is None for bay in covered):
                yield Problem(where, f"{measure.name!r} covers no bay with {what}")


def _kind_problem(where: str, name: str, known: Components) -> Iterator[Problem]:
    """Yield a problem if a name is not that of a component of the key's kind."""
    kind = Glazing if where.endswith("glazing") else Wall
    fitting = [item for item, component in known.items() if isinstance(component, kind)]
    if name not in fitting:
        yield Problem(where, unknown_name("component", name, fitting))


def _name_problems(facade: FacadeSection, where: str, known: Components) -> Iterator[Problem]:
    for key, name in facade.names():
        yield from _kind_problem(f"{where}.{key}", name, known)
