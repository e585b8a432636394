"""Registry of the export targets, and the export of a model with a check by the tool chain it is made for."""

from __future__ import annotations

import importlib
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from brightgrey.arguments import checked_arguments
from brightgrey.errors import one_of
from brightgrey.exports.numeric_model import NumericModel, numeric_model
from brightgrey.exports.verification import Verify, compare_with_native, verification_of
from brightgrey.model.files import check_folder, write_files
from brightgrey.model.model import Model
from brightgrey.recordings import Recording

__all__ = ["EXPORTS", "Export", "Exporter", "export", "exporter"]


@dataclass(frozen=True)
class Exporter:
    """One target.

    Attributes
    ----------
    about : str
        One line.
    tolerance : float
        Deviation from the native simulation, relative to the range of each output, that counts as the same.
    files : callable
        ``files(numeric) -> {name: bytes}``
    verify : callable
        ``verify(folder, numeric, run) -> Verified``; `folder` holds the files and may be written to. Raises
        MissingToolError where the tool chain is absent.
    stops_masses : bool
        The target has events for masses that stop and break away. Without them, dry friction gets a smoothed sign,
        and the export is compared with that.
    """

    about: str
    tolerance: float
    files: Callable[[NumericModel], Mapping[str, bytes]]
    verify: Verify
    stops_masses: bool = True


@dataclass(frozen=True)
class Export:
    """Files that were written, and their deviation from the native simulation.

    Attributes
    ----------
    to : str
    files : tuple of Path
    deviation : float or None
        Largest difference from the native simulation relative to the range of each output; None if not simulated.
    text : str
        One line that says so.
    good : bool
        The deviation is within the target's tolerance, from the native simulation or from the same with finer steps;
        or nothing could be compared and nothing was refused.
    """

    to: str
    files: tuple[Path, ...]
    deviation: float | None
    text: str
    good: bool


EXPORTS: Mapping[str, str] = {
    "c": "c99",
    "fmu": "fmu",
    "matlab": "matlab",
    "control": "python_control",
    "modelica": "modelica",
    "latex": "latex",
}
"""Module of `targets` that defines EXPORTER, by the name of the target."""


def exporter(to: str) -> Exporter:
    """Exporter of a target.

    Raises
    ------
    SettingsError
        If there is no such target; the message names the nearest one.
    """
    module = EXPORTS[one_of("export", to, EXPORTS)]
    found = importlib.import_module(f"brightgrey.exports.targets.{module}").EXPORTER
    assert isinstance(found, Exporter)
    return found


@checked_arguments
def export(
    model: Model,
    to: str,
    folder: str | Path,
    recording: Recording | None = None,
    *,
    f_tanh: float | None = None,
) -> Export:
    """Write `model` in another tool's form, run that tool on it and compare with the native simulation.

    Parameters
    ----------
    model : Model
    to : str
        One of `EXPORTS`.
    folder : str or Path
        Made if it is not there.
    recording : Recording, optional
        Both simulations are run on its input; without it, on a test input that brings the model to speed.
    f_tanh : float, optional
        Gain of friction's sign in s/rad (s/m) instead of the model's. With ``math.inf`` friction is exact, so that the
        exported drive rests under less than its breakaway torque.

    Returns
    -------
    Export

    Raises
    ------
    SettingsError
        For an unknown target or a folder that cannot be written to.
    ExportError
        If the tool chain refuses the files.
    """
    target = exporter(to)
    path = check_folder(folder)
    wanted = numeric_model(model, f_tanh)
    numeric = wanted if target.stops_masses else wanted.smoothed()
    run = verification_of(numeric, recording)
    files = target.files(numeric)
    with tempfile.TemporaryDirectory(prefix="brightgrey-") as place:
        work = Path(place)
        write_files(work, files)
        found, text, good = compare_with_native(work, numeric, run, target.verify, target.tolerance)
    if numeric is not wanted:
        text += f"; dry friction has a sign smoothed within {1.0 / numeric.settings.f_tanh:.2g} rad/s (m/s)"
    write_files(path, files)
    return Export(to, tuple(path / name for name in files), found, text, good)
