"""Uploaded files: read in a separate process, with a dialog for maps and one for errors."""

import re
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, TypeVar

from nicegui import events, run, ui
from nicegui.elements.upload_files import FileUpload

from blast_env.app.guard import MOST_BYTES
from blast_env.app.jobs import Workers
from blast_env.app.page.numbers import NumberField
from blast_env.app.plan import SketchView
from blast_env.app.sources import MAPS, SITES, imported_site, is_map, map_sketch, site_of_file
from blast_env.errors import BlastEnvError
from blast_env.files import scratch_folder
from blast_env.io.importing.convert import SiteImport
from blast_env.io.importing.options import ImportOptions
from blast_env.reading import Reading
from blast_env.site import Scenario
from blast_env.values import plain_number

Read = TypeVar("Read")
_MOST_LETTERS: Final = 100
_AROUND: Final = "build zone around the protected buildings (m)"


def complain(error: BlastEnvError) -> None:
    """Show an error, with all its lines, until the user closes it."""
    with ui.dialog(value=True) as dialog, ui.card().classes("w-[560px] max-w-full"):
        ui.label("This could not be done").style("font-weight: 600; font-size: 16px")
        ui.label(str(error)).style("white-space: pre-wrap; overflow-wrap: anywhere")
        ui.label("Nothing was changed; the design is as it was.").classes("be-quiet")
        ui.button("close", on_click=dialog.close).props("autofocus no-caps")


@contextmanager
def complaints() -> Iterator[None]:
    """End the block at an error of the user, which is shown."""
    try:
        yield
    except BlastEnvError as error:
        complain(error)


async def read_upload(
    workers: Workers, file: FileUpload, read: Callable[..., Read], *arguments: Any
) -> Read | None:
    """Return the content of a file, read in a separate process, which ends with the page.

    Args:
        workers: The processes; they limit the files read at the same time.
        read: Reads it, from a path; it, its arguments and its result must pickle.
        arguments: Further arguments.

    Returns:
        The content; `None` if the page was closed meanwhile, or after an error, which was shown.
    """
    client = ui.context.client
    # The name appears in messages and names the site; cleaned, it cannot lead to another folder.
    name = re.sub(r"[^\w.() +-]", "_", file.name)[-_MOST_LETTERS:].lstrip(".") or "file"
    try:
        async with workers.readings:
            if client.is_deleted:
                return None
            with scratch_folder() as folder:
                found = await _read_apart(Path(folder, name), file, read, *arguments)
    except BlastEnvError as error:
        if not client.is_deleted:
            complain(error)
        return None
    return None if client.is_deleted else found


async def _read_apart(
    path: Path, file: FileUpload, read: Callable[..., Read], *arguments: Any
) -> Read | None:
    await file.save(path)
    try:
        with Reading(path.name, read, path, *arguments) as reading:
            ui.context.client.on_delete(reading.end)
            return await run.io_bound(reading.result)
    except BlastEnvError as error:
        raise BlastEnvError(str(error).replace(f"{path.parent}/", "")) from error


def site_upload(label: str, workers: Workers, use: Callable[[Scenario, str], None]) -> None:
    """Make an upload field for the file of a site.

    Args:
        workers: The processes, of which one reads it.
        use: Takes the site, and the name of the file.
    """

    async def take(event: events.UploadEventArguments) -> None:
        if is_map(event.file.name):
            ImportDialog(event.file, workers, use)
            return
        scenario = await read_upload(workers, event.file, site_of_file)
        if scenario is not None:
            use(scenario, event.file.name)

    file_upload(label, (*SITES, *MAPS), take)


def file_upload(
    label: str,
    endings: tuple[str, ...],
    take: Callable[[events.UploadEventArguments], Awaitable[None]],
) -> None:
    """Make an upload field for a file.

    Args:
        endings: Suffixes of the files on offer.
    """

    async def received(event: events.UploadEventArguments) -> None:
        upload.reset()
        await take(event)

    upload: ui.upload = ui.upload(
        label=label,
        auto_upload=True,
        max_file_size=MOST_BYTES,
        max_files=1,
        on_upload=received,
        on_rejected=lambda: ui.notify(
            f"one file, and at most {MOST_BYTES // 1_000_000} MB", type="negative"
        ),
    )
    upload.props(f'accept="{",".join(endings)}" flat bordered').classes("w-full")


class ImportDialog:
    """Asks for the options of a map, imports it, and shows the deviations of the site.

    Args:
        file: The file.
        workers: The processes, of which one reads it.
        use: Takes the site, and the name of the file.
    """

    def __init__(
        self, file: FileUpload, workers: Workers, use: Callable[[Scenario, str], None]
    ) -> None:
        self._file = file
        self._workers = workers
        self._use = use
        with ui.dialog(value=True) as self._dialog, ui.card().classes("w-[560px] max-w-full gap-2"):
            ui.label(f"Import {file.name}").style("font-weight: 600; font-size: 16px")
            show = ui.button("show its buildings", icon="map", on_click=self._show_map)
            show.props("dense outline no-caps").mark("sketch")
            self._map = ui.column().classes("w-full gap-0")
            with ui.grid(columns=2).classes("w-full gap-2"):
                self._centre = _text("middle of the site, x, y of the file (or all of it)")
                self._size = _text("width, depth of the site (m), with its middle")
                self._layers = _text("layers or tags of buildings, separated by commas")
                self._protect = _text("protected buildings (names, separated by commas)")
                self._near = _text("or the building nearest to x, y of the file")
                self._charges = _text("charges at x, y; x, y of the file (or its streets)")
                self._tnt = _number("mass of a charge (kg TNT)", 100.0)
                self._around = _number(_AROUND, 10.0, optional=True)
                self._around.tooltip("empty for the build zone of the file, if it has one")
                self._stock = _number("stock of modules", 20.0, whole=True)
                self._wall = _number("height of modules (m)", 3.0)
                self._height = _number("height of buildings without one (m)", None, optional=True)
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
        """Return the options entered."""
        return ImportOptions(
            centre=next(iter(_places(_filled(self._centre))), None),
            size_m=next(iter(_places(_filled(self._size))), None),
            buildings_from=_parts(self._layers),
            protect=_parts(self._protect),
            protect_near=next(iter(_places(_filled(self._near))), None),
            charge_at=tuple(_places(_filled(self._charges))),
            tnt_kg=self._tnt.filled,
            zone_around_m=self._around.number,
            stock=int(self._stock.filled),
            wall_height_m=self._wall.filled,
            default_height_m=self._height.number,
            crs=_filled(self._crs) or None,
            units=_filled(self._units) or None,
        )

    async def _show_map(self) -> None:
        """Show the buildings of the map; a click protects one, in the middle of a site of 100 m."""
        options = ImportOptions(
            buildings_from=_parts(self._layers),
            crs=_filled(self._crs) or None,
            units=_filled(self._units) or None,
        )
        found = await read_upload(self._workers, self._file, map_sketch, options)
        if found is None or self._map.is_deleted:
            return
        self._map.clear()
        view = SketchView(found)

        def choose(event: events.MouseEventArguments) -> None:
            x, y = view.place(event.image_x, event.image_y)
            self._near.value = self._centre.value = f"{x:.8g}, {y:.8g}"
            self._size.value = _filled(self._size) or "100, 100"
            image.content = view.svg((x, y))

        with self._map:
            ui.label("Click the building to protect.").classes("be-quiet")
            image = ui.interactive_image(size=view.size_px, events=["click"], on_mouse=choose)
            image.content = view.svg(None)

    async def _import(self) -> None:
        try:
            options = self._options()
        except BlastEnvError as error:
            complain(error)
            return
        self._wait.visible = True
        found = await read_upload(self._workers, self._file, imported_site, options)
        if self._wait.is_deleted:  # the page was closed meanwhile
            return
        self._wait.visible = False
        if found is not None:
            self._dialog.close()
            self._report(found)

    def _report(self, found: SiteImport) -> None:
        """Show the deviations of the site from the map before it is used."""
        with ui.dialog(value=True) as dialog, ui.card().classes("w-[560px] max-w-full gap-1"):
            site = found.scenario.site
            ui.label(f"{self._file.name}: {site.width_m:g} x {site.height_m:g} m").classes(
                "be-head"
            )
            for building in found.buildings:
                area, apart = building.deviation.area_share, building.deviation.outline_m
                name = f"{building.name}, protected" if building.protected else building.name
                ui.label(
                    f"{name}: modules off by {area:.1%} of its area, {apart:.2f} m of its outline"
                ).classes("be-quiet")
            for note in found.notes:
                ui.label(f"note: {note}").classes("be-quiet")

            def take() -> None:
                dialog.close()
                self._use(found.scenario, self._file.name)

            with ui.row():
                ui.button("use this site", on_click=take).props("no-caps autofocus").mark(
                    "take-site"
                )
                ui.button("cancel", on_click=dialog.close).props("flat no-caps")


def _text(label: str) -> ui.input:
    return ui.input(label).props("dense outlined stack-label").classes("w-full")


def _number(
    label: str, number: float | None, *, optional: bool = False, whole: bool = False
) -> NumberField:
    field = NumberField(label, number, optional=optional, whole=whole)
    return field.props("stack-label").classes("w-full")


def _parts(element: Any) -> tuple[str, ...]:
    return tuple(part.strip() for part in _filled(element).split(",") if part.strip())


def _filled(element: Any) -> str:
    return str(element.value or "").strip()


def _places(text: str) -> list[tuple[float, float]]:
    """Return the places in a text, `x, y; x, y`."""
    places = []
    for part in filter(None, (own.strip() for own in text.split(";"))):
        try:
            x, y = (plain_number("a coordinate", value.strip()) for value in part.split(","))
        except ValueError:
            raise BlastEnvError(f"{part!r} is not a list of places: write x, y; x, y") from None
        places.append((x, y))
    return places
