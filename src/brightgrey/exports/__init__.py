"""Export: model.json, ranking.csv, and measured beside simulated outputs."""

from brightgrey.model.model import Model
from brightgrey.model.ranking import Row, ranking_csv
from brightgrey.model.trace import Trace, pooled_fit

__all__ = ["Model", "Row", "Trace", "pooled_fit", "ranking_csv"]
