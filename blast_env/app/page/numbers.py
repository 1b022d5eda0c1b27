"""A form field for one number, read by a strict parser, with its unit beside it."""

import re
from collections.abc import Callable
from typing import Final

from nicegui import ui

from blast_env.errors import BlastEnvError
from blast_env.values import typed_number

_UNIT: Final = re.compile(r" \(([^()]+)\)$")


class NumberField(ui.input):
    """A text field for a number: number fields of browsers drop characters and keep the rest.

    The number is read when the field is left or Enter is pressed. The field then shows the number
    read, beside its unit. A text that is no number stays, with the reason below; if `taken` keeps
    the number elsewhere, the field shows that number again, and a message gives the reason.

    Args:
        label: The quantity, with its unit in parentheses at the end.
        number: The number at first; `None` for an empty field.
        taken: Called with a number that differs from the one before.
        optional: Whether the field may be empty.
        whole: Whether the number must have no decimals.
        least: The least number.
    """

    def __init__(
        self,
        label: str,
        number: float | None = None,
        taken: Callable[[float | None], None] | None = None,
        *,
        optional: bool = False,
        whole: bool = False,
        least: float | None = None,
    ) -> None:
        super().__init__(label, value=_text(number))
        unit = _UNIT.search(label)
        self._quantity = _UNIT.sub("", label)
        self._unit = unit[1] if unit else ""
        self._shown = number
        self._taken = taken
        self._optional, self._whole, self._least = optional, whole, least
        self.props(f'dense outlined inputmode="{"numeric" if whole else "decimal"}"')
        if self._unit:
            self.props(f'suffix="{self._unit}"')
        for event in ("blur", "keydown.enter", "clear"):
            self.on(event, self._take)

    @property
    def number(self) -> float | None:
        """The number in the field; `None` if it is empty."""
        text = (self.value or "").strip()
        if not text:
            if self._optional:
                return None
            raise BlastEnvError(f"{self._quantity} is empty, must be a number")
        if text == _text(self._shown):  # a number with more digits than are shown
            return self._shown
        number = typed_number(self._quantity, text, self._unit)
        if self._whole and not number.is_integer():
            raise BlastEnvError(f"{self._quantity} is {number:g}, must be a whole number")
        if self._least is not None and number < self._least:
            raise BlastEnvError(f"{self._quantity} is {number:g}, must be at least {self._least:g}")
        return number

    @property
    def filled(self) -> float:
        """The number of a field that must not be empty."""
        number = self.number
        assert number is not None
        return number

    def show(self, number: float | None) -> None:
        """Show a number in place of the present text."""
        self._shown = number
        self.error = None
        self.value = _text(number)

    def _take(self) -> None:
        before = self._shown
        if (self.value or "") == _text(before):
            return
        try:
            number = self.number
        except BlastEnvError as error:
            if self._taken is None:
                self.error = str(error)
                return
            self.show(before)
            kept = f"{error}; it stays {_text(before) or 'empty'} {self._unit}".rstrip()
            ui.notify(kept, type="negative", multi_line=True, close_button=True, timeout=0)
            return
        self.show(number)
        if number != before and self._taken is not None:
            self._taken(number)


def _text(number: float | None) -> str:
    """Return a number with all digits that were typed, without a needless `.0`."""
    return "" if number is None else f"{number:.12g}"
