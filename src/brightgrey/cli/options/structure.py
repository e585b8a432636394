"""Options that name a structure, or say how it is searched for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from brightgrey.cli.options.groups import STRUCTURE
from brightgrey.errors import SettingsError, one_of

__all__ = ["SEARCHES", "StructureOptions"]

SEARCHES = ("auto", "exhaustive", "genetic")


@dataclass(frozen=True, kw_only=True)
class StructureOptions:
    """A structure, or the limits of a search for it."""

    structure: Annotated[
        str | None,
        typer.Option(
            "--structure",
            metavar="EFFECT+…",
            help="Effects in the model, joined by +; 'brightgrey effects' lists them. Without it the structure is "
            "searched for.",
        ),
    ] = None
    search: Annotated[
        str | None,
        typer.Option(
            "--search",
            metavar="NAME",
            help="How to search: auto (default) fits the few dozen structures that decide all others; exhaustive fits "
            "every one and decides by the same rules; genetic is the paper's genetic programming, without verdicts "
            "(only in identify).",
        ),
    ] = None
    grammar: Annotated[
        str | None,
        typer.Option(
            "--grammar",
            metavar="NAME",
            help="Function set: drive begins with the paper's 448 structures and offers friction at other masses and "
            "further effects where those leave something unexplained (default of auto); paper is those 448 alone. The "
            "genetic search takes all effects of drive from the start.",
            rich_help_panel=STRUCTURE,
        ),
    ] = None
    require: Annotated[
        list[str] | None,
        typer.Option(
            "--require",
            metavar="EFFECT",
            help="Search only structures with this effect. Repeat for more.",
            rich_help_panel=STRUCTURE,
        ),
    ] = None
    exclude: Annotated[
        list[str] | None,
        typer.Option(
            "--exclude",
            metavar="EFFECT",
            help="Search only structures without this effect. Repeat for more.",
            rich_help_panel=STRUCTURE,
        ),
    ] = None

    def checked(self, searches: tuple[str, ...] = SEARCHES) -> str | None:
        """Return the structure in its standard form, None if it is searched for.

        Raises
        ------
        SettingsError
            For an unknown effect or search, a structure that breaks a rule, or options that exclude each other.
        """
        from brightgrey.kit import GRAMMARS, function_set

        effects = (*(self.require or ()), *(self.exclude or ()))
        if self.structure is not None:
            if self.search is not None or self.grammar is not None or effects:
                raise SettingsError("--structure cannot be combined with --search, --grammar, --require or --exclude")
            return str(function_set().parse(self.structure))
        if self.search is not None:
            one_of("search", self.search, searches)
        if self.grammar is not None:
            one_of("function set", self.grammar, GRAMMARS)
        if self.search == "genetic" and effects:
            raise SettingsError("--require and --exclude do not belong to the genetic search")
        if effects:
            from brightgrey.api.structure_search import grammar_searched
            from brightgrey.search.lattice import Lattice

            grammar = grammar_searched("exhaustive" if self.search == "exhaustive" else None, self.grammar)
            Lattice.of(grammar.whole, self.require or (), self.exclude or ())
        return None
