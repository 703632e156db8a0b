"""What documents of families say of parts that can be ridden, and how they are drawn."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.bowls import Torus
from velodrome.reference.families import Family, trace
from velodrome.reference.rideability import OBSTACLES
from velodrome.reference.sections import SectionEnd
from velodrome.reports.figures.solution_curve import make_curves
from velodrome.scenarios.motions import families as motions_families

BICYCLE = Bicycle()


def make_end(curve: Family, k: int) -> SectionEnd:
    return SectionEnd("hopf", curve.equations.motion(curve.points[k].unknowns), 1j, curve.points[k], k)


def test_sections_are_ridden_wholly_partly_or_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a trough of 0.5 m radius a rim ends the part that can be ridden; three sections are laid around its end."""
    curve = trace(BICYCLE, Torus(3.0, 0.5), 2, 0.05)
    monkeypatch.setattr(motions_families, "follow_modes", lambda family: np.zeros((len(family.points), 7), complex))
    plain = motions_families.examine_curve(curve)
    (last,) = np.flatnonzero(plain.physical[:-1] & ~plain.physical[1:]).tolist()
    places = [(last - 6, last - 2), (last - 1, last + 2), (last + 3, last + 6)]
    sections = [(make_end(curve, low), make_end(curve, high)) for low, high in places]
    monkeypatch.setattr(motions_families, "stable_sections", lambda _: sections)
    document: dict[str, Any] = motions_families.examine_curve(curve).as_json()
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert [section["rideable"] for section in document["stable_sections"]] == ["wholly", "partly", "not"]
    whole, part, none = (section["rideable_parts"] for section in document["stable_sections"])
    assert whole[0]["rear_rate"] == document["stable_sections"][0]["rear_rate"]
    assert part[0]["cause"] == ["hopf", "rear rim touches twice"]
    assert part[0]["rear_rate"][1] == pytest.approx(document["rideable_parts"][0]["rear_rate"][1], rel=1e-12)
    assert none == []
    points = document["points"]
    assert points["physical"] == [not reasons for reasons in points["unphysical_because"]]
    assert {reason for reasons in points["unphysical_because"] for reason in reasons} <= set(OBSTACLES)
    friction = [value is not None for value in points["required_friction"]]
    assert friction == [not any("pushed" in why for why in reasons) for reasons in points["unphysical_because"]]
    (drawn,) = make_curves([document], BICYCLE.front_wheel_radius)
    kinds = [kind for *_, kind in drawn.pieces()]
    assert kinds[:2] == ["ridden", "touching"]
    assert set(kinds) == {"ridden", "touching", "pulled"}
    assert len(drawn.stable) == 2
    assert len(drawn.unridden_stable) == 2
    assert drawn.stable[1][1] == pytest.approx(drawn.ridden[0][1], abs=1e-6)
