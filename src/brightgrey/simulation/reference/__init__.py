"""Independent solutions of high accuracy for every structure.

They use neither the construction kit's assembly nor the effects' stamps and laws, so that they check these too. They
are computed by two methods that must agree. They serve tests and benchmarks, not estimation: they are hundreds of
times slower than the kernel.
"""

from brightgrey.simulation.reference.solution import (
    Method,
    SolverAgreement,
    UnsettledError,
    compare_solvers,
    reference,
)

__all__ = ["Method", "SolverAgreement", "UnsettledError", "compare_solvers", "reference"]
