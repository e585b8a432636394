"""Elements of the pages: plain HTML with names for keyboards and screen readers, and the app's own look."""

from __future__ import annotations

import html
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from nicegui import ui

from brightgrey.app.controls import connect_control

__all__ = [
    "Figure",
    "Parts",
    "action",
    "alert",
    "choice",
    "code_to_copy",
    "entry",
    "heading",
    "hint",
    "link",
    "option_row",
    "paragraph",
    "raw",
    "table_of",
    "tag",
    "tick",
]


class Figure(ui.element, component="static/figure.js"):
    """Figure of plotly, in the colours of the page; it tells which part of the first axis has been chosen."""

    def __init__(self, figure: Mapping[str, Any], label: str, *, on_zoom: Callable[[Any], Any] | None = None) -> None:
        super().__init__()
        self._props["figure"] = figure
        self._props["label"] = label
        if on_zoom is not None:
            self.on("zoom", lambda event: on_zoom(event.args))

    def show(self, figure: Mapping[str, Any]) -> None:
        """Replace the figure."""
        self._props["figure"] = figure
        self.update()


class Parts(ui.element, component="static/parts.js"):
    """Sections of a report, with their figures, and with buttons in place of the commands that do the same.

    Parameters
    ----------
    content : str
        HTML.
    plots : mapping of str to object
        All figures of the report; those of the content are sent.
    prefix : str
        Of the ids in the content, so that a page may show two reports.
    on_zoom : callable, optional
        ``on_zoom(parts, plot, span)`` is called where a part of a figure's time is chosen, None for all of it.
    tasks : mapping of str to str, optional
        Label of the button for each task of an advice; empty for an advice that is left out.
    on_task : callable, optional
        ``on_task(task)`` is called by such a button.
    """

    def __init__(
        self,
        content: str,
        plots: Mapping[str, Any],
        prefix: str = "",
        *,
        on_zoom: Callable[[Parts, str, Any], Any] | None = None,
        tasks: Mapping[str, str] | None = None,
        on_task: Callable[[str], Any] | None = None,
    ) -> None:
        super().__init__()
        own = {name: plot for name, plot in plots.items() if f'data-plot="{name}"' in content}
        self._props.update({"content": content, "plots": own, "prefix": prefix, "tasks": tasks})
        if on_zoom is not None:
            self.on("zoom", lambda event: on_zoom(self, event.args["plot"], event.args["span"]))
        if on_task is not None:
            self.on("task", lambda event: on_task(str(event.args)))

    def show(self, plot: str, figure: Mapping[str, Any]) -> None:
        """Replace a figure."""
        self.run_method("show", plot, figure)


def tag(name: str, text: str = "", style: str = "", /, **attributes: Any) -> ui.element:
    """HTML element with a text; an underscore at the end of an attribute's name is dropped, others are hyphens."""
    element = ui.element(name)
    if text:
        element._text = text
    if style:
        element.classes(style)
    for key, value in attributes.items():
        if value is not None and value is not False:
            element.props[key.rstrip("_").replace("_", "-")] = value
    return element


def heading(text: str, level: int = 2, **attributes: Any) -> ui.element:
    """Heading of a level, 1 to 4."""
    return tag(f"h{level}", text, **attributes)


def paragraph(text: str, style: str = "") -> ui.element:
    """Paragraph of plain text."""
    return tag("p", text, style)


def raw(content: str, name: str = "div", style: str = "") -> ui.element:
    """HTML from the program itself; what came from outside has been escaped in it."""
    element = ui.html(content, sanitize=False, tag=name)
    if style:
        element.classes(style)
    return element


def hint(term: str, explanation: str, name: str = "span") -> ui.element:
    """Term with an explanation that is shown on hover and on focus."""
    element = tag(name, "", "term", tabindex="0", data_tip=explanation)
    with element:
        tag("span", term)
        tag("span", f": {explanation}", "unseen")
    return element


def alert(text: str, kind: str = "problem") -> ui.element:
    """Message that is read out at once."""
    return tag("p", text, f"alert {kind}", role="alert" if kind == "problem" else "status")


def action(
    text: str,
    handler: Callable[[], Any],
    *,
    key: str,
    primary: bool = False,
    disabled: bool = False,
    described: str | None = None,
    label: str | None = None,
) -> ui.element:
    """Button. `key` is its name for tests, and gives it the focus again after the page has changed."""
    element = tag("button", text, "button primary" if primary else "button", type="button")
    element.props.update({k: v for k, v in (("aria-label", label), ("aria-describedby", described)) if v})
    if disabled:
        element.props["disabled"] = True
    connect_control(element, key, lambda _: handler())
    return element


def link(
    text: str, address: str, *, style: str = "", key: str = "", download: bool = False, **attributes: Any
) -> ui.element:
    """Link to a page or a file."""
    return tag("a", text, style, href=address, data_key=key or None, download="" if download else None, **attributes)


def entry(
    label: str,
    value: str,
    on_change: Callable[[str], Any],
    *,
    key: str,
    about: str = "",
    problem: str = "",
    unseen: bool = False,
    unit: str = "",
    **attributes: Any,
) -> ui.element:
    """Text field with its label, an explanation, and what is wrong with its text; the text stays as it was typed."""
    with tag("div", "", "field") as field:
        tag("label", label, "unseen" if unseen else "", for_=f"field-{key}")
        with tag("span", "", "with-unit"):
            box = tag("input", id=f"field-{key}", autocomplete="off", **attributes)
            box.props["^value"] = value  # as an attribute: Vue would put a property back while somebody types
            if unit:
                tag("span", unit, "unit")
        described = []
        if about:
            tag("span", about, "about", id=f"about-{key}")
            described.append(f"about-{key}")
        if problem:
            tag("span", problem, "wrong", id=f"wrong-{key}", role="alert")
            described.append(f"wrong-{key}")
            box.props["aria-invalid"] = "true"
        if described:
            box.props["aria-describedby"] = " ".join(described)
        connect_control(box, key, lambda text: on_change(str(text)))
    return field


def choice(
    label: str,
    value: str,
    options: Mapping[str, str],
    on_change: Callable[[str], Any],
    *,
    key: str,
    unseen: bool = False,
) -> ui.element:
    """List of which one is chosen, with its label."""
    with tag("div", "", "field") as field:
        tag("label", label, "unseen" if unseen else "", for_=f"field-{key}")
        box = tag("select", id=f"field-{key}")
        with box:
            for name, text in options.items():
                tag("option", text, value=name, selected=name == value)
        connect_control(box, key, lambda text: on_change(str(text)))
    return field


def option_row(
    legend: str, value: str, options: Mapping[str, str], on_change: Callable[[str], Any], *, key: str, about: str = ""
) -> ui.element:
    """Choice of one of a few, side by side."""
    with tag("fieldset", "", "choices") as group:
        tag("legend", legend)
        if about:
            tag("span", about, "about")
        with tag("span", "", "row"):
            for name, text in options.items():
                with tag("label", "", "choice"):
                    box = tag("input", type="radio", name=key, value=name, checked=name == value)
                    tag("span", text)
                    connect_control(box, f"{key}-{name}", lambda text: on_change(str(text)))
    return group


def tick(label: str, value: bool, on_change: Callable[[bool], Any], *, key: str) -> ui.element:
    """Box to tick."""
    with tag("label", "", "choice") as field:
        box = tag("input", type="checkbox", checked=value)
        tag("span", label)
        connect_control(box, key, lambda ticked: on_change(bool(ticked)))
    return field


def table_of(
    header: Sequence[str], rows: Iterable[Sequence[str]], *, caption: str, numbers: Sequence[int] = ()
) -> ui.element:
    """Table of texts; columns of numbers are aligned to the right. On a telephone each row is a block with labels."""
    with tag("div", "", "scroll", tabindex="0", role="region", aria_label=caption) as whole, tag("table", "", "stack"):
        tag("caption", caption, "unseen")
        with tag("thead"), tag("tr"):
            for column, text in enumerate(header):
                tag("th", text, "number" if column in numbers else "", scope="col")
        with tag("tbody"):
            for row in rows:
                with tag("tr"):
                    for column, text in enumerate(row):
                        label = f"{header[column]}:" if column and text else None
                        tag("td", text, "number" if column in numbers else "", data_label=label)
    return whole


def code_to_copy(text: str, *, key: str) -> ui.element:
    """Command with a button that copies it; it is broken between words only, not after the hyphens of an option."""
    with tag("div", "", "copy") as whole:
        words = re.sub(r"\S+", r'<span class="typed-word">\g<0></span>', html.escape(text))
        raw(words, "pre").props(f'id="code-{key}" tabindex="0"')
        tag("button", "Copy", "button small", type="button", data_copy=f"code-{key}", data_key=f"copy-{key}")
    return whole
