"""What a check or an advice says of the command line is said of the app's own fields."""

import pytest

from brightgrey.app.stages.option_places import in_app_words


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("keep these by --decimate 3", "keep these by “Use every Nth sample” 3"),
        ("turn its sign, --input-gain -1", "turn its sign, “Factor of the input” -1"),
        ("--no-check goes on", "--no-check goes on"),
        (
            "'--per-recording J1,f_v' lets them differ",
            "“Values that may differ between the recordings” J1,f_v lets them differ",
        ),
        ("a -- b", "a -- b"),
    ],
)
def test_in_app_words__options__are_fields_of_the_app(text, expected):
    assert in_app_words(text) == expected
