"""The public face: recordings and a structure in, a model with its uncertainty out.

Everything here speaks the recording's units, as people and model.json do; inside it is SI.
"""

from brightgrey.api.demo import demo
from brightgrey.api.identification import identify
from brightgrey.api.result import Result
from brightgrey.api.simulation import Simulation, read_for, simulate
from brightgrey.exports.registry import Export, export
from brightgrey.model.model import Model
from brightgrey.recordings import Recording, read_recording

__all__ = [
    "Export",
    "Model",
    "Recording",
    "Result",
    "Simulation",
    "demo",
    "export",
    "identify",
    "read_for",
    "read_recording",
    "simulate",
]
