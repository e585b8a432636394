"""Arguments of the command line for what is chosen in a project; pure functions, the app runs exactly these."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence

from brightgrey.app.workspace.folder import toml_name
from brightgrey.app.workspace.project import KnownParameter, ProjectDocument

__all__ = [
    "export_arguments",
    "free_cores",
    "identify_arguments",
    "plan_arguments",
    "selftest_arguments",
    "shown_command",
]


def free_cores() -> int:
    """Cores for a search: all but one, which is left for the page and for whatever else runs."""
    return max(1, (os.cpu_count() or 2) - 1)


def identify_arguments(document: ProjectDocument, run: str) -> tuple[str, ...]:
    """Arguments of ``brightgrey identify``, to be run in the folder of the project.

    Parameters
    ----------
    document : ProjectDocument
    run : str
        Name of the run.
    """
    drive, search = document.drive, document.search
    words = ["identify", *(f"recordings/{toml_name(r)}" for r in document.of_use("train"))]
    for recording in document.of_use("test")[:1]:
        words += ["--test-recording", f"recordings/{toml_name(recording)}"]
    for effect in drive.required:
        words += ["--require", effect]
    for effect in drive.excluded:
        words += ["--exclude", effect]
    for known in drive.known:
        words += _known_words(known)
    if search.grammar != "drive":
        words += ["--grammar", search.grammar]
    if search.per_recording:
        words += ["--per-recording", search.per_recording]
    if search.seed:
        words += ["--seed", str(search.seed)]
    if document.check.override:
        words += ["--no-check"]
    return (*words, "--out", f"runs/{run}")


def _known_words(known: KnownParameter) -> list[str]:
    if not known.low and not known.high:
        return []
    if known.high:
        return ["--bound", f"{known.name}={known.low}:{known.high}"]
    return ["--fix", f"{known.name}={known.low}"]


def selftest_arguments(run: str) -> tuple[str, ...]:
    """Arguments of ``brightgrey selftest``."""
    return ("selftest", f"runs/{run}", "--fast")


def plan_arguments(run: str, limits_file: str | None) -> tuple[str, ...]:
    """Arguments of ``brightgrey plan``."""
    limits = ("--limits", limits_file) if limits_file else ()
    return ("plan", f"runs/{run}", *limits, "--out", f"exports/{run}/plan")


def export_arguments(run: str, target: str) -> tuple[str, ...]:
    """Arguments of ``brightgrey export``."""
    return ("export", f"runs/{run}/model.json", "--to", target, "--out", f"exports/{run}/{target}")


def shown_command(arguments: Sequence[str]) -> str:
    """Command line to be copied."""
    return shlex.join(["brightgrey", *arguments])
