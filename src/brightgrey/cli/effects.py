"""``brightgrey effects``: the function set, read from the declarations."""

from __future__ import annotations

from brightgrey.cli.options.common import Json

__all__ = ["effects"]


def effects(json: Json = False) -> None:
    """List the effects a model may consist of: equation, parameters, units.

    Units are those of a rotary drive with torque in N m; those of a result follow from its recording.
    """
    from brightgrey.cli.terminal import results as show
    from brightgrey.effects import registry
    from brightgrey.recordings.units.signals import Units

    units = Units()
    rows = [
        {
            "name": effect.name,
            "number": effect.number,
            "title": effect.title,
            "equation": effect.equation,
            "about": effect.about,
            "where": effect.where,
            "source": effect.source,
            "parameters": [
                {
                    "name": parameter.symbol,
                    "unit": units.of(parameter.dimension)[0],
                    "dimension": parameter.dimension._asdict(),
                    "about": parameter.about,
                }
                for parameter in effect.parameters
            ],
        }
        for effect in registry().values()
    ]
    if json:
        show.as_json(rows)
    else:
        show.effects(rows)
