"""Fields and buttons by their keys: what is said to one that is made anew meanwhile reaches the new one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any
from weakref import WeakValueDictionary

from nicegui import ui
from nicegui.events import GenericEventArguments

__all__ = ["connect_control", "show_scene"]

Handler = Callable[[Any], Any]


@dataclass
class _Controls:
    """Controls of one page in one tab."""

    scene: str = ""  #: What the page shows: what was said to another scene is not for this one.
    known: dict[str, tuple[ui.element, Handler]] = field(default_factory=dict)

    def told(self, event: GenericEventArguments) -> None:
        """Hand on what the browser says; see app.js."""
        key, value, scene = event.args
        element, handler = self.known.get(key, (None, None))
        if element is not None and handler is not None and not element.is_deleted and scene == self.scene:
            handler(value)


#: Controls by the id of the page, which itself holds them: they end with it.
_CONTROLS: WeakValueDictionary[str, _Controls] = WeakValueDictionary()


def _of_page() -> _Controls:
    page = ui.context.client.id
    found = _CONTROLS.get(page)
    if found is None:
        found = _CONTROLS[page] = _Controls()
        ui.on("control", found.told)
    return found


def connect_control(element: ui.element, key: str, handler: Handler) -> None:
    """Call ``handler(value)`` for what is chosen in the field or the button that has the key on this page.

    NiceGUI drops what is said to an element that the server is making anew. With the key it comes to the new one.

    Parameters
    ----------
    element : ui.element
        A field or a button.
    key : str
        It is unique on the page.
    handler : callable
        Of a field it gets the text, of a box to tick a bool, of a button None.
    """
    element.props["data-key"] = key
    _of_page().known[key] = (element, handler)


def show_scene(place: ui.element, scene: str) -> None:
    """Note what the page shows from now on, in `place`: the second click on *Continue* is not for the next stage."""
    place.props["data-scene"] = scene
    place.update()
    _of_page().scene = scene
