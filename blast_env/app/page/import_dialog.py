"""The questions that a map or a drawing leaves open, and what came of it."""

from collections.abc import Callable
from typing import Any

from nicegui import run, ui

from blast_env.app.sources import imported_site
from blast_env.errors import BlastEnvError
from blast_env.importing.convert import ImportedSite
from blast_env.importing.options import ImportOptions
from blast_env.scenario import Scenario


def complain(error: BlastEnvError) -> None:
    """Show what is wrong, with all its lines, until it has been read."""
    with ui.dialog(value=True) as dialog, ui.card().classes("w-[560px] max-w-full"):
        ui.label("That does not work").style("font-weight: 600; font-size: 16px")
        ui.label(str(error)).style("white-space: pre-wrap; overflow-wrap: anywhere")
        ui.label("Nothing was changed; the design is as it was.").classes("be-quiet")
        ui.button("close", on_click=dialog.close).props("autofocus no-caps")


class ImportDialog:
    """Asks what a file does not say, imports it, and says by how much the site deviates.

    Args:
        name: Name of the file.
        content: What is in it.
        use: Takes the site, and the name of the file.
    """

    def __init__(self, name: str, content: bytes, use: Callable[[Scenario, str], None]) -> None:
        self._name = name
        self._content = content
        self._use = use
        with ui.dialog(value=True) as self._dialog, ui.card().classes("w-[560px] max-w-full gap-2"):
            ui.label(f"Import {name}").style("font-weight: 600; font-size: 16px")
            with ui.grid(columns=2).classes("w-full gap-2"):
                self._protect = _text("protected buildings (names, by commas)")
                self._near = _text("or the building nearest to x, y of the file")
                self._charges = _text("charges at x, y; x, y of the file (or its streets)")
                self._tnt = _number("mass of a charge (kg TNT)", 100.0)
                self._around = _number("build zone around what is protected (m)", 10.0)
                self._stock = _number("stock of modules", 20.0)
                self._wall = _number("height of modules (m)", 3.0)
                self._height = _number("height of buildings without one (m)", None)
                self._crs = _text("reference system (EPSG:...), if not in the file")
                self._units = _text("unit of a drawing (m, mm, ft)")
            self._wait = ui.label("importing...").classes("be-quiet")
            self._wait.visible = False
            with ui.row():
                ui.button("import", icon="map", on_click=self._import).props("no-caps").mark(
                    "import"
                )
                ui.button("cancel", on_click=self._dialog.close).props("flat no-caps")

    def _options(self) -> ImportOptions:
        """Return what was filled in.

        Raises:
            BlastEnvError: If it is out of bounds, or no place.
        """
        return ImportOptions(
            protect=tuple(
                part.strip() for part in _filled(self._protect).split(",") if part.strip()
            ),
            protect_near=next(iter(_places(_filled(self._near))), None),
            charge_at=tuple(_places(_filled(self._charges))),
            tnt_kg=float(self._tnt.value or 100.0),
            zone_around_m=self._around.value,
            stock=int(self._stock.value or 1),
            wall_height_m=float(self._wall.value or 3.0),
            default_height_m=self._height.value,
            crs=_filled(self._crs) or None,
            units=_filled(self._units) or None,
        )

    async def _import(self) -> None:
        self._wait.visible = True
        try:
            options = self._options()
            found = await run.io_bound(imported_site, self._name, self._content, options)
        except BlastEnvError as error:
            complain(error)
            return
        finally:
            self._wait.visible = False
        if found is not None:  # None: the server is being stopped
            self._dialog.close()
            self._report(found)

    def _report(self, found: ImportedSite) -> None:
        """Say by how much the site deviates from the map before it is taken."""
        with ui.dialog(value=True) as dialog, ui.card().classes("w-[560px] max-w-full gap-1"):
            site = found.scenario.site
            ui.label(f"{self._name}: {site.width_m:g} x {site.height_m:g} m").classes("be-head")
            for building in found.buildings:
                area, apart = building.deviation.area_share, building.deviation.outline_m
                name = f"{building.name}, protected" if building.protected else building.name
                ui.label(
                    f"{name}: its modules miss {area:.1%} of its area, {apart:.2f} m of its outline"
                ).classes("be-quiet")
            for note in found.notes:
                ui.label(f"note: {note}").classes("be-quiet")

            def take() -> None:
                dialog.close()
                self._use(found.scenario, self._name)

            with ui.row():
                ui.button("take this site", on_click=take).props("no-caps autofocus").mark(
                    "take-site"
                )
                ui.button("cancel", on_click=dialog.close).props("flat no-caps")


def _text(label: str) -> ui.input:
    return ui.input(label).props("dense outlined stack-label").classes("w-full")


def _number(label: str, value: float | None) -> ui.number:
    return ui.number(label, value=value).props("dense outlined stack-label").classes("w-full")


def _filled(element: Any) -> str:
    return str(element.value or "").strip()


def _places(text: str) -> list[tuple[float, float]]:
    """Return the places of a text, `x, y; x, y`.

    Raises:
        BlastEnvError: If it is none.
    """
    places = []
    for part in filter(None, (each.strip() for each in text.split(";"))):
        try:
            x, y = (float(value) for value in part.split(","))
        except ValueError:
            raise BlastEnvError(f"{part!r} is no place: write x, y; x, y") from None
        places.append((x, y))
    return places
