"""Sphinx: strict, with examples that are executed when the pages are built."""

import re

import typer

from brightgrey import __version__
from brightgrey.cli.program import app as program
from brightgrey.report.effect_catalogue import catalogue

project = "brightgrey"
author = "the brightgrey developers"
release = version = __version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
exclude_patterns = ["build"]
html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_copyright = False
html_title = f"brightgrey {__version__}"

myst_enable_extensions = ["attrs_inline"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 900
nb_merge_streams = True

autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": False, "exclude-members": "model_config"}
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
suppress_warnings = ["mystnb.unknown_mime_type"]


def command_line() -> str:
    """Return the commands and their options in Markdown, read from the program."""
    group = typer.main.get_command(program)
    return "\n\n".join(part for name, command in group.commands.items() for part in _command(name, command))


def _command(name, command):
    """Yield the heading, the help and one table of options for each panel of the help."""
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    options = [p for p in command.params if p.param_type_name == "option" and not getattr(p, "hidden", False)]
    yield f"## {name}"
    yield "\n".join(["```text", " ".join(["brightgrey", name, *(_shown(p) for p in arguments), "[OPTION]..."]), "```"])
    yield from _help_text(command.help or "")
    panels = {}
    for option in options:
        panels.setdefault(getattr(option, "rich_help_panel", None) or "Options", []).append(option)
    for panel, members in panels.items():
        rows = [f"| {_flags(option)} | {_cell(option.help)} |" for option in members]
        yield f"**{panel}**"
        yield "\n".join(["| option | meaning |", "|---|---|", *rows])


def _help_text(text):
    """Yield the paragraphs of a help text; indented lines and lines of commands are shown as they stand."""
    for paragraph in re.split(r"\n\s*\n", text.replace("\b\n", "").replace("\b", "")):
        lines = paragraph.strip("\n").splitlines()
        if not lines:
            continue
        if any(line.strip().startswith(("brightgrey ", "$ ")) for line in lines):
            yield "\n".join(["```text", *(line.rstrip() for line in lines), "```"])
        else:
            yield " ".join(line.strip() for line in lines)


def _shown(argument):
    return argument.metavar or argument.name.upper()


def _flags(option):
    metavar = f" {option.metavar}" if option.metavar else ""
    return f"`{', '.join(option.opts)}{metavar}`".replace("|", "\\|")


def _cell(text):
    return " ".join((text or "").split()).replace("|", "\\|")


def setup(app):
    """Fill in what is read from the declarations of the effects and from the program, where a page asks for it."""

    def fill(_, name, text):
        if "% function set" in text[0]:
            text[0] = text[0].replace("% function set", catalogue())
        if "% command line" in text[0]:
            text[0] = text[0].replace("% command line", command_line())

    def breakable(app, page, template, context, doctree):
        """Let long names of structures break after a plus, and nowhere else."""
        code = r'(?<=<span class="pre">)[^<]*\w\+\w[^<]*(?=</span>)'
        context["body"] = re.sub(code, lambda found: found[0].replace("+", "+<wbr>"), context.get("body", ""))

    app.connect("source-read", fill)
    app.connect("html-page-context", breakable)
