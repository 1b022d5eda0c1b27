"""Reading of building models in IFC: walls, slabs, roofs, storeys and windows."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
import shapely

from blast_env.errors import BlastEnvError, import_extra, named
from blast_env.io.importing.bodies import Faces
from blast_env.io.importing.ifc_building import Building, Solid, is_window
from blast_env.io.importing.ledger import Fate, Ledger
from blast_env.io.importing.site_map import (
    MOST_FEATURES,
    MapFeature,
    SiteMap,
    Tags,
    check_count,
    errors_of,
)

with import_extra("ifc", "building models"):
    import ifcopenshell
    import ifcopenshell.geom
    from ifcopenshell.util import element as relations
    from ifcopenshell.util import placement
    from ifcopenshell.util.unit import calculate_unit_scale

_WALLS: Final = ("IfcWall",)
_SHAPED: Final = (*_WALLS, "IfcSlab", "IfcRoof", "IfcCurtainWall", "IfcPlate", "IfcWindow")
"""What a building is made of."""

_POSTS: Final = ("IfcColumn", "IfcMember", "IfcDoor", "IfcPile", "IfcFooting")
"""What else may stand on the ground below a building, or close a gap of its walls."""

PIECE_SET: Final = "BlastEnv_Barrier"
"""Set of the properties of a piece of a barrier that no set of buildingSMART has.

An `IfcBuildingElementProxy` may be anything, a tree or the ground. With this set it is a piece.
"""

STRUCTURE_SET: Final = "BlastEnv_Structure"
"""Set of the properties of a structure that blast-env has exported: a block, read as it is."""

_PASSED: Final = ("IfcFeatureElement", "IfcSpace", "IfcSpatialZone", "IfcAnnotation", "IfcGrid")
"""Holes in walls, which are in their shapes, rooms and drawings."""

_PARTS: Final = "parts of a building"
_ASSEMBLIES: Final = "assemblies, read by their parts"
_LEAST_WALL_M: Final = 0.5
_GLASS: Final = "glass, which IFC does not state"
_NORTH: Final = "north of the model, which the import does not turn to"
_ON_EARTH: Final = "place of the model on the Earth, which is not read"
_STRAIGHT: Final = 1e-6
_NOWHERE: Final = shapely.Point()


def read_ifc(site_map: SiteMap) -> None:
    """Read the buildings of an IFC model, in metres, each with its height, storeys and windows.

    A building is what its walls, slabs and roofs cover, in parts of different heights. Walls of
    the site stand for themselves. Everything else is on the ledger.
    """
    path, options = site_map.path, site_map.options
    options.refuse("IFC, which states its unit", "units", "height_unit")
    options.refuse("IFC, which is in metres of its own", "crs")
    with errors_of("ifcopenshell", path, "IFC"):
        model = ifcopenshell.open(str(path))
        if not any(unit.UnitType == "LENGTHUNIT" for unit in _units(model)):
            raise BlastEnvError(f"{path}: states no unit of length, must state one")
        if not model.by_type("IfcBuilding"):
            raise BlastEnvError(f"{path}: has no IfcBuilding")
        reader = _Model(site_map, model)
        reader.read()
        _note_place(model, site_map.ledger, path.name)


def _units(model: Any) -> list[Any]:
    """Return the named units of a project."""
    assigned = [project.UnitsInContext for project in model.by_type("IfcProject")]
    units = [unit for chosen in assigned if chosen is not None for unit in chosen.Units or ()]
    return [unit for unit in units if unit.is_a("IfcNamedUnit")]


def _note_place(model: Any, ledger: Ledger, name: str) -> None:
    """Enter the direction of north and the place on the Earth, which an import does not use."""
    for context in model.by_type("IfcGeometricRepresentationContext", include_subtypes=False):
        ratios = context.TrueNorth and context.TrueNorth.DirectionRatios
        if ratios and len(ratios) > 1 and abs(ratios[0]) > _STRAIGHT * abs(ratios[1]):
            angle_deg = float(np.degrees(np.arctan2(ratios[0], ratios[1])))
            detail = f"{angle_deg:.1f} degrees clockwise from its y axis"
            ledger.add(Fate.NOTED, _NORTH, name, detail=detail)
    kinds = () if model.schema == "IFC2X3" else ("IfcCoordinateOperation",)
    if any(model.by_type(kind) for kind in kinds) or any(
        place.RefLatitude or place.RefLongitude for place in model.by_type("IfcSite")
    ):
        ledger.add(Fate.NOTED, _ON_EARTH, name)


class _Model:
    """The elements of a model by their buildings.

    Args:
        site_map: The map that they are added to.
        model: The model.
    """

    def __init__(self, site_map: SiteMap, model: Any) -> None:
        self._map, self._model = site_map, model
        self._scale = calculate_unit_scale(model)
        self._buildings = model.by_type("IfcBuilding")
        self._products = [product for product in model.by_type("IfcProduct") if _is_object(product)]
        check_count(site_map.path, len(self._products), MOST_FEATURES, "outlines and lines")
        ids = Counter(product.GlobalId for product in model.by_type("IfcProduct"))
        self._twice = {guid for guid, count in ids.items() if count > 1}

    def read(self) -> None:
        """Add the buildings, the walls of the site, and all else with the reason."""
        # 1. What has a shape, with windows that are made of frames and panes.
        windows = [
            product for product in self._model.by_type("IfcWindow") if not product.Representation
        ]
        panes = {part.id(): part for product in windows for part in _parts_of(product)}
        chosen = {
            product.id(): product
            for product in self._products
            if _is_any(product, (*_SHAPED, *_POSTS)) or _is_piece(product)
        }
        solids = {
            product.element.id(): product for product in self._solids([*(chosen | panes).values()])
        }
        # 2. Whose it is: by storey and building, else the only building there is.
        owners = {product.id(): self._owner(product) for product in self._products}
        if not any(owners[key] for key in solids) and len(self._buildings) == 1:
            owners = dict.fromkeys(owners, self._buildings[0])  # all hangs at the site
        used = set(self._join(windows, solids))
        # 3. Each building from its own; the rest of the site on the lowest of their grounds.
        reasons, grounds_m = dict[int, str](), list[float]()
        for entity in self._buildings:
            own = [product for key, product in solids.items() if owners[key] == entity]
            blocks = [solid for solid in own if _block_of(solid)]
            if blocks:
                used |= self._add_blocks(entity, blocks)
                grounds_m.append(self._placed_m(entity))
                own = [solid for solid in own if solid not in blocks]
                if not own:
                    continue
            building = self._building(entity, own)
            grounds_m.append(building.ground_m)
            used |= self._add(building)
            reasons |= {product.element.id(): building.reason(product) for product in own}
        lonely = [product for key, product in solids.items() if owners[key] is None]
        used |= self._add_of_site(lonely, min(grounds_m, default=0.0))
        for product in self._products:
            # 4. Nothing is lost in silence: all that is not read is on the ledger.
            if product.id() not in used:
                self._leave(product, solids.get(product.id()), reasons.get(product.id(), ""))

    def _solids(self, elements: list[Any]) -> Iterator[Solid]:
        """Yield the elements that have a shape."""
        elements = [element for element in elements if element.Representation]
        if not elements:
            return
        settings = ifcopenshell.geom.settings()
        # Shapes come in metres, whatever the unit of the file.
        settings.set("use-world-coords", True)
        iterator = ifcopenshell.geom.iterator(settings, self._model, include=elements)
        more = iterator.initialize()
        while more:
            shape = iterator.get()
            corners = np.reshape(shape.geometry.verts, (-1, 3))
            triangles = corners[np.reshape(shape.geometry.faces, (-1, 3))]
            if len(triangles) and np.isfinite(triangles).all():
                element = self._model.by_id(shape.id)
                is_post = not (_is_any(element, _SHAPED) or _is_piece(element))
                yield Solid(element, self._place(element), is_post, Faces.of_triangles(triangles))
            more = iterator.next()

    def _join(self, windows: list[Any], solids: dict[int, Solid]) -> Iterator[int]:
        """Give windows without a shape those of their frames and panes; yield the ids of these."""
        for window in windows:
            parts = [part.id() for part in _parts_of(window) if part.id() in solids]
            if not parts:
                continue
            place = self._place(window)
            own = [solids.pop(part) for part in parts]
            faces = Faces.joined(part.faces for part in own)
            solids[window.id()] = Solid(window, place, is_post=False, faces=faces)
            for part in own:
                self._map.ledger.add(
                    Fate.MERGED, "parts of windows", part.place, detail=f"of {place}"
                )
            yield from parts

    def _owner(self, element: Any) -> Any:
        """Return the building that holds an element, the only one those that nothing holds.

        What the site holds belongs to none: `None`.
        """
        found = relations.get_container(element) or _container_of_wall(element)
        if found is None:
            return self._buildings[0] if len(self._buildings) == 1 else None
        while found is not None and not found.is_a("IfcBuilding"):
            found = relations.get_aggregate(found)
        return found

    def _building(self, entity: Any, solids: list[Solid]) -> Building:
        # Heights are stated in the unit of the file, at four places that need not agree.
        base_m = self._placed_m(entity)
        storeys = [
            storey
            for storey in self._model.by_type("IfcBuildingStorey")
            if self._owner_of_storey(storey) == entity
        ]
        storeys_m = [self._placed_m(storey) for storey in storeys]
        stated_m = [base_m + self._scale * float(storey.Elevation or 0.0) for storey in storeys]
        if len({*stated_m}) > len({*storeys_m}):  # all storeys are placed at one height
            storeys_m = stated_m
        stated = [
            ("its ElevationOfRefHeight", entity.ElevationOfRefHeight),
            ("its ElevationOfTerrain", entity.ElevationOfTerrain),
        ]
        site = relations.get_aggregate(entity)
        if site is not None and site.is_a("IfcSite"):
            stated.append(("the RefElevation of the site", site.RefElevation))
        heights_m = [
            (words, self._scale * float(value)) for words, value in stated if value is not None
        ]
        return Building(
            place=self._place(entity),
            name=str(entity.Name or entity.LongName or ""),
            solids=tuple(solids),
            storeys_m={storey.id(): at_m for storey, at_m in zip(storeys, storeys_m, strict=True)},
            placed_m=base_m,
            stated_m=tuple(heights_m),
            options=self._map.options,
        )

    def _owner_of_storey(self, storey: Any) -> Any:
        found = relations.get_aggregate(storey)
        while found is not None and not found.is_a("IfcBuilding"):
            found = relations.get_aggregate(found)
        return self._buildings[0] if found is None and len(self._buildings) == 1 else found

    def _placed_m(self, product: Any) -> float:
        """Return the height at which a product is placed, m."""
        if product.ObjectPlacement is None:
            return 0.0
        matrix = placement.get_local_placement(product.ObjectPlacement)
        return float(self._scale * matrix[2, 3])

    def _add(self, building: Building) -> set[int]:
        """Add a building; return the ids of its elements that are read."""
        ledger, place = self._map.ledger, building.place
        parts = building.parts
        if not parts:
            tags: Tags = {"building": "yes", "name": building.name}
            self._map.add(MapFeature(_NOWHERE, tags, place, "buildings without walls"))
            return set()
        for part in parts:
            self._map.add(part)
        building.note(ledger)
        if any(part.facade for part in parts):
            ledger.add(Fate.GUESSED, _GLASS, place, detail="annealed 6 mm")
        read = building.read
        for solid, kind in read:
            ledger.add(Fate.MERGED, kind or _PARTS, solid.place, detail=f"of {place}")
        return {solid.element.id() for solid, _ in read}

    def _add_blocks(self, entity: Any, blocks: Sequence[Solid]) -> set[int]:
        """Add the structures of an exported building, low ones and terraces too; return the ids."""
        ground_m, whole = self._placed_m(entity), self._place(entity)
        for solid in blocks:
            own = _block_of(solid)
            tags: Tags = {
                "building": "yes",
                "name": str(solid.element.Name or entity.Name or ""),
                "protected": bool(own.get("Protected")),
                "carries": bool(own.get("Carries")),
            }
            self._map.add(
                MapFeature(
                    solid.shadow,
                    tags,
                    solid.place,
                    extent_m=(solid.low_m, solid.high_m),
                    part_of=whole if len(blocks) > 1 else "",
                    ground_m=ground_m,
                )
            )
        return {solid.element.id() for solid in blocks}

    def _add_of_site(self, solids: Sequence[Solid], ground_m: float) -> set[int]:
        """Add what stands on the site outside of buildings; return the ids of what is read."""
        used = set()
        for solid in solids:
            if solid.is_post or is_window(solid):
                continue
            is_wall = _is_any(solid.element, _WALLS) or _is_piece(solid.element)
            least_m, kind = (_LEAST_WALL_M, "wall") if is_wall else (None, "yes")
            for part in solid.parts(ground_m, self._map.options.least_area_m2, least_m):
                tags: Tags = {"building": kind, "name": str(solid.element.Name or "")}
                extent_m = part.base_m - ground_m, part.top_m - ground_m
                self._map.add(
                    MapFeature(
                        part.outline, tags, solid.place, extent_m=extent_m, part_of=solid.place
                    )
                )
                used.add(solid.element.id())
        return used

    def _leave(self, element: Any, solid: Solid | None, reason: str) -> None:
        """Add an element that is not read, with the reason."""
        place, kind = self._place(element), element.is_a()
        if _is_any(element, _PASSED):
            self._map.ledger.add(Fate.PASSED, f"{kind} of the model", place)
        elif not element.Representation and getattr(element, "IsDecomposedBy", None):
            self._map.ledger.add(Fate.MERGED, _ASSEMBLIES, place)
        else:
            reason = reason or "of buildings"
            if solid is None and _is_any(element, _SHAPED):
                reason = "without a shape"
            tags: Tags = {"building": "part"}
            self._map.add(MapFeature(_NOWHERE, tags, place, f"{kind} {reason}"))

    def _place(self, element: Any) -> str:
        """Return the place of an element: its class and id, with its number if two have the id."""
        text = f"{element.is_a()} {named(str(element.GlobalId))}"
        return f"{text} #{element.id()}" if element.GlobalId in self._twice else text


def _is_object(product: Any) -> bool:
    """Return whether a product is an object of the model, not only a level or a mark."""
    if product.is_a("IfcBuilding"):
        return False
    return bool(product.is_a("IfcElement") or product.Representation)


def _is_any(element: Any, kinds: Sequence[str]) -> bool:
    return any(map(element.is_a, kinds))


def _is_piece(element: Any) -> bool:
    """Return whether an element is a piece of a barrier that is no wall."""
    is_proxy = element.is_a("IfcBuildingElementProxy")
    return bool(is_proxy and relations.get_pset(element, PIECE_SET))


def _block_of(solid: Solid) -> dict[str, Any]:
    """Return the properties of a structure that blast-env has exported; empty for others."""
    return relations.get_pset(solid.element, STRUCTURE_SET) or {}


def _parts_of(element: Any) -> list[Any]:
    """Return the elements of which one is made, if any."""
    links = getattr(element, "IsDecomposedBy", None) or ()
    return [part for link in links for part in link.RelatedObjects if part.is_a("IfcElement")]


def _container_of_wall(element: Any) -> Any:
    """Return what holds the wall in which a window or door is."""
    for fills in getattr(element, "FillsVoids", None) or ():
        for voids in fills.RelatingOpeningElement.VoidsElements or ():
            return relations.get_container(voids.RelatingBuildingElement)
    return None
