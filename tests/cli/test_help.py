"""Help pages: options under headings, readable in narrow windows and pipes, with examples that would run."""

import re
import shlex

import pytest
import typer

from brightgrey.cli import app

COMMANDS = typer.main.get_command(app).commands
HEADINGS = ["Options", "Recording", "Structure", "Estimation", "Genetic programming", "Run", "Output"]
FIRST = [
    *("--input", "--output", "--time", "--unit", "--structure", "--search", "--bound", "--fix"),
    *("--test-recording", "--out"),
]


@pytest.fixture
def page(call, monkeypatch):
    """Help page of a command at a given width."""

    def read(command, width=80):
        monkeypatch.setenv("COLUMNS", str(width))
        done = call(*command, "--help")
        assert (done.code, done.err) == (0, "")
        return done.out

    return read


@pytest.mark.parametrize("command", [[], *([name] for name in COMMANDS)], ids=lambda c: "".join(c) or "program")
def test_help__fits_into_60_columns_and_names_every_option(page, command):
    text = page(command, 60)
    assert max(map(len, text.splitlines())) <= 60
    assert "\x1b" not in text
    assert not re.search(r"[─│╭╰]", text)
    for parameter in COMMANDS[command[0]].params if command else ():
        for name in parameter.opts if parameter.param_type_name == "option" else ():
            assert re.search(rf"^  (-\w, )?{re.escape(name)}\b", text, re.MULTILINE), name
            assert parameter.help, name


def test_help_of_identify__shows_the_ten_most_used_options_first_and_groups_the_others(page):
    text = page(["identify"])
    assert [line[:-1] for line in text.splitlines() if line[:-1] in HEADINGS] == HEADINGS
    shown = re.findall(r"^  (?:-\w, )?(--[\w-]+)", text, re.MULTILINE)
    assert shown[:10] == FIRST


@pytest.mark.parametrize("name", list(COMMANDS))
def test_help__ends_with_two_examples_that_the_command_accepts(page, name):
    text = page([name], 70)
    _, _, end = text.partition("Examples:\n")
    lines = end.replace("\\\n", "").splitlines()
    assert len(lines) == 2
    for line in lines:
        program, command, *arguments = shlex.split(line)
        assert (program, command) == ("brightgrey", name)
        COMMANDS[name].make_context(name, arguments)  # raises for what it does not know


def test_program__without_arguments_shows_its_help(call):
    done = call()
    assert done.code == 2
    assert "Commands:" in done.out
    assert "identify" in done.out
    assert done.err == ""
