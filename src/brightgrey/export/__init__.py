"""Export: model.json, ranking.csv, and measured beside simulated outputs."""

from brightgrey.export.model import Model
from brightgrey.export.ranking import Row, ranking_csv
from brightgrey.export.trace import Trace, pooled_fit

__all__ = ["Model", "Row", "Trace", "pooled_fit", "ranking_csv"]
