"""The app runs the command line that it shows."""

from brightgrey.app.jobs.arguments import (
    export_arguments,
    identify_arguments,
    plan_arguments,
    selftest_arguments,
    shown_command,
)
from brightgrey.app.workspace.project import (
    AxisChoice,
    CheckDecision,
    KnownParameter,
    ProjectDocument,
    SearchChoice,
    StoredRecording,
)


def recording(number, use):
    return StoredRecording(file=f"recording-{number}-0a.csv", label="x", sha256="", size=1, use=use)


def test_identify_arguments__everything_chosen__all_of_it_is_said():
    document = ProjectDocument(
        name="a",
        title="A",
        drive=AxisChoice(
            least_masses=2,
            most_masses=3,
            certain=("coulomb",),
            absent=("delay",),
            known=(
                KnownParameter(name="J1", low="0.1"),
                KnownParameter(name="c1", low="5", high="9"),
                KnownParameter(name="d1"),
            ),
        ),
        recordings=(recording(1, "train"), recording(2, "unused"), recording(3, "test"), recording(4, "train")),
        check=CheckDecision(override=True),
        search=SearchChoice(grammar="paper", seed=7, per_recording="f_v,M_C"),
    )
    assert shown_command(identify_arguments(document, "run-2")) == (
        "brightgrey identify recordings/recording-1-0a.toml recordings/recording-4-0a.toml"
        " --test-recording recordings/recording-3-0a.toml --require two_mass --require coulomb"
        " --exclude four_mass --exclude delay --fix J1=0.1 --bound c1=5:9 --grammar paper --per-recording f_v,M_C"
        " --seed 7 --no-check --out runs/run-2"
    )


def test_identify_arguments__nothing_chosen__are_the_defaults():
    document = ProjectDocument(name="a", title="A", recordings=(recording(1, "train"),))
    expected = ("identify", "recordings/recording-1-0a.toml", "--out", "runs/run-1")
    assert identify_arguments(document, "run-1") == expected


def test_other_arguments__name_the_run():
    assert selftest_arguments("run-1") == ("selftest", "runs/run-1", "--fast")
    assert plan_arguments("run-1", None) == ("plan", "runs/run-1", "--out", "exports/run-1/plan")
    assert plan_arguments("run-1", "limits.toml")[2:4] == ("--limits", "limits.toml")
    assert export_arguments("run-1", "c")[1:4] == ("runs/run-1/model.json", "--to", "c")
