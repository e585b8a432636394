"""Options of the estimation of parameters."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from brightgrey.cli.options.common import bounds, fixed
from brightgrey.cli.options.groups import ESTIMATION

__all__ = ["EstimationOptions", "FurtherEstimationOptions"]


@dataclass(frozen=True, kw_only=True)
class EstimationOptions:
    """Ranges, known values and the initial state."""

    bound: Annotated[
        list[str] | None,
        typer.Option(
            "--bound",
            metavar="NAME=LOW:HIGH",
            help="Range of a parameter in the recording's units, or 'NAME=50%:200% of VALUE'; without it the range "
            "comes from the recording. Repeat for more.",
        ),
    ] = None
    fix: Annotated[
        list[str] | None,
        typer.Option("--fix", metavar="NAME=VALUE", help="Hold a parameter at this value. Repeat for more."),
    ] = None
    f_tanh: Annotated[
        float | None,
        typer.Option(
            "--f-tanh",
            metavar="X",
            help="Gain of the smoothed sign of friction, the inverse of the speed within which it reverses. By default "
            "that speed is estimated.",
            rich_help_panel=ESTIMATION,
        ),
    ] = None
    initial: Annotated[
        str,
        typer.Option(
            "--initial",
            metavar="NAME",
            help="State before the first sample: rest, samples (moving as the first samples show) or estimated "
            "(within the noise of the first samples). auto is rest, or estimated if the first samples clearly move.",
            rich_help_panel=ESTIMATION,
        ),
    ] = "auto"

    def arguments(self) -> dict[str, Any]:
        """Arguments of ``identify``.

        Raises
        ------
        SettingsError
            For a text that cannot be read.
        """
        from brightgrey.errors import one_of
        from brightgrey.estimation.problem.initial_state import INITIALS

        return {
            "bounds": bounds(self.bound or ()),
            "fixed": fixed(self.fix or ()),
            "f_tanh": self.f_tanh,
            "initial": one_of("initial state", self.initial, INITIALS),
        }


@dataclass(frozen=True, kw_only=True)
class FurtherEstimationOptions:
    """Start model, test recording, profiles and what may differ between recordings, for one identification."""

    test_recording: Annotated[
        Path | None,
        typer.Option("--test-recording", metavar="FILE", help="Compare the model with this recording, too."),
    ] = None
    start: Annotated[
        Path | None,
        typer.Option(
            "--start",
            metavar="MODEL",
            help="Start the estimation from this model.json, too.",
            rich_help_panel=ESTIMATION,
        ),
    ] = None
    per_recording: Annotated[
        str | None,
        typer.Option(
            "--per-recording",
            metavar="NAME,NAME",
            help="Parameters that may differ between the recordings, like f_v,M_C of a cold and a warm drive. "
            "The model has their mean, of logarithms where it is always positive.",
            rich_help_panel=ESTIMATION,
        ),
    ] = None
    profile: Annotated[
        list[str] | None,
        typer.Option(
            "--profile",
            metavar="NAME",
            help="Compute the interval of this parameter by profile likelihood, too. Repeat for more.",
            rich_help_panel=ESTIMATION,
        ),
    ] = None

    def lists(self) -> dict[str, Any]:
        """Parameters that are profiled, and those that may differ between the recordings, for ``identify``."""
        differing = tuple(name.strip() for name in (self.per_recording or "").split(",") if name.strip())
        return {"profile": self.profile or (), "per_recording": differing}
