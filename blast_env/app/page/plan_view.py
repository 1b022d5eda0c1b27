"""The plan: tools, the mouse, the keyboard; and the view in three dimensions."""

from collections.abc import Callable
from typing import Any, Final

from nicegui import events, ui

from blast_env.app.editor import Editor, Tool
from blast_env.app.page.numbers import NumberField
from blast_env.app.plan import PixelView, overlay_svg, plan_legend, plan_svg, words_of_place
from blast_env.app.solids import SEE_THROUGH, boxes

WIDTH_PX, HEIGHT_PX = 680, 560

_TOOLS: Final = (
    (Tool.SELECT, "v", "near_me", "Select"),
    (Tool.PLACE, "p", "add_box", "Place"),
    (Tool.ERASE, "e", "backspace", "Erase"),
    (Tool.STRUCTURE, "s", "domain", "Structure"),
    (Tool.ZONE, "z", "select_all", "Zone"),
    (Tool.KEEP_OUT, "k", "block", "No-build area"),
    (Tool.CHARGE, "c", "whatshot", "Charge"),
    (Tool.CHARGE_AREA, "a", "crop_din", "Area"),
    (Tool.GAUGE, "g", "speed", "Gauge"),
)

_ARROWS: Final = {
    "ArrowUp": (1, 0),
    "ArrowDown": (-1, 0),
    "ArrowRight": (0, 1),
    "ArrowLeft": (0, -1),
}

_ZOOM: Final = 1.25
_RIGHT_BUTTON: Final = 2
# The scene draws 15 times a second for as long as the page lives; each draw keeps a core busy.
_DRAW_IF_SEEN: Final = """() => {
  const view = getElement(%d), draw = view.renderer.render.bind(view.renderer);
  view.renderer.render = (...what) => { if (view.$el.offsetParent !== null) draw(...what); };
}"""


class PlanPanel:
    """The plan with its tools.

    Args:
        editor: The editor of the design.
        after: Called after something was changed or selected.
        commands: Commands of further keys.
    """

    def __init__(
        self, editor: Editor, after: Callable[[], None], commands: dict[str, Callable[[], None]]
    ) -> None:
        self._editor = editor
        self._after = after
        self._commands = commands
        self._view = PixelView.of(editor.session.scenario, WIDTH_PX, HEIGHT_PX)
        self._site = editor.session.scenario.site
        self._buttons: dict[Tool, ui.button] = {}
        self._pan_from: tuple[float, float] | None = None
        self._drawn = ("", "")
        self._build()

    def _build(self) -> None:
        with ui.row().classes("be-tools items-center w-full").props('role="toolbar"'):
            for tool, key, icon, words in _TOOLS:
                button = ui.button(words, icon=icon, on_click=lambda _, t=tool: self.choose(t))
                button.props("dense flat no-caps size=sm").tooltip(f"{words} (key {key.upper()})")
                self._buttons[tool] = button
            self._height = NumberField(
                "height (m)",
                self._editor.new_height_m,
                self._take_height,
                optional=True,
                least=0.5,
            )
            self._height.classes("w-32")
            self._height.tooltip("of a new structure; empty: as high as the air")
        ui.label("Drawing needs a larger screen; here you can view, blast and compare.").classes(
            "be-quiet be-narrow"
        )
        self._image = ui.interactive_image(
            size=(WIDTH_PX, HEIGHT_PX),
            events=["mousedown", "mousemove", "mouseup", "mouseleave"],
            on_mouse=self._mouse,
        ).classes("be-plan")
        self._image.props(
            'tabindex=0 role="application" aria-label="plan of the site: arrow keys move, '
            'enter places or removes" oncontextmenu="return false"'
        )
        self._image.on(
            "wheel.prevent", self._wheel, ["deltaY", "offsetX", "offsetY"], throttle=0.05
        )
        self._overlay = self._image.add_layer()
        self._legend = ui.html("", sanitize=False).classes("be-legend")
        with ui.row().classes("be-status items-center no-wrap"):
            with ui.column().classes("grow gap-0").props('role="status" aria-live="polite"'):
                self._words = ui.label()
                self._reason = ui.label().classes("be-refused")
            for icon, words, act in (
                ("zoom_in", "zoom in (+)", lambda: self._zoom(_ZOOM)),
                ("zoom_out", "zoom out (-)", lambda: self._zoom(1.0 / _ZOOM)),
                ("fit_screen", "whole site (0)", self.fit),
            ):
                button = ui.button(icon=icon, on_click=act).props("dense flat size=sm")
                button.props(f'aria-label="{words}"').tooltip(words)
        ui.keyboard(on_key=self._key)

    def choose(self, tool: Tool) -> None:
        """Take another tool."""
        self._editor.choose(tool)
        self._after()

    def _take_height(self, height_m: float | None) -> None:
        self._editor.new_height_m = height_m

    def fit(self) -> None:
        """Show the whole site."""
        self._view = PixelView.of(self._editor.session.scenario, WIDTH_PX, HEIGHT_PX)
        self.refresh()

    def refresh(self) -> None:
        """Show the current design."""
        editor = self._editor
        if editor.session.scenario.site != self._site:
            self._site = editor.session.scenario.site
            self._view = PixelView.of(editor.session.scenario, WIDTH_PX, HEIGHT_PX)
        for tool, button in self._buttons.items():
            button.classes(
                add="be-tool-on" if tool is editor.tool else "",
                remove="" if tool is editor.tool else "be-tool-on",
            )
            button.props(f"aria-pressed={'true' if tool is editor.tool else 'false'}")
        self._height.visible = editor.tool is Tool.STRUCTURE
        self._draw()
        self._say("")

    def _draw(self) -> None:
        editor = self._editor
        plan = plan_svg(self._view, editor.scenario, editor.layout, editor.selected)
        over = overlay_svg(self._view, editor.scenario, editor.ghost, editor.cursor)
        if plan != self._drawn[0]:
            self._image.content = plan
            self._legend.content = plan_legend(editor.scenario, editor.layout)
        if over != self._drawn[1]:
            self._overlay.content = over
        self._drawn = (plan, over)

    def _say(self, place: str) -> None:
        editor = self._editor
        reason = editor.ghost.reason if editor.ghost is not None else ""
        self._reason.text = reason or editor.message
        what = (
            editor.tool.value
            if editor.tool is not Tool.PLACE
            else f"place {editor.item or 'modules'}"
        )
        self._words.text = f"{what}   {place}" if place else what

    # The mouse.

    def _mouse(self, event: events.MouseEventArguments) -> None:
        x_m, y_m = self._view.metres(event.image_x, event.image_y)
        erase = event.button == _RIGHT_BUTTON or event.buttons == _RIGHT_BUTTON
        editor = self._editor
        if event.type == "mousedown":
            editor.press(x_m, y_m, erase)
            pans = editor.tool is Tool.SELECT and not editor.holds_something
            self._pan_from = (event.image_x, event.image_y) if pans else None
            self._after()
        elif event.type == "mouseup":
            self._pan_from = None
            editor.release()
            self._after()
        elif event.type == "mouseleave":
            self._pan_from = None
            editor.leave()
            self._after()
        elif self._pan_from is not None and event.buttons:
            self._pan(event.image_x, event.image_y)
        elif editor.move(x_m, y_m, erase and bool(event.buttons)):
            self._draw()
            self._say(words_of_place(self._view, x_m, y_m))
        elif editor.tool is Tool.SELECT:
            self._say(editor.named_at(x_m, y_m))

    def _pan(self, x_px: float, y_px: float) -> None:
        if self._pan_from is None:
            return
        across, up = self._pan_from[0] - x_px, y_px - self._pan_from[1]
        self._view = self._view.panned(across / WIDTH_PX, up / HEIGHT_PX)
        self._pan_from = (x_px, y_px)
        self._draw()

    def _wheel(self, event: events.GenericEventArguments) -> None:
        self._zoom(_ZOOM if event.args["deltaY"] < 0 else 1.0 / _ZOOM)

    def _zoom(self, factor: float) -> None:
        self._view = self._view.zoomed(factor)
        self._draw()

    # The keyboard.

    def _key(self, event: events.KeyEventArguments) -> None:
        if not event.action.keydown:
            return
        key = event.key.name
        if event.modifiers.ctrl or event.modifiers.meta:
            name = f"ctrl+{'shift+' if event.modifiers.shift else ''}{key.lower()}"
            if name in self._commands:
                self._commands[name]()
            return
        if key in _ARROWS:
            self._arrow(*_ARROWS[key])
        elif key in ("Enter", " ") and self._editor.tool is not Tool.SELECT:
            self._editor.toggle_at_cursor()
        elif key == "Delete":
            self._editor.delete()
        elif key == "Escape":
            self._editor.leave()
            self._editor.selected = None
        elif key in ("+", "-", "0"):
            {"+": lambda: self._zoom(_ZOOM), "-": lambda: self._zoom(1.0 / _ZOOM), "0": self.fit}[
                key
            ]()
            return
        elif not self._letter(key.lower()):
            return
        self._after()

    def _letter(self, key: str) -> bool:
        for tool, own, _, _ in _TOOLS:
            if key == own:
                self._editor.choose(tool)
                return True
        if key in self._commands:
            self._commands[key]()
            return True
        return False

    def _arrow(self, rows: int, columns: int) -> None:
        if self._editor.tool is Tool.SELECT:
            self._editor.nudge(0.5 * columns, 0.5 * rows)
        else:
            self._editor.step_cursor(rows, columns)


class SolidView:
    """The view in three dimensions, which can be turned.

    Args:
        editor: The editor of the design.
    """

    def __init__(self, editor: Editor) -> None:
        self._editor = editor
        self._drawn: list[Any] = []
        self._stale = True
        self._scene = ui.scene(
            width=WIDTH_PX, height=HEIGHT_PX, grid=False, background_color="#eef2f6", fps=15
        ).classes("w-full")
        self._scene.on("init", js_handler=_DRAW_IF_SEEN % self._scene.id)
        ui.label("Drag to rotate, wheel to zoom, right button to pan.").classes("be-quiet")
        self._see_through = ui.label(
            "Transparent: no height given, up to the top of the air."
        ).classes("be-quiet")
        self._look()

    def _look(self) -> None:
        site = self._editor.session.scenario.site
        far = max(site.width_m, site.height_m)
        self._scene.move_camera(
            x=0.5 * site.width_m - 0.25 * far,
            y=0.5 * site.height_m - 0.85 * far,
            z=0.62 * far,
            look_at_x=0.5 * site.width_m,
            look_at_y=0.46 * site.height_m,
            look_at_z=0.0,
            duration=0.0,
        )

    def refresh(self) -> None:
        """Show the current design."""
        solids = [*boxes(self._editor.session.scenario, self._editor.session.design.layout)]
        if solids == self._drawn:
            return
        self._drawn = solids
        self._see_through.set_visibility(any(own.opacity == SEE_THROUGH for own in solids))
        self._scene.clear()
        with self._scene:
            for solid in solids:
                box = self._scene.box(*solid.size_m).move(*solid.centre_m)
                box.material(solid.colour, solid.opacity).with_name(solid.name)
