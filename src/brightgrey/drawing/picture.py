"""The drawing that users hold: for a notebook, a page or a file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from brightgrey.drawing.drive import Drive
from brightgrey.drawing.items import STYLE
from brightgrey.drawing.layout import lay_out
from brightgrey.drawing.svg import svg
from brightgrey.errors import SettingsError

__all__ = ["DriveDrawing"]

# One drawing is shown: by default that for paper.
_PAGE_CSS = (
    ".drive-wide,.drive-narrow{display:none}"
    "@media screen and (min-width:1160px){.drive-wide{display:block}.drive-medium{display:none}}"
    "@media screen and (max-width:690px){.drive-narrow{display:block}.drive-medium{display:none}}"
)


@dataclass(frozen=True)
class DriveDrawing:
    """Drawing of a drive; a notebook shows it."""

    drive: Drive

    def svg(self, width: float = STYLE.wide) -> str:
        """Text of an SVG file.

        Parameters
        ----------
        width : float
            Most pixels in a row; parts that do not fit are put into further rows.

        Returns
        -------
        str
        """
        return svg(lay_out(self.drive, width))

    def html(self) -> str:
        """Element of a page that shows one of three drawings, by the width of the window or on paper."""
        widths = {"wide": STYLE.wide, "medium": STYLE.medium, "narrow": STYLE.narrow}
        shown = "".join(f'<div class="drive-{name}">{self.svg(width)}</div>' for name, width in widths.items())
        return f"<div><style>{_PAGE_CSS}</style>{shown}</div>"

    def _repr_svg_(self) -> str:
        return self.svg()

    def save(self, path: str | Path) -> None:
        """Write an SVG file.

        Parameters
        ----------
        path : str or Path
            A file that is there is replaced.

        Raises
        ------
        SettingsError
            If it cannot be written.
        """
        try:
            Path(path).write_text(self.svg() + "\n", encoding="utf-8")
        except OSError as error:
            raise SettingsError(f"cannot write drawing '{path}': {error.strerror}") from None
