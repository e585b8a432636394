"""Drawings of models as users hold them, and as LaTeX."""

import re
import subprocess
from shutil import which

import pytest

from brightgrey.drawing.layout import lay_out
from brightgrey.drawing.picture import DriveDrawing
from brightgrey.errors import SettingsError
from brightgrey.exports.latex_picture import latex_picture
from support.drawn_drives import random_drive


def test_drawing__notebook_file_and_page_show_the_same(tmp_path):
    drawing = DriveDrawing(random_drive(3)[1])
    drawing.save(tmp_path / "drive.svg")
    saved = (tmp_path / "drive.svg").read_text(encoding="utf-8").rstrip("\n")
    assert saved == drawing._repr_svg_() == drawing.svg()
    assert saved in drawing.html()


def test_drawing__folder_that_is_not_there__is_named(tmp_path):
    with pytest.raises(SettingsError, match=r"drive\.svg"):
        DriveDrawing(random_drive(3)[1]).save(tmp_path / "none" / "drive.svg")


@pytest.mark.skipif(which("pdflatex") is None, reason="no pdflatex")
def test_latex_picture__of_random_drives__is_set_without_a_package_and_fits_the_page(tmp_path):
    pictures = "\\newpage\n".join(latex_picture(lay_out(random_drive(seed)[1], 640.0)) for seed in range(12))
    head = "\\documentclass[a4paper]{article}\n\\usepackage[T1]{fontenc}\n\\usepackage[margin=25mm]{geometry}\n"
    text = f"{head}\\begin{{document}}\n{pictures}\n\\end{{document}}\n"
    (tmp_path / "drives.tex").write_text(text, encoding="utf-8")
    command = ("pdflatex", "-interaction=nonstopmode", "-halt-on-error", "drives.tex")
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, check=False)
    said = done.stdout.decode(errors="replace")
    assert done.returncode == 0, said[-2000:]
    assert "Overfull" not in said
    assert re.search(r"\((\d+) pages", said)[1] == "12"
