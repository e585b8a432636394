"""Rivals: other effects that explain as well in the place of one, and what is said of both."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import pytest

from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import PAPER, Placed, Structure, function_set, grammar_named
from brightgrey.search.border import Refutation
from brightgrey.search.border_search import BorderSearch
from brightgrey.search.decision import decide_structures
from brightgrey.search.detectability import Detectability
from brightgrey.search.lattice import Lattice
from brightgrey.search.undecided.open_choice import open_choice
from brightgrey.search.undecided.rivals import rivals_beyond
from support.searches import minimal, simulated_task, verdicts

VALUES = {"J1": 0.008, "J2": 0.006, "c1": 200.0, "d1": 0.1, "f_v@2": 0.006}
REST = ("three_mass", "stribeck", "current_control", "delay", "backlash", "gravity")


def decision(structure, values, optima=None, exclude=REST):
    own = {name: values[name] for name in Structure.parse(structure).parameters}
    task = simulated_task(structure, own, E.torque(), 0.005 * E.speed, dt=E.dt, f_tanh=200.0, step=1e-3)
    return decide_structures(task, grammar_named("drive"), exclude=exclude, optima=optima)


@pytest.fixture(scope="module")
def at_second_mass():
    return decision("two_mass+viscous@2", VALUES)


def test_viscous_friction_on_a_stiff_shaft__explained_at_mass_1_too__needed_at_none(at_second_mass):
    certificate = at_second_mass.evidence.certificate
    said = {**verdicts(at_second_mass), **certificate.held_back}
    assert said["viscous"] == said["viscous@2"] == "not decidable"
    assert {"two_mass+viscous", "two_mass+viscous@2"} <= set(minimal(at_second_mass))


def test_viscous_friction_on_a_stiff_shaft__reason__names_what_is_needed_in_one_place(at_second_mass):
    cards = {c.effect: c for c in (*at_second_mass.evidence.cards, *at_second_mass.evidence.held_back)}
    for effect in ("viscous", "viscous@2"):
        reason = cards[effect].reason
        assert reason.startswith(
            "One of several effects is needed, and this recording does not say which. Among them are "
        )
        assert "viscous friction at mass 1" in reason
        assert "viscous friction at mass 2" in reason


def test_rivals__effect_at_mass_1_excluded__it_is_in_none():
    found = decision("two_mass+viscous@2", VALUES, exclude=(*REST, "viscous", "pendulum", "ground_spring"))
    assert all("viscous" not in Structure.parse(s).names for s in minimal(found))


def test_rivals__no_two_contain_each_other(at_second_mass):
    found = [Structure.parse(s) for s in minimal(at_second_mass)]
    assert len(set(found)) == len(found)
    assert not any(a != b and a.masses <= b.masses and a.beside <= b.beside for a in found for b in found)


def test_rivals_beyond__doubtful_effect_left_out__as_good_as_the_structure_without_it():
    """Gravity explains much, so that nothing without it is adequate; where it is doubtful that does not count."""
    truth = {**VALUES, "f_v": 0.006, "M_G": 0.1}
    own = {n: truth[n] for n in Structure.parse("two_mass+viscous+gravity").parameters}
    task = simulated_task("two_mass+viscous+gravity", own, E.torque(), 0.005 * E.speed, dt=E.dt, f_tanh=200.0)
    lattice = Lattice.of(
        PAPER, ("two_mass",), [e for e in PAPER.places if e not in ("one_mass", "two_mass", "viscous", "gravity")]
    )
    model, effects = PAPER.parse("two_mass+viscous"), [Placed("viscous", 2)]
    with ThreadPoolExecutor(1) as workers:
        search = BorderSearch(task, lattice, workers)
        search.fits.add([lattice.structure(mask) for mask in lattice.masks()], workers)
        search.refined.begin_round(PAPER.parse("two_mass+viscous+gravity"))
        detectability = Detectability(search.refined, search.round, workers)
        of_model = partial(rivals_beyond, detectability, [model], effects, 0, with_model_error=True)
        assert of_model() == []
        assert [str(r.structure) for r in of_model(within=model)] == ["two_mass+viscous@2"]


def rivals_of(found, truth, values, *further, noise=0.001, with_model_error=True, refuted=()):
    """Rivals with further effects of the only structure that explains, where some are known to explain less."""
    task = simulated_task(truth, values, E.torque(), noise * E.speed, dt=E.dt, f_tanh=200.0)
    own, kit = function_set().parse(found), function_set().whole.placed
    without = list(map(function_set().parse, refuted))
    kept = {"one_mass", *(str(p) for s in (own, *without) for p in s.placed)}
    lattice = Lattice.of(function_set(), (), [str(p) for p in kit if str(p) not in kept])
    with ThreadPoolExecutor(1) as workers:
        search = BorderSearch(task, lattice, workers)
        search.fits.add([own], workers)
        for s in without:
            search.fits.fit_from(s, values, workers)
        search.refined.begin_round(own)
        detectability = Detectability(search.refined, search.round, workers)
        effects = [Placed(*p) for p in further]
        gone = [Refutation(lattice.mask(s), 2.0, 1.0, lattice.mask(s)) for s in without]
        rivals = rivals_beyond(detectability, [own], effects, 0, gone, with_model_error=with_model_error)
    return [str(r.structure) for r in rivals]


@pytest.mark.long
def test_rivals_beyond__load_at_the_other_mass__takes_the_constant_load_over():
    """At its own mass it is a pendulum alone, whose period lies far from that which it has beside gravity."""
    values = {"J1": 0.0085, "J2": 0.0066, "c1": 147.0, "d1": 0.027, "M_C@2": 3.9, "G": 0.18, "k": 0.165, "phi_0": -1.5}
    truth = "two_mass+coulomb@2+pendulum"
    assert truth in rivals_of("two_mass+coulomb@2+gravity+pendulum@2", truth, values, ("pendulum", 1))


@pytest.mark.parametrize(("G", "k", "phi_0", "c_g"), [(2.0, 0.12, -3.0, 0.03), (2.1, 0.1, 2.5, 0.05)])
def test_rivals_beyond__constant_load_beside_a_pendulum__may_be_a_spring_to_the_ground(G, k, phi_0, c_g):
    """A pendulum contains both on a short way. With the other one its period is another, which no slope tells."""
    truth = "one_mass+viscous+ground_spring+pendulum"
    values = {"J1": 0.02, "f_v": 0.006, "c_g": c_g, "G": G, "k": k, "phi_0": phi_0}
    assert truth in rivals_of("one_mass+viscous+gravity+pendulum", truth, values, ("ground_spring", 1))


@pytest.mark.parametrize("with_model_error", [False, True])
def test_rivals_beyond__two_effects_together__take_the_place_of_one_unless_there_is_model_error(with_model_error):
    """Viscous friction grows with the speed and Stribeck friction fades, so that they pass for Coulomb friction."""
    truth, values = "one_mass+viscous+stribeck", {"J1": 0.022, "f_v": 0.01, "M_S": 0.3, "omega_S": 10.0}
    further = ("viscous", 1), ("stribeck", 1)
    found = rivals_of("one_mass+coulomb", truth, values, *further, noise=0.004, with_model_error=with_model_error)
    assert found == ([] if with_model_error else [truth])


@pytest.mark.parametrize("with_model_error", [False, True])
def test_rivals_beyond__friction_at_mass_2_of_a_refuted_structure__explains_better_unless_there_is_model_error(
    with_model_error,
):
    """With one mass, Stribeck friction follows how the shaft winds up. No exchange beside one mass leads to two."""
    values = {"J1": 0.01, "J2": 0.004, "c1": 400.0, "d1": 0.1, "f_v": 0.03, "M_C@2": 1.0}
    truth = "two_mass+coulomb@2+viscous"
    found = rivals_of(
        "one_mass+coulomb+viscous+stribeck",
        truth,
        values,
        ("coulomb", 2),
        noise=0.01,
        with_model_error=with_model_error,
        refuted=["two_mass+coulomb+viscous"],
    )
    assert found == ([] if with_model_error else [truth])


def test_rivals_beyond__refuted_structure_with_an_effect_at_its_second_mass__explains_no_better_than_one_mass_is_none():
    values = {"J1": 0.01, "J2": 0.004, "c1": 1500.0, "d1": 0.2, "M_C": 1.0, "f_v": 0.0005}
    options = {"noise": 0.01, "with_model_error": False, "refuted": ["two_mass+coulomb"]}
    assert rivals_of("one_mass+coulomb+viscous", "two_mass+coulomb+viscous", values, ("viscous", 2), **options) == []


def test_certificate__effect_with_a_rival__says_among_what_the_residual_grows(at_second_mass):
    said = " ".join(at_second_mass.evidence.certificate.sentences())
    assert "Without viscous friction the residual is" in said
    assert "whatever else of the effects offered is allowed" in said
    assert "Not offered, and as good in the place of others: " in said


def test_refit__known_rivals__are_fitted_and_no_others_sought(at_second_mass):
    optima = {r.structure: r.values for r in at_second_mass.evidence.minimal}
    again = decision("two_mass+viscous@2", VALUES, optima)
    assert set(minimal(again)) == set(minimal(at_second_mass))


def test_viscous_friction_on_a_soft_shaft__its_place_shows__is_offered_and_needed_there():
    found = decision("two_mass+viscous@2", {**VALUES, "c1": 60.0, "d1": 0.05})
    assert found.evidence.certificate.offered == ("viscous@2",)
    assert minimal(found) == ["two_mass+viscous@2"]
    assert verdicts(found)["viscous@2"] == "needed"


def test_rivals__an_effect_with_more_parameters_explains_as_well__is_none():
    values = {"J1": 0.016, "f_v": 0.016, "c_g": 0.15}
    found = decision("one_mass+viscous+ground_spring", values, exclude=REST[:-1])
    assert minimal(found) == ["one_mass+viscous+ground_spring"]


@pytest.mark.long
def test_rivals__stribeck_friction_that_fades_at_no_speed__is_none():
    """It is Coulomb friction at the upper bound of its speed. Viscous friction may make up for a lower speed."""
    values = {"J1": 0.0005, "J2": 0.024, "c1": 0.6, "d1": 0.001, "M_C@2": 0.6}
    found = minimal(decision("two_mass+coulomb@2", values, exclude=REST[:-1]))
    assert "two_mass+coulomb@2" in found
    assert "two_mass+stribeck@2" not in found


@pytest.mark.long
def test_spring_to_the_ground__position_dependent_load_found_first__is_its_rival():
    values = {"J1": 0.016, "M_C": 0.26, "f_v": 0.016, "M_S": 1.0, "omega_S": 6.8, "c_g": 0.15}
    structure = "one_mass+coulomb+viscous+stribeck+ground_spring"
    task = simulated_task(structure, values, E.torque(), 0.001 * E.speed, dt=E.dt, f_tanh=200.0, step=1e-3)
    excluded = ("three_mass", "current_control", "delay", "backlash")
    assert structure in minimal(decide_structures(task, grammar_named("drive"), exclude=excluded))


def beside_position_dependent_load(**options):
    """Truth and decision where a position-dependent load is offered in the place of a constant one and a spring."""
    values = {"J1": 0.016, "f_v": 0.016, "M_G": 0.3, "c_g": 0.15}
    structure = "one_mass+viscous+gravity+ground_spring"
    task = simulated_task(structure, values, E.torque(), 0.001 * E.speed, dt=E.dt, f_tanh=200.0, step=1e-3)
    excluded = ("two_mass", "current_control", "delay", "stribeck", "coulomb")
    task = replace(task, **options)
    return structure, decide_structures(task, grammar_named("drive"), exclude=excluded, offered=("pendulum",))


@pytest.mark.long
def test_constant_load_and_spring__position_dependent_load_found_first__are_its_rival():
    structure, found = beside_position_dependent_load()
    assert {structure, "one_mass+viscous+pendulum"} <= set(minimal(found))
    assert verdicts(found)["pendulum"] == "not decidable"


def test_spring__position_dependent_load_is_its_rival__is_not_needed_for_sure():
    values = {"J1": 0.016, "f_v": 0.016, "G": 3.0, "k": 0.05, "phi_0": 0.0}
    task = simulated_task("one_mass+viscous+pendulum", values, E.torque(), 0.001 * E.speed, dt=E.dt, f_tanh=200.0)
    known = {"one_mass+viscous+ground_spring": {**values, "c_g": 0.15}, "one_mass+viscous+pendulum": values}
    optima = {function_set().parse(name): own for name, own in known.items()}
    excluded = ("two_mass", "current_control", "delay", "stribeck", "coulomb")
    grammar = grammar_named("drive")
    found = decide_structures(task, grammar, exclude=excluded, optima=optima, offered=("ground_spring",))
    assert set(minimal(found)) == set(known)
    assert verdicts(found)["ground_spring"] == "not decidable"


@pytest.mark.long
def test_constant_load_and_spring__spring_held_at_a_value_that_fits_nothing__are_no_rival():
    assert minimal(beside_position_dependent_load(fixed={"c_g": 5.0})[1]) == ["one_mass+viscous+pendulum"]


@pytest.mark.parametrize(
    ("structures", "names"),
    [
        (
            ("two_mass+viscous", "two_mass+viscous@2", "two_mass+pendulum"),
            ("viscous friction at mass 1", "viscous friction at mass 2", "a position-dependent load"),
        ),
        (("two_mass+coulomb+viscous", "two_mass+coulomb+gravity"), ("viscous friction", "a constant load")),
    ],
)
def test_open_choice__all_that_lack_it_have_another__all_are_named(structures, names):
    reason = open_choice([Structure.parse(s) for s in structures], "viscous")
    assert reason.kind == "one of several"
    assert reason.names == names


def test_open_choice__one_lacks_it_without_another__structures_are_named():
    reason = open_choice([Structure.parse(s) for s in ("two_mass+viscous", "two_mass")], "viscous")
    assert reason.kind == "equivalent"
    assert reason.names == ("two masses with viscous friction", "two masses")


def test_open_questions__rival__is_set_against_the_structure_that_was_found(at_second_mass):
    asked = at_second_mass.evidence.questions.questions
    tied = {frozenset((q.truth, q.rival.structure)): q for q in asked if q.kind == "tied"}
    question = tied[frozenset(minimal(at_second_mass)[:2])]
    assert len(question.effects) == 2
    assert set(question.rival.values) >= set(Structure.parse(question.rival.structure).parameters)
