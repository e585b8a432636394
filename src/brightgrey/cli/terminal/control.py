"""Linear analysis, control design and fault detection in the terminal."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.table import Table
from rich.text import Text

from brightgrey.cli.terminal.overview import plain_table
from brightgrey.cli.terminal.results import as_json, screen

if TYPE_CHECKING:
    from brightgrey.api.control import Design
    from brightgrey.api.fault_detection import Watch
    from brightgrey.control.linear.analysis import Analysis
    from brightgrey.control.linear.controllability import Controllability
    from brightgrey.control.linear.margins import Margins

__all__ = ["show_analysis", "show_design", "show_watch"]


def _finite_or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _margins(found: Margins) -> dict[str, Any]:
    return {
        "stable": found.stable,
        "gain": _finite_or_none(found.gain),
        "gain_down": found.gain_down,
        "phase": _finite_or_none(found.phase),
        "delay": _finite_or_none(found.delay),
        "sensitivity": found.sensitivity,
        "crossover": found.crossover,
    }


def _margins_line(found: Margins) -> str:
    stable = "stable" if found.stable else "UNSTABLE"
    return (
        f"{stable}, gain margin {found.gain:.3g}, phase margin {found.phase:.3g}°, "
        f"delay margin {1e3 * found.delay:.3g} ms, sensitivity peak {found.sensitivity:.3g}, "
        f"crossover {found.crossover / (2 * math.pi):.3g} Hz"
    )


def _rank_and_distance(found: Controllability) -> dict[str, Any]:
    return {"rank": found.rank, "order": found.order, "distance": found.distance}


def show_analysis(found: Analysis, margins: Margins | None, *, quiet: bool, json: bool) -> None:
    """Print a linear analysis."""
    if json:
        as_json(
            {
                "speed": found.operating_point.speed,
                "input": found.operating_point.u,
                "position": found.operating_point.position,
                "sticking_torque": found.sticking_torque,
                "contact": found.operating_point.contact_mode.contact,
                "states": found.states,
                "stability": found.stability,
                "poles": [[p.real, p.imag] for p in found.poles.tolist()],
                "resonances": [s._asdict() for s in found.resonances],
                "antiresonances": {
                    o: [s._asdict() for s in found.antiresonances(i)] for i, o in enumerate(found.outputs)
                },
                "controllability": _rank_and_distance(found.controllability),
                "observability": _rank_and_distance(found.observability),
                "dead_time": found.dead_time,
                "margins": None if margins is None else _margins(margins),
            }
        )
        return
    if quiet:
        return
    out, point = screen(), found.operating_point
    place = f", position {point.position:.4g}" if found.depends_on_position else ""
    out.print(
        Text(
            f"{found.stability} at speed {point.speed:.4g}, input {point.u:.4g}{place} (SI)",
            style="bold",
        )
    )
    if found.sticking_torque:
        out.print(f"at rest the drive sticks within ±{found.sticking_torque:.4g} (SI) of this input; here it slides")
    out.print(_pole_table(found))
    for i, name in enumerate(found.outputs):
        dips = ", ".join(f"{s.frequency:.4g} Hz (damping {s.damping:.3g})" for s in found.antiresonances(i))
        out.print(f"antiresonances of {name}: {dips or 'none'}")
    for word, reach in (("controllable", found.controllability), ("observable", found.observability)):
        out.print(f"{word}: {reach.rank} of {reach.order} states, distance to losing one {reach.distance:.2g}")
    if found.dead_time:
        out.print(f"dead time: {1e3 * found.dead_time:.4g} ms")
    if margins is not None:
        out.print(f"with the controller: {_margins_line(margins)}", soft_wrap=True)


def _pole_table(found: Analysis) -> Table:
    """Poles, of each pair the upper one."""
    rows = plain_table("pole in 1/s", "frequency in Hz >", "damping >")
    for pole in found.poles.tolist():
        if pole.imag > 0.0:
            rows.add_row(
                f"{pole.real:.4g} ± {pole.imag:.4g}i",
                f"{abs(pole) / (2 * math.pi):.4g}",
                f"{-pole.real / abs(pole):.3g}",
            )
        elif pole.imag == 0.0:
            rows.add_row(f"{pole.real:.4g}", "", "")
    return rows


def show_design(found: Design, *, quiet: bool, json: bool) -> None:
    """Print suggested gains and their stability margins."""
    c, s = found.cascade, found.state_feedback
    contacts = found.places
    if json:
        as_json(
            {
                "cascade": {
                    "position": c.position_gain,
                    "speed": c.speed_gain,
                    "reset": c.reset_time,
                    "speed_margins": {k: _margins(m) for k, m in zip(contacts, c.speed_margins, strict=True)},
                    "position_margins": {k: _margins(m) for k, m in zip(contacts, c.position_margins, strict=True)},
                },
                **_state_control(found),
                "notes": found.notes,
            }
        )
        return
    if quiet:
        return
    out = screen()
    out.print(Text("cascade", style="bold"))
    out.print(_gains(found.cascade_gains()), soft_wrap=True)
    for kind, inner, outer in zip(contacts, c.speed_margins, c.position_margins, strict=True):
        out.print(f"speed loop ({kind}): {_margins_line(inner)}", soft_wrap=True)
        out.print(f"whole cascade ({kind}): {_margins_line(outer)}", soft_wrap=True)
    observed = found.observer_margins
    if s is not None and found.observer_gain is not None and observed is not None:
        out.print(Text("state feedback of speed with integral action", style="bold"))
        out.print(f"gains: {_gains(found.feedback_gains())}", soft_wrap=True)
        out.print(f"loop opened at the input: {_margins_line(s.margins(found.delay))}", soft_wrap=True)
        out.print(Text("Kalman filter that estimates these states from a measured speed", style="bold"))
        pairs = zip(s.analysis.states, found.observer_gain[:, 0].tolist(), strict=True)
        out.print(f"gains (SI): {', '.join(f'{name} {value:.4g}' for name, value in pairs)}", soft_wrap=True)
        out.print(f"state feedback on the estimated states: {_margins_line(observed)}", soft_wrap=True)
    for note in found.notes:
        out.print(f"- {note}", soft_wrap=True)


def _state_control(found: Design) -> dict[str, Any]:
    """State feedback and Kalman filter for JSON; None each where there is none."""
    s, observed = found.state_feedback, found.observer_margins
    if s is None or found.observer_gain is None or observed is None or found.noise is None:
        return {"state_control": None, "observer": None}
    return {
        "state_control": {
            "states": s.analysis.states,
            "gains": s.K.tolist(),
            "integral": s.integral,
            "poles": [[p.real, p.imag] for p in s.poles.tolist()],
            "margins": _margins(s.margins(found.delay)),
        },
        "observer": {
            "states": s.analysis.states,
            "gains": found.observer_gain[:, 0].tolist(),
            "disturbance": float(np.ravel(found.noise.torque)[0]),
            "speed_noise": float(np.ravel(found.noise.outputs)[0]),
            "margins": _margins(observed),
        },
    }


def _gains(rows: list[tuple[str, float, str]]) -> str:
    return ", ".join(f"{name} {value:.4g} {unit}" for name, value, unit in rows)


def show_watch(found: Watch, *, quiet: bool, json: bool) -> None:
    """Print the findings of fault detection."""
    from brightgrey.api.fault_detection import innovation_correlation

    nis = float(found.filtered.nis.mean()) / found.filtered.innovations.shape[2]
    if json:
        as_json(
            {
                "findings": [
                    {
                        "subject": f.subject,
                        "parameters": f.parameters,
                        "verdict": f.verdict,
                        "factor": f.factor,
                        "ci95": f.ci95,
                        "confidence": f.probability,
                    }
                    for f in found.findings
                ],
                "innovations": {"size": nis, "correlation": innovation_correlation(found.filtered)},
            }
        )
        return
    if quiet:
        return
    out = screen()
    for finding in found.findings:
        out.print(Text(finding.text, style="bold" if finding.verdict == "changed" else ""), soft_wrap=True)
    if not found.findings:
        out.print("this structure has no parameter whose change would be a fault")
    out.print(
        f"innovations: {nis:.3g} times the expected variance, "
        f"correlation of neighbouring samples {innovation_correlation(found.filtered):.2f}"
    )
