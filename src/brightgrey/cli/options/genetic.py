"""Options of the genetic search that ``identify`` and ``reproduce`` share; their defaults are the paper's."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated

import typer

from brightgrey.cli.options.common import number, pairs

if TYPE_CHECKING:
    from brightgrey.search.genetic import GeneticSettings

__all__ = [
    "Clone",
    "CriterionName",
    "Elite",
    "Estimator",
    "Generations",
    "Iterations",
    "Kp",
    "MaxRemutations",
    "Mutation",
    "Neighbours",
    "Population",
    "Preset",
    "genetic_settings",
    "refuse_genetic_options",
]

MUTATION = "NAME=PROBABILITY, a number from 0 to 1"

Population = Annotated[int | None, typer.Option("--population", metavar="N", help="Individuals. Paper: 6.")]
Generations = Annotated[
    int | None, typer.Option("--generations", metavar="N", help="Generations after the initial one. Paper: 20.")
]
Iterations = Annotated[
    int | None,
    typer.Option("--iterations", metavar="N", help="Limit of the estimator for each individual. Paper: 500."),
]
Estimator = Annotated[
    str | None,
    typer.Option(
        "--estimator",
        metavar="least-squares|pattern-search",
        help="How parameters are searched for; pattern-search is the paper's, and slow. Least squares by default, "
        "pattern search in a genetic search.",
    ),
]
CriterionName = Annotated[
    str | None,
    typer.Option("--criterion", metavar="fitness|bic", help="What structures compete by: the paper's (19), or BIC."),
]
Clone = Annotated[float | None, typer.Option("--p-clone", metavar="P", help="Probability that offspring is a clone.")]
Kp = Annotated[
    float | None, typer.Option("--k-p", metavar="X", help="Weight of the number of parameters in (19). Paper: 2.")
]
Mutation = Annotated[
    list[str] | None,
    typer.Option(
        "--mutation",
        metavar="NAME=P",
        help="Probability of a mutation: point, insertion, deletion or chromosome. May be repeated.",
    ),
]
Elite = Annotated[int | None, typer.Option("--elite", metavar="N", help="Best structures that are kept. Paper: 0.")]
MaxRemutations = Annotated[
    int | None,
    typer.Option("--max-remutations", metavar="N", help="Mutations until a structure is a new one. Paper: 0."),
]
Neighbours = Annotated[
    int | None,
    typer.Option("--neighbours", metavar="N", help="Untried structures one node away from the best ones. Paper: 0."),
]
Preset = Annotated[
    str,
    typer.Option("--preset", metavar="paper|tuned", help="Where the defaults of the options below come from."),
]


def genetic_settings(preset: str, mutation: Iterable[str] | None, **given: float | str | None) -> GeneticSettings:
    """Settings from the options; what is None keeps the value of `preset`.

    Raises
    ------
    SettingsError
        For an unknown name or a number out of range.
    """
    from dataclasses import replace

    from brightgrey.errors import SettingsError, unknown_name
    from brightgrey.search.genetic.settings import PAPER_SETTINGS, TUNED_SETTINGS

    known = {"paper": PAPER_SETTINGS, "tuned": TUNED_SETTINGS}
    if preset not in known:
        raise SettingsError(unknown_name("preset", preset, known))
    base = known[preset]
    changed = {
        name: number(f"--mutation {name}", value, MUTATION)
        for name, value in pairs("--mutation", mutation or (), MUTATION).items()
    }
    return replace(
        base,
        mutations={**base.mutations, **changed},
        **{name: value for name, value in given.items() if value is not None},  # type: ignore[arg-type]
    )


def refuse_genetic_options(preset: str, mutation: Iterable[str] | None, **given: float | str | None) -> None:
    """Refuse options of the search where nothing is searched (SettingsError)."""
    from brightgrey.errors import SettingsError

    named = [name for name, value in (given | {"mutation": mutation or None}).items() if value is not None]
    named += ["preset"] if preset != "paper" else []
    if named:
        option = named[0].replace("_", "-")
        raise SettingsError(f"option --{option} belongs to a search; add --search genetic")
