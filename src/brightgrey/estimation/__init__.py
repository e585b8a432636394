"""Estimation: parameters of a given structure from recordings, with uncertainty and an outcome."""

from brightgrey.estimation.fit import Estimate, Fit, Outcome, OutputFit, Start, fit, predict
from brightgrey.estimation.leastsquares import descend_many
from brightgrey.estimation.scales import scales

__all__ = ["Estimate", "Fit", "Outcome", "OutputFit", "Start", "descend_many", "fit", "predict", "scales"]
