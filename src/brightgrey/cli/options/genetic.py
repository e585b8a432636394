"""Options of genetic programming, which ``identify`` and ``reproduce`` share; their defaults are the paper's."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Annotated

import typer

from brightgrey.cli.options.groups import ESTIMATION, GENETIC
from brightgrey.errors import SettingsError, one_of
from brightgrey.option_texts import number, pairs

if TYPE_CHECKING:
    from brightgrey.search.genetic import GeneticSettings

__all__ = ["GeneticOptions"]

MUTATION = "NAME=PROBABILITY, a number from 0 to 1"


@dataclass(frozen=True, kw_only=True)
class GeneticOptions:
    """Settings of genetic programming, and the estimator, which a given structure has, too."""

    estimator: Annotated[
        str | None,
        typer.Option(
            "--estimator",
            metavar="NAME",
            help="least-squares (default), or the paper's pattern-search, which is slow and the default of a genetic "
            "search.",
            rich_help_panel=ESTIMATION,
        ),
    ] = None
    preset: Annotated[
        str,
        typer.Option(
            "--preset",
            metavar="NAME",
            help="Defaults of the options below: paper, or tuned, which finds the true structure more often.",
            rich_help_panel=GENETIC,
        ),
    ] = "paper"
    population: Annotated[
        int | None,
        typer.Option("--population", metavar="N", help="Individuals. Paper: 6.", rich_help_panel=GENETIC),
    ] = None
    generations: Annotated[
        int | None,
        typer.Option(
            "--generations", metavar="N", help="Generations after the initial one. Paper: 20.", rich_help_panel=GENETIC
        ),
    ] = None
    iterations: Annotated[
        int | None,
        typer.Option(
            "--iterations",
            metavar="N",
            help="Iterations of the estimator for each individual. Paper: 500.",
            rich_help_panel=GENETIC,
        ),
    ] = None
    criterion: Annotated[
        str | None,
        typer.Option(
            "--criterion",
            metavar="NAME",
            help="Criterion of selection: fitness (the paper's equation 19) or bic.",
            rich_help_panel=GENETIC,
        ),
    ] = None
    p_clone: Annotated[
        float | None,
        typer.Option("--p-clone", metavar="P", help="Probability that offspring is a clone.", rich_help_panel=GENETIC),
    ] = None
    k_p: Annotated[
        float | None,
        typer.Option(
            "--k-p",
            metavar="X",
            help="Weight of the number of parameters in equation 19. Paper: 2.",
            rich_help_panel=GENETIC,
        ),
    ] = None
    mutation: Annotated[
        list[str] | None,
        typer.Option(
            "--mutation",
            metavar="NAME=P",
            help="Probability of a mutation: point, insertion, deletion or chromosome. Repeat for more.",
            rich_help_panel=GENETIC,
        ),
    ] = None
    elite: Annotated[
        int | None,
        typer.Option("--elite", metavar="N", help="Best structures that are kept. Paper: 0.", rich_help_panel=GENETIC),
    ] = None
    max_remutations: Annotated[
        int | None,
        typer.Option(
            "--max-remutations",
            metavar="N",
            help="Mutations of a known structure until it is a new one. Paper: 0.",
            rich_help_panel=GENETIC,
        ),
    ] = None
    neighbours: Annotated[
        int | None,
        typer.Option(
            "--neighbours",
            metavar="N",
            help="Untried structures beside the best ones, per generation. Paper: 0.",
            rich_help_panel=GENETIC,
        ),
    ] = None

    def settings(self) -> GeneticSettings:
        """Settings of the search.

        Raises
        ------
        SettingsError
            For an unknown name or a number out of range.
        """
        from brightgrey.search.genetic.settings import PAPER_SETTINGS, TUNED_SETTINGS

        presets = {"paper": PAPER_SETTINGS, "tuned": TUNED_SETTINGS}
        base = presets[one_of("preset", self.preset, presets)]
        changed = {
            name: number(f"--mutation {name}", value, MUTATION)
            for name, value in pairs("--mutation", self.mutation or (), MUTATION).items()
        }
        given = {name: value for name, value in asdict(self).items() if value is not None}
        given["n_neighbours"] = given.pop("neighbours", base.n_neighbours)
        own = {name: value for name, value in given.items() if name not in ("preset", "mutation")}
        return replace(base, mutations={**base.mutations, **changed}, **own)

    def refuse(self, *, estimator: bool) -> None:
        """Refuse all of these options where there is no genetic search (SettingsError).

        Parameters
        ----------
        estimator : bool
            Refuse ``--estimator``, too.
        """
        given = {name: value for name, value in asdict(self).items() if value is not None}
        given.pop("preset" if self.preset == "paper" else "", None)
        given.pop("" if estimator else "estimator", None)
        for name in given:
            raise SettingsError(f"option --{name.replace('_', '-')} belongs to a search; add --search genetic")
