"""Systems whose outputs are their states."""

from dataclasses import replace

import numpy as np

from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import assemble


def all_states(structure, values):
    """System whose outputs are all states, then all their derivatives."""
    s = assemble(structure, values, E.f_tanh)
    n = len(s.states)
    names = (*s.state_names, *(f"{name}'" for name in s.state_names))
    # Rows of x only say which state; rows of x' are told by derivative_rows.
    C = np.concatenate([np.broadcast_to(np.eye(n).reshape(n, n, *(1,) * len(s.batch)), s.A.shape), s.A])
    D = np.concatenate([np.zeros_like(s.B), s.B])
    rows = (*(-1,) * n, *range(n))
    return replace(s, C=C, D=D, outputs=names, derivative_rows=rows)
