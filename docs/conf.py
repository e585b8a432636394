"""Sphinx: strict, with examples that are executed when the pages are built."""

from brightgrey import __version__
from brightgrey.report.effect_catalogue import catalogue

project = "brightgrey"
author = "the brightgrey developers"
release = version = __version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
exclude_patterns = ["build"]
html_theme = "furo"
html_show_copyright = False
html_title = f"brightgrey {__version__}"

myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 300
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


def setup(app):
    """Put the function set, read from the declarations, where a page asks for it."""

    def fill(_, name, text):
        text[0] = text[0].replace("% function set", catalogue())

    app.connect("source-read", fill)
