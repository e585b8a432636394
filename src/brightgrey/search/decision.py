"""Decision of a search: minimal structures in their order, a verdict on every effect, certificate and ranking."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from brightgrey.arrays import positive
from brightgrey.errors import SettingsError, one_of
from brightgrey.estimation.uncertainty.estimates import estimates_of
from brightgrey.kit import Grammar, Placed, Structure, function_set
from brightgrey.search.border import Border, Refutation
from brightgrey.search.border_search import BorderRefit, BorderSearch
from brightgrey.search.certificate import Certificate, RefutedStructure
from brightgrey.search.criteria import bic
from brightgrey.search.detectability import Detectability
from brightgrey.search.evidence import Evidence, assess_effects, with_model
from brightgrey.search.fitting.refined_fit import Refined, accurate
from brightgrey.search.fitting.structure_fit import StructureFit
from brightgrey.search.lattice import Lattice, contains, has, is_excluded
from brightgrey.search.parallel import Stopped, thread_pool
from brightgrey.search.policy import BORDER, SELECTION
from brightgrey.search.progress import BorderProgress, SearchProgress
from brightgrey.search.ranking import Ranked, ranking_of
from brightgrey.search.task import IdentificationTask
from brightgrey.search.undecided.cross_validation import LeftOut, extended_unless_contradicted, missed
from brightgrey.search.undecided.held_back import first_order_verdicts, verdicts_on_masses
from brightgrey.search.undecided.open_questions import open_questions
from brightgrey.search.undecided.rivals import containing_none, rival_to_offer, rivals_among, rivals_beyond
from brightgrey.search.unexplained.doubtful import Doubts, doubts_about
from brightgrey.search.unexplained.model_error import signs_of_model_error
from brightgrey.search.verdicts import ReasonKind

__all__ = ["Decision", "decide_structures", "evidence_of"]


@dataclass(frozen=True)
class Decision:
    """Result of :func:`decide_structures`."""

    ranking: tuple[Ranked, ...]  #: The first structure, the other minimal ones, then by the criterion.
    evidence: Evidence | None  #: None if the search was stopped before its end.
    fitted: Mapping[Structure, StructureFit]

    @property
    def optima(self) -> dict[Structure, Mapping[str, float]]:
        """Best values of all structures that were fitted, SI; redundant effects stand beside the optimum without them.

        Structures without a finite simulation are left out.
        """
        refined = self.evidence.refined if self.evidence else {}
        found: dict[Structure, Mapping[str, float]] = {}
        for s, f in self.fitted.items():
            if np.isfinite(f.cost):
                own = refined.get(s if s in refined else f.equals or s)
                found[s] = {**f.values, **own.values} if own else f.values
        return found

    @property
    def best(self) -> Refined | StructureFit:
        """The first structure; the one with the best criterion if there is no evidence."""
        return self.evidence.first if self.evidence else self.fitted[self.ranking[0].structure]

    @property
    def starts(self) -> list[Mapping[str, float]]:
        """Values of the best structure, SI: its whitened optimum, and the plain one, which may lie elsewhere."""
        plain = self.fitted.get(self.best.structure)
        return [self.best.values, *([plain.values] if plain else [])]


def decide_structures(
    task: IdentificationTask,
    grammar: Grammar,
    *,
    require: Sequence[str] = (),
    exclude: Sequence[str] = (),
    how: Literal["border", "exhaustive"] = "border",
    optima: Mapping[Structure, Mapping[str, float]] | None = None,
    offered: Collection[str] = (),
    ask: bool = True,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Callable[[SearchProgress], None] | None = None,
) -> Decision:
    """Decide all structures of a grammar, and give a verdict on every effect.

    Parameters
    ----------
    task : IdentificationTask
    grammar : Grammar
    require, exclude : sequence of str
        Effects that every structure has, or that none has; masses count cumulatively.
    how : {'border', 'exhaustive'}
        Fit what the decision rests on, or all structures, and decide by the same rules.
    optima : mapping of Structure to mapping of str to float, optional
        Values of structures, SI, that a search on a like recording has found. They are refitted, other structures are
        fitted only where the decision rests on them, and nothing is tried by multistart.
    offered : collection of str
        Effects beyond the first ones of the grammar that it has offered.
    ask : bool
        Prepare what the design of the next motion needs of all that is left open.
    seed : int
    executor : concurrent.futures.Executor, optional
        The result does not depend on it. One thread by default.
    progress : callable, optional

    Returns
    -------
    Decision
        With the fits so far, if it is stopped by Ctrl-C or the executor.

    Raises
    ------
    SettingsError
        For effects that the grammar lacks, or if no structure could be simulated.
    KeyboardInterrupt, Stopped
        If it is stopped before the first fit.
    """
    names = [str(p) for p in grammar.whole.placed]
    for name in (*require, *exclude):
        if name not in names and name in map(str, function_set().placed):
            raise SettingsError(
                f"the function set '{grammar.name}' does not offer '{name}'; a given structure may have it"
            )
        one_of("effect", name, names)
    require = (*require, *_masses_with_sensors(task, grammar, exclude))
    Lattice.of(grammar.whole, require)  # says so if two of them exclude each other
    kept = [Placed.parse(name) for name in require]
    further = [p for p in grammar.further if not (is_excluded(p, exclude) or any(p.excludes(q) for q in kept))]
    wanted = [p for p in further if str(p) in require]

    def with_effects(more: Sequence[Placed], most_masses: int | None = None) -> Lattice:
        larger = grammar.offering([*wanted, *more])
        most = max(most_masses or np.inf, *(Placed.parse(e).effect.masses for e in require), 0)
        beyond = [p.name for p in larger.placed if p.effect.masses > most]
        left_out = [*exclude, *beyond]
        return Lattice.of(larger, require, [e for e in left_out if e in map(str, larger.placed)])

    known = [p for p in further if str(p) in offered]
    lattice = with_effects(known, max(s.masses for s in optima) if optima and known else None)
    tell = progress or (lambda step: None)
    with thread_pool(executor) as workers:
        total = lattice.size if how == "exhaustive" else None
        search: BorderSearch = (partial(BorderRefit, optima=optima) if optima else BorderSearch)(
            task.decimated().with_friction_of(*(optima or {}).values()),
            lattice,
            workers,
            seed,
            tuple(further),
            with_effects if further else None,
            task.recordings,
            progress=lambda stage, done, best: tell(_progress_of(search, SearchProgress(stage, done, total, best))),
        )
        search.offered = tuple(known)
        evidence = None
        try:
            border = search.run(everything=how == "exhaustive")
            evidence = evidence_of(search, border, grammar, exclude, ask=ask)
        except (KeyboardInterrupt, Stopped):
            if not search.fits.done:
                raise
        return Decision(ranking_of(search, task, evidence), evidence, search.fits.done)


def _progress_of(search: BorderSearch, step: SearchProgress) -> SearchProgress:
    """Step of a search with its best fit and its border so far."""
    best, border = search.fits.best(), search.border
    fit_percent = search.fits.fit_percent(best) if np.isfinite(best.cost) else None
    known = replace(step, fit_percent=fit_percent, values=dict(best.values))
    if border is None:
        return known
    lattice = search.lattice
    refuted = tuple(
        (lattice.lacking(r.mask), float(np.sqrt(1.0 + r.excess / positive(border.least))))
        for r in sorted(border.refuted, key=lambda r: (r.excess, r.mask))
    )
    minimal = tuple(str(lattice.structure(m)) for m in border.minimal)
    left = len(border.undecided)
    return replace(known, border=BorderProgress(len(minimal) + len(refuted), left, minimal, refuted, search.most_fits))


def _masses_with_sensors(task: IdentificationTask, grammar: Grammar, exclude: Sequence[str]) -> tuple[str, ...]:
    """Multiple-mass system with as many masses as sensors need; nothing for sensors at mass 1."""
    farthest = max(task.recordings[0].outputs, key=lambda signal: signal.mass)
    last = farthest.mass
    found = tuple(p.name for p in grammar.placed if p.effect.masses == last)
    if not found:
        raise SettingsError(f"a sensor is at mass {last}; the function set '{grammar.name}' has no drive with so many")
    for name in exclude:
        if 1 < Placed.parse(name).effect.masses <= last:
            raise SettingsError(f"'{name}' is excluded, and '{farthest.name}' is measured at mass {last}")
    return found if last > 1 else ()


def evidence_of(
    search: BorderSearch, border: Border, grammar: Grammar, exclude: Sequence[str] = (), *, ask: bool = True
) -> Evidence:
    """Verdicts and certificate of a border that a search has found; `exclude` and `ask` as in `decide_structures`."""
    predictions = LeftOut(search.fits, search.executor)
    border, certificate, doubts, rivals = _rivalled(search, border, grammar, exclude, predictions)
    lattice, circumstances, whitening = search.lattice, search.round, search.refined.whitening
    found = doubts.found
    detectability = Detectability(search.refined, circumstances, search.executor)
    instead = [rival.structure for rival in rivals]
    for rival in rivals:
        search.refined.adopt(rival)
    optional, cards = assess_effects(detectability, border, doubts, certificate, instead)
    first = _handed_back(search, detectability, predictions, doubts, optional)
    if _sought_anew(search, first, found):
        return evidence_of(search, search.settled(), grammar, exclude, ask=ask)
    held_back = verdicts_on_masses(grammar, exclude, cards)
    held_back += first_order_verdicts(detectability, found, search.more, cards, instead, search.seed)
    undecided = [c.effect for c in cards if c.verdict == "not decidable"]
    cards = tuple(with_model(card, found[0], first) for card in cards)
    asked = [first, *(s for s in (*found, *instead) if not contains(first, s))]
    leading: list[StructureFit | Refined] = [*(search.fits.done[s] for s in dict.fromkeys((first, *found))), *rivals]
    refined = search.refined.all(circumstances.threshold_of_one_test)
    status = {}
    for s in search.fits.done:
        mask = lattice.mask(s)
        adequate = any(not m & ~mask for m in border.minimal)  # also where it was fitted for a verdict only
        kind = "minimal" if mask in border.minimal else "adequate" if adequate else "refuted"
        status[s] = "undecided" if mask in search.flipped else kind
    status |= {} if any(contains(first, s) for s in found) else {first: "steady"}
    status |= dict.fromkeys(instead, "rival")
    return Evidence(
        (*(refined[s] for s in found), *rivals),
        optional,
        cards,
        refined,
        {s: bic(positive(r.deviance), whitening.samples, r.free) for s, r in refined.items()},
        status,
        replace(
            certificate,
            poor_fit=100.0 - search.fits.fit_percent(search.fits.best()) if search.fits_poorly() else None,
            fitted=len(search.fits.done),
            minimal=tuple(map(str, (*found, *instead))),
            held_back={c.effect: c.verdict for c in held_back},
        ),
        whitening.effective_samples,
        open_questions(detectability, asked, optional, undecided) if ask else None,
        held_back,
        {f.structure: percent for f, percent in zip(leading, predictions.of(leading), strict=True)},
        None if first == found[0] else search.refined.of(first),
    )


def _handed_back(
    search: BorderSearch,
    detectability: Detectability,
    predictions: LeftOut,
    doubts: Doubts,
    optional: Sequence[str],
) -> Structure:
    """The structure that is handed back: the first minimal one, or what doubts and predictions make of it."""
    added = [*optional, *(str(p) for p in doubts.found[0].placed if not has(doubts.model, str(p)))]
    return extended_unless_contradicted(
        detectability,
        predictions,
        doubts.model,
        added,
        lambda s: _is_identified(search, search.refined.of(s)),
        search.is_beyond_chance,
    )


def _sought_anew(search: BorderSearch, first: Structure, found: Sequence[Structure]) -> bool:
    """Fit a structure by multistart, once, that is handed back and lacks a part of all minimal ones.

    No verdict rests on it, so that its neighbours' optima are all that the search has tried. Known optima are only
    refitted. Returns True if it got so much better that the verdicts have to be given anew.
    """
    if isinstance(search, BorderRefit) or first in search.gone_into or any(contains(first, s) for s in found):
        return False
    search.gone_into.add(first)
    before = search.fits.done[first].cost
    search.fits.restart_many([first], BORDER.patience, search.executor)
    return before > (1.0 + search.round.material_growth) * search.fits.done[first].cost


def _rivalled(
    search: BorderSearch, border: Border, grammar: Grammar, exclude: Sequence[str], predictions: LeftOut
) -> tuple[Border, Certificate, Doubts, tuple[Refined, ...]]:
    """Border, its certificate, its minimal structures in order with the doubts about them, and their rivals.

    The effects of a rival that refutes the minimal structures, or that has fewer masses, are offered, once. Where
    effects of the minimal structures are doubtful, rivals explain as well as the structure without those.
    """
    rivals: tuple[Refined, ...] = ()
    for offering in (True, False):
        found = _in_order(search, [search.lattice.structure(m) for m in border.minimal], predictions)
        certificate = _certificate(search, border, grammar, found)
        unconfirmed = [r for r in border.refuted if search.is_unconfirmed(r, border)]
        reasons: dict[str, ReasonKind] = {e: "unconfirmed" for r in unconfirmed for e in search.lattice.lacking(r.mask)}
        doubts = Doubts(tuple(found), found[0], reasons)
        if certificate.unexplained or search.has_model_error():
            doubts = doubts_about(search.refined, search.lattice, border, found, reasons)
        doubtful = doubts.model != doubts.found[0]
        base, within = ([doubts.model], doubts.model) if doubtful else (found, None)
        detectability = Detectability(search.refined, search.round, search.executor)
        if isinstance(search, BorderRefit):
            known = rivals_among(detectability, search.beyond_lattice(), within)
            return border, certificate, doubts, containing_none(known, [*found, doubts.model])
        others = [p for p in grammar.whole.placed if p not in search.lattice.atoms and not p.effect.masses]
        more = [p for p in others if not is_excluded(p, exclude)]
        error = search.has_model_error()
        all_rivals = rivals_beyond(
            detectability, base, more, search.seed, border.refuted, with_model_error=error, known=rivals, within=within
        )
        rivals = containing_none(all_rivals, [*found, doubts.model])
        least = min(s.masses for s in base)
        chosen = rival_to_offer(detectability, found, rivals, len(more), least) if offering else None
        if chosen is None or not search.offer_rival(chosen.structure, chosen.values):
            break
        border = search.settled()
    return border, certificate, doubts, rivals


def _in_order(search: BorderSearch, minimal: Sequence[Structure], predictions: LeftOut) -> list[Structure]:
    """Minimal structures, those first of which every parameter is known, then by masses, prediction and criterion."""
    refined = search.refined.of_all(minimal)
    whitening = search.refined.whitening
    left_out = dict(zip(minimal, predictions.of([search.fits.done[s] for s in minimal]), strict=True))
    keys = {
        r.structure: (
            not _is_identified(search, r),
            r.structure.masses,
            missed(left_out[r.structure]),
            bic(positive(r.deviance), whitening.samples, r.free),
            str(r.structure),
        )
        for r in refined
    }
    return sorted(minimal, key=keys.__getitem__)


def _is_identified(search: BorderSearch, refined: Refined) -> bool:
    """True if no parameter is at a bound, and the 95 % interval of each positive one is narrower than a factor."""
    if refined.at_bound:
        return False
    problem, space = search.task.problem_and_space(refined.structure)
    found = estimates_of(problem, space, accurate(search.task).settings, search.refined.optimum(refined.structure))
    own = refined.structure.parameters
    intervals = [found.by_name[n].ci95 for n, log in zip(space.names, space.log, strict=True) if log and n in own]
    return all(low > 0.0 and high < SELECTION.wide_interval * low for low, high in intervals)


def _certificate(search: BorderSearch, border: Border, grammar: Grammar, found: Sequence[Structure]) -> Certificate:
    lattice = search.lattice
    refined = search.refined.all(search.round.threshold_of_one_test)
    costs = {lattice.mask(s): r.cost for s, r in refined.items()}
    least = min(costs.values())
    undecided = [*border.undecided, *(m for m in border.minimal if m in search.flipped)]
    return Certificate(
        grammar.name,
        lattice.size,
        len(search.fits.done),
        tuple(map(str, found)),
        tuple(
            _refuted(search, border, r, costs, least) for r in sorted(border.refuted, key=lambda r: (r.excess, r.mask))
        ),
        tuple(str(lattice.structure(m)) for m in undecided),
        _unexplained_signs(search, lattice.structure(border.best), found[0]),
        tuple(map(str, search.offered)),
    )


def _unexplained_signs(search: BorderSearch, best: Structure, simplest: Structure) -> tuple[str, ...]:
    """Signs in the residual of the best structure; without any, those in the simplest minimal one.

    What the simplest one lacks may hide behind the many effects of the best one, which explain no more by chance. What
    an effect of the lattice may explain is no sign there: it has a verdict.
    """
    floor, refined = search.refined.whitening.floor_cost, search.refined
    signs = signs_of_model_error(search.task, best, refined.optimum(best), floor)
    if signs or simplest == best:
        return signs
    return signs_of_model_error(search.task, simplest, refined.optimum(simplest), floor, search.lattice.atoms)


def _refuted(
    search: BorderSearch, border: Border, r: Refutation, costs: Mapping[int, float], least: float
) -> RefutedStructure:
    lattice = search.lattice
    within = min((cost for m, cost in costs.items() if not m & ~r.mask), default=np.inf)
    tried = lattice.structure(search.beside_refuted(r, border))
    return RefutedStructure(
        lattice.lacking(r.mask),
        str(lattice.structure(r.mask)),
        float(np.sqrt(max(within / positive(least), 1.0))),
        r.excess,
        r.threshold,
        str(tried),
        search.fits.agreeing.get(tried, 0),
    )
