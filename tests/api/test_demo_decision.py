"""The demo: few fits decide all structures, and the files say on what that rests."""

import csv
import io
import json

import pytest

from brightgrey.api.demo import demo

TRUTH = "two_mass+coulomb+viscous+stribeck"


@pytest.fixture(scope="module")
def found():
    """The demo on two threads."""
    return demo(workers=2)


def test_demo__border__truth_alone_by_few_fits(found):
    certificate = found.evidence.certificate
    assert certificate.minimal == (TRUTH,)
    assert certificate.structures == 448
    assert certificate.fitted <= 60
    assert certificate.undecided == certificate.unexplained == ()
    lacking = {effect for refuted in certificate.refuted for effect in refuted.without}
    assert lacking == set(TRUTH.split("+"))
    assert all(r.excess > r.threshold and r.ratio > 1.0 for r in certificate.refuted)
    needed = {card.effect for card in found.evidence.cards if card.verdict == "needed"}
    assert needed == set(TRUTH.split("+"))


def test_demo__files__certificate_and_status(found):
    contents = found.contents()
    model = json.loads(contents["model.json"])
    assert model["schema"] == "brightgrey/model/2"
    assert model["certificate"]["minimal"] == [TRUTH] == ["+".join(model["structure"])]
    rows = list(csv.DictReader(io.StringIO(contents["ranking.csv"].decode())))
    assert (rows[0]["structure"], rows[0]["status"]) == (TRUTH, "minimal")
    for row in rows:
        wanted = set(TRUTH.split("+")[1:]) <= set(row["structure"].split("+")) and "one_mass" not in row["structure"]
        assert (row["status"] != "refuted") == wanted, row["structure"]


@pytest.mark.long
def test_demo__one_worker__same_bytes(found):
    assert demo(workers=1).contents() == found.contents()
