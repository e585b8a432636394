"""Independent solutions of high accuracy for every structure of the paper's grammar.

They use neither the construction kit's assembly nor the effects' stamps and laws, so that they check these
too, and they come by two methods that must agree. Meant for tests and benchmarks, not for estimation: they
are hundreds of times slower than the kernel and know the paper's function set only.
"""

from brightgrey.simulation.reference.solution import (
    Method,
    SolverAgreement,
    UnsettledError,
    compare_solvers,
    reference,
)

__all__ = ["Method", "SolverAgreement", "UnsettledError", "compare_solvers", "reference"]
