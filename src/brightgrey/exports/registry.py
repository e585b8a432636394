"""What an export is: files made of a model, and a check of them by the tool chain they are made for."""

from __future__ import annotations

import importlib
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from brightgrey.arrays import Array
from brightgrey.errors import SettingsError, unknown_name
from brightgrey.exports.external_tools import ExportError, MissingToolError
from brightgrey.exports.numeric_model import NumericModel, numeric_model
from brightgrey.exports.verification import VerificationRun, deviation, verification_of
from brightgrey.model.files import check_folder, write_files
from brightgrey.model.model import Model
from brightgrey.recordings import Recording

__all__ = ["EXPORTS", "Export", "Exporter", "Verified", "export"]


class Verified(NamedTuple):
    """Response of the exported files, by their own tool chain.

    Attributes
    ----------
    y : ndarray or None
        Outputs, shape (outputs, samples), in the recording's units; None where the tool chain can only check form.
    by : str
        What was done, e.g. ``gcc, compiled and run``.
    """

    y: Array | None
    by: str


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
        ``files(scheme) -> {name: bytes}``
    verify : callable
        ``verify(folder, scheme, trial) -> Verified``; `folder` holds the files and may be written to. Raises
        MissingToolError where the tool chain is absent.
    """

    about: str
    tolerance: float
    files: Callable[[NumericModel], Mapping[str, bytes]]
    verify: Callable[[Path, NumericModel, VerificationRun], Verified]


@dataclass(frozen=True)
class Export:
    """What has been written, and how it compares.

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


# Module of this package that defines EXPORTER, by target.
EXPORTS: Mapping[str, str] = {
    "c": "c99",
    "fmu": "fmu",
    "matlab": "matlab",
    "control": "python_control",
    "modelica": "modelica",
    "latex": "latex",
}


def exporter(to: str) -> Exporter:
    """Exporter of a target.

    Raises
    ------
    SettingsError
        Names the nearest one.
    """
    if to not in EXPORTS:
        raise SettingsError(unknown_name("export", to, EXPORTS))
    found = importlib.import_module(f"brightgrey.exports.targets.{EXPORTS[to]}").EXPORTER
    assert isinstance(found, Exporter)
    return found


def export(model: Model, to: str, folder: str | Path, recording: Recording | None = None) -> Export:
    """Write `model` in another tool's form, run that tool on it and compare with the native simulation.

    Parameters
    ----------
    model : Model
    to : str
        One of `EXPORTS`.
    folder : str or Path
        Made if it is not there.
    recording : Recording, optional
        Its input is what both simulations are run on; without it, a test input that brings the model to speed.

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
    scheme = numeric_model(model)
    trial = verification_of(scheme, recording)
    files = target.files(scheme)
    with tempfile.TemporaryDirectory(prefix="brightgrey-") as place:
        work = Path(place)
        write_files(work, files)
        found, text, good = _compared(target, work, scheme, trial)
    write_files(path, files)
    return Export(to, tuple(path / name for name in files), found, text, good)


def _compared(
    target: Exporter, work: Path, scheme: NumericModel, trial: VerificationRun
) -> tuple[float | None, str, bool]:
    try:
        verified = target.verify(work, scheme, trial)
    except MissingToolError as missing:
        return None, f"not verified: {missing}", True
    if verified.y is None:
        return None, f"form checked, not simulated: {verified.by}", True
    if verified.y.shape != trial.y.shape:
        raise ExportError(f"{verified.by}: outputs of shape {verified.y.shape}; {trial.y.shape} are wanted")
    found = deviation(trial.y, verified.y)
    text = f"deviation {found:.1e} of range on {trial.of} ({verified.by})"
    good = found <= target.tolerance
    if not good and deviation(trial.fine, verified.y) <= target.tolerance:
        exact = deviation(trial.fine, verified.y)
        text += f"; {exact:.1e} from a native simulation with a hundredth of the tolerances: the error is brightgrey's"
        good = True
    if not good:
        text += f"; up to {target.tolerance:.0e} was to be expected"
        if trial.sensitive > 1e-10:
            text += f", but a change of the input by 1e-10 already makes {trial.sensitive:.1e}"
    return found, text, good
