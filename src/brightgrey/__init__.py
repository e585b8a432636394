"""Brightgrey finds out which physical effects are at work in an electric drive train, and how large they are.

A user imports from this package and from no other: ``from brightgrey import identify, read_recording``. The author of
an effect imports from :mod:`brightgrey.effects`. No function here has the name of a package inside brightgrey, because
the import of that package would put itself in the function's place.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from brightgrey.version import __version__

if TYPE_CHECKING:
    from brightgrey.api.control import Design, analyse, design
    from brightgrey.api.demo import demo
    from brightgrey.api.fault_detection import Watch, watch
    from brightgrey.api.fleet.fleet import Fleet, Member, identify_fleet
    from brightgrey.api.fleet.manifest import Axis, read_manifest
    from brightgrey.api.identification import identify
    from brightgrey.api.inspection import Inspection, inspect
    from brightgrey.api.planning import plan
    from brightgrey.api.result import Result
    from brightgrey.api.resumable import StoredRun, identify_resumable, list_runs
    from brightgrey.api.self_test import selftest, write_selftest
    from brightgrey.api.simulation import Simulation, read_for, simulate
    from brightgrey.control.linear.analysis import Analysis
    from brightgrey.control.linear.margins import Compensator, Margins
    from brightgrey.errors import BrightgreyError, RecordingError, SettingsError, StructureError
    from brightgrey.exports.external_tools import ExportError
    from brightgrey.exports.registry import Export, export
    from brightgrey.kit.structure import Structure
    from brightgrey.model.model import Model, load_model
    from brightgrey.planning.plan import Plan
    from brightgrey.recordings.checks.check import CheckResult
    from brightgrey.recordings.checks.checkup import Checkup, check
    from brightgrey.recordings.read import read_recording, read_stretches, recording_from
    from brightgrey.recordings.recording import Recording, Signal
    from brightgrey.recordings.recording_toml import read_recordings
    from brightgrey.runs.caching_executor import Budget
    from brightgrey.runs.status import RunStatus
    from brightgrey.runs.store import RunError
    from brightgrey.search.genetic.settings import GeneticSettings
    from brightgrey.self_test.schema import SelfTest

__all__ = [
    "Analysis",
    "Axis",
    "BrightgreyError",
    "Budget",
    "CheckResult",
    "Checkup",
    "Compensator",
    "Design",
    "Export",
    "ExportError",
    "Fleet",
    "GeneticSettings",
    "Inspection",
    "Margins",
    "Member",
    "Model",
    "Plan",
    "Recording",
    "RecordingError",
    "Result",
    "RunError",
    "RunStatus",
    "SelfTest",
    "SettingsError",
    "Signal",
    "Simulation",
    "StoredRun",
    "Structure",
    "StructureError",
    "Watch",
    "__version__",
    "analyse",
    "check",
    "demo",
    "design",
    "export",
    "identify",
    "identify_fleet",
    "identify_resumable",
    "inspect",
    "list_runs",
    "load_model",
    "plan",
    "read_for",
    "read_manifest",
    "read_recording",
    "read_recordings",
    "read_stretches",
    "recording_from",
    "selftest",
    "simulate",
    "watch",
    "write_selftest",
]

_HOME = {
    "api.control": ("Design", "analyse", "design"),
    "api.demo": ("demo",),
    "api.fault_detection": ("Watch", "watch"),
    "api.fleet.fleet": ("Fleet", "Member", "identify_fleet"),
    "api.fleet.manifest": ("Axis", "read_manifest"),
    "api.identification": ("identify",),
    "api.inspection": ("Inspection", "inspect"),
    "api.planning": ("plan",),
    "api.result": ("Result",),
    "api.resumable": ("StoredRun", "identify_resumable", "list_runs"),
    "api.self_test": ("selftest", "write_selftest"),
    "api.simulation": ("Simulation", "read_for", "simulate"),
    "control.linear.analysis": ("Analysis",),
    "control.linear.margins": ("Compensator", "Margins"),
    "errors": ("BrightgreyError", "RecordingError", "SettingsError", "StructureError"),
    "exports.external_tools": ("ExportError",),
    "exports.registry": ("Export", "export"),
    "kit.structure": ("Structure",),
    "model.model": ("Model", "load_model"),
    "planning.plan": ("Plan",),
    "recordings.checks.check": ("CheckResult",),
    "recordings.checks.checkup": ("Checkup", "check"),
    "recordings.read": ("read_recording", "read_stretches", "recording_from"),
    "recordings.recording": ("Recording", "Signal"),
    "recordings.recording_toml": ("read_recordings",),
    "runs.caching_executor": ("Budget",),
    "runs.status": ("RunStatus",),
    "runs.store": ("RunError",),
    "search.genetic.settings": ("GeneticSettings",),
    "self_test.schema": ("SelfTest",),
}
_MODULE = {name: f"brightgrey.{module}" for module, names in _HOME.items() for name in names}


def __getattr__(name: str) -> Any:
    """Import a name on its first use (PEP 562), because ``brightgrey --help`` must not wait for numba and scipy."""
    if name not in _MODULE:
        raise AttributeError(f"module 'brightgrey' has no attribute '{name}'")
    value = getattr(importlib.import_module(_MODULE[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
