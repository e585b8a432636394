"""Construction kit (paper section 2.2): structures, grammars, and assembly into state-space form."""

from brightgrey.kit.assembly import OUTPUTS, assemble, slowest_resonance
from brightgrey.kit.grammar import GRAMMARS, PAPER, Grammar, function_set, grammar_named
from brightgrey.kit.state_space import Linear, StateSpace
from brightgrey.kit.structure import Placed, Structure

__all__ = [
    "GRAMMARS",
    "OUTPUTS",
    "PAPER",
    "Grammar",
    "Linear",
    "Placed",
    "StateSpace",
    "Structure",
    "assemble",
    "function_set",
    "grammar_named",
    "slowest_resonance",
]
