"""From the repetitions of a self-test to its counts and sentences."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from brightgrey.estimation.problem.segments import segments
from brightgrey.kit import Placed, Structure
from brightgrey.kit.in_words import effect_in_words, structure_in_words
from brightgrey.model.schema import ValuePart
from brightgrey.recordings import Recording, Units
from brightgrey.search.lattice import contains
from brightgrey.self_test.repetition import Repetition
from brightgrey.self_test.schema import CountPart, NoisePart, RecoveredPart, SelfTest, SimulatedDrivePart
from brightgrey.self_test.sensor_noise import SensorNoise
from brightgrey.self_test.simulated_drives import SimulatedDrive

__all__ = ["drive_part", "noise_parts", "self_test_sentences", "stable_verdicts"]


def noise_parts(recordings: Sequence[Recording], noises: Sequence[SensorNoise]) -> tuple[NoisePart, ...]:
    """Noise of every output, in the outputs' units."""
    parts = []
    for noise, part in zip(noises, segments(recordings), strict=True):
        signal = part.recording.outputs[part.output]
        std = float(np.sqrt(noise.residual.autocovariance(1)[0]))
        parts.append(
            NoisePart(
                recording=part.recording.name,
                output=signal.name,
                unit=signal.unit,
                std=signal.factor * std,
                order=noise.residual.order,
                resolution=signal.factor * noise.step,
            )
        )
    return tuple(parts)


def drive_part(drives: Sequence[SimulatedDrive], repetitions: Sequence[Repetition], units: Units) -> SimulatedDrivePart:
    """Counts of one drive.

    Parameters
    ----------
    drives : sequence of SimulatedDrive
        The drive, or its variants that were drawn in turn.
    repetitions : sequence of Repetition
    units : Units
        Of the recordings.
    """
    first, n = drives[0], len(repetitions)
    name = str(first.structure)
    noticed = sum(
        bool(r.minimal) and not any(contains(first.without, Structure.parse(m)) for m in r.minimal)
        for r in repetitions
        if first.without
    )
    effects = list(dict.fromkeys(e for r in repetitions for e in r.verdicts))
    return SimulatedDrivePart(
        kind=first.kind,
        structure=name,
        effect=first.effect or None,
        size=_in_units(first.structure, {n: abs(v) if len(drives) > 1 else v for n, v in first.size.items()}, units),
        found_again=CountPart.counted(sum(r.structure == name for r in repetitions), n),
        among_minimal=CountPart.counted(sum(name in r.minimal for r in repetitions), n),
        noticed=CountPart.counted(noticed, n) if first.effect else None,
        failed=sum(bool(r.error) for r in repetitions),
        structures=dict(Counter(r.structure for r in repetitions if r.structure).most_common()),
        verdicts={
            e: dict(sorted(Counter(r.verdicts[e] for r in repetitions if e in r.verdicts).items())) for e in effects
        },
        parameters=_recovered(drives, repetitions, units),
    )


def _in_units(structure: Structure, values: Mapping[str, float], units: Units) -> dict[str, ValuePart]:
    """Values in the units of the recordings."""
    out = {}
    for name, value in values.items():
        unit, factor = units.of(structure.parameters[name].dimension)
        out[name] = ValuePart(value=factor * value, unit=unit)
    return out


def _recovered(
    drives: Sequence[SimulatedDrive], repetitions: Sequence[Repetition], units: Units
) -> dict[str, RecoveredPart]:
    """Errors of the parameters against their intervals, where the structure was found again."""
    structure, out = drives[0].structure, {}
    for name, declared in structure.parameters.items():
        covered, errors = [], []
        for draw, r in enumerate(repetitions):
            if r.structure != str(structure) or name not in r.estimates:
                continue
            truth, (value, std, low, high) = drives[draw % len(drives)].values[name], r.estimates[name]
            if low is not None and high is not None:
                covered.append(low <= truth <= high)
            if std:
                errors.append((value - truth) / std)
        if not covered and not errors:
            continue
        unit, factor = units.of(declared.dimension)
        out[name] = RecoveredPart(
            value=factor * drives[0].values[name],
            unit=unit,
            covered=CountPart.counted(sum(covered), len(covered)),
            mean_error=float(np.mean(errors)) if errors else None,
            spread=float(np.std(errors, ddof=1)) if len(errors) > 1 else None,
        )
    return out


def stable_verdicts(verdicts: Mapping[str, str], repetitions: Sequence[Repetition]) -> dict[str, CountPart]:
    """Count, for each effect, how often the verdict of the recording came out again."""
    return {
        effect: CountPart.counted(sum(r.verdicts.get(effect) == verdict for r in repetitions), len(repetitions))
        for effect, verdict in verdicts.items()
    }


def self_test_sentences(found: SelfTest) -> tuple[str, ...]:
    """A few sentences on the counts of a self-test."""
    own, said = found.found, []
    if found.verdicts:
        said.append(f"From simulated recordings of the found model, its structure came out again in {own.found_again}.")
        other = next((name for name in own.structures if name != own.structure), None)
        if other:
            words = structure_in_words(Structure.parse(other))
            said.append(f"The most frequent other structure, in {own.structures[other]} of {found.draws}: {words}.")
        said += [
            f"This structure would be among the minimal ones, if it were the truth, in {d.among_minimal}:"
            f" {structure_in_words(Structure.parse(d.structure))}."
            for d in found.drives
            if d.kind == "equivalent"
        ]
        said += _on_verdicts(found)
    if own.parameters:
        covered = [part.covered for part in own.parameters.values()]
        total = CountPart.counted(sum(c.hits for c in covered), sum(c.of for c in covered))
        said.append(f"The 95 % intervals of the parameters hold the simulated value in {total.hits} of {total.of}.")
    failed = sum(drive.failed for drive in found.drives)
    if failed:
        said.append(f"{failed} of {sum(d.found_again.of for d in found.drives)} draws gave no result.")
    if found.found_only:
        said.append("Only the found model was simulated: no equivalent structure, and no effect that is not needed.")
    if found.fast:
        said.append(
            "This fast test begins at the optima of the identification. It shows what noise does to the result,"
            " and leaves out that a search may miss an optimum."
        )
    return tuple(said)


def _all_draws(found: SelfTest) -> str:
    return f"all {found.draws} draws" if found.draws > 1 else "the one draw"


def _on_verdicts(found: SelfTest) -> list[str]:
    """Sentences on the verdicts that changed, and on the effects that were not detected."""
    fragile = {e: c for e, c in found.stable.items() if c.hits < c.of}
    if not fragile:
        said = [f"Every verdict was the same in {_all_draws(found)}."]
    else:
        shown = ", ".join(f"{effect_in_words(Placed.parse(e))} in {c.hits} of {c.of}" for e, c in fragile.items())
        said = [f"The noise changed some verdicts, which came out again in these draws: {shown}."]
    at_size = [d for d in found.drives if d.noticed is not None and d.effect]
    if at_size and all(d.noticed and d.noticed.hits == d.noticed.of for d in at_size):
        said.append(
            f"Each effect that is not needed was noticed in {_all_draws(found)} at the least size that matters."
        )
    elif at_size:
        shown = ", ".join(
            f"{effect_in_words(Placed.parse(d.effect or ''))} in {d.noticed.hits} of {d.noticed.of}"
            for d in at_size
            if d.noticed
        )
        said.append(
            f"Each effect that is not needed was simulated at the least size that matters, and was noticed: {shown}."
        )
    return said
