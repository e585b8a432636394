"""Boxes of a layout are those of a browser, so that what the other tests compare is what is seen."""

import numpy as np
import pytest

from brightgrey.drawing.items import Label, PlacedSymbol
from brightgrey.drawing.layout import lay_out
from brightgrey.drawing.svg import svg
from support.drawn_drives import random_drive

ROUNDED = 1.05  # pixels: glyphs are put on whole ones
BOXES = """kind => [...document.querySelectorAll(`svg > ${kind}`)].map(e => {
  const b = e.getBBox();
  return [b.x, b.y, b.x + b.width, b.y + b.height]; })"""


@pytest.mark.parametrize("width", [376.0, 1100.0])
def test_boxes__of_40_random_drives__hold_what_a_browser_draws(browser, width):
    page = browser.new_page()
    for seed in range(1000, 1040):
        layout = lay_out(random_drive(seed)[1], width)
        page.set_content(f'<body style="margin: 0">{svg(layout)}</body>')
        seen = []
        for element, kind in (("text", Label), ("g", PlacedSymbol)):
            own = np.array([item.box for item in layout.items if isinstance(item, kind)]).reshape(-1, 4)
            drawn = np.array(page.evaluate(BOXES, element)).reshape(-1, 4)
            assert len(drawn) == len(own)
            assert (drawn[:, :2] >= own[:, :2] - ROUNDED).all(), seed
            assert (drawn[:, 2:] <= own[:, 2:] + ROUNDED).all(), seed
            seen.append(drawn)
        a = np.concatenate(seen)
        shared = np.minimum(a[:, None, 2:], a[None, :, 2:]) - np.maximum(a[:, None, :2], a[None, :, :2])
        assert ((shared > ROUNDED).all(axis=-1).sum(axis=1) == 1).all(), seed  # each overlaps itself only
    page.close()
