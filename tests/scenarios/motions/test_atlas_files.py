"""The files of the atlas."""

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.sealing import contents
from velodrome.engines.storage import METADATA_KEY
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.surface import Paraboloid
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.motions import follow_families
from velodrome.scenarios.motions.atlas import UNITS, make_atlas
from velodrome.scenarios.scenario import BicycleFile

BENCHMARK = BicycleFile("benchmark", Bicycle())


def test_an_atlas_is_written_whole(tmp_path: Path) -> None:
    done: list[float] = []
    out = tmp_path / "new" / "atlas"
    document = make_atlas(BENCHMARK, out, {}, size=2000, largest=0.02, progress=done.append)
    assert done == sorted(done)
    assert done[-1] == 1.0
    assert sorted(path.name for path in out.iterdir()) == [
        "atlas.html",
        "atlas.parquet",
        "boundaries.json",
        "growth.png",
        "stable.png",
    ]
    assert contents(out / "boundaries.json") == document
    page = (out / "atlas.html").read_text(encoding="utf-8")
    assert "Lyapunov stable motions: family 2 up to the last bowl; family 4 up to alpha 0.00929505 1/m." in page
    table = pq.read_table(out / "atlas.parquet")
    assert table.num_rows == document["motions"]
    for name, unit in UNITS.items():
        assert table.schema.field(name).metadata == {b"unit": unit.encode()}
    facts = json.loads((table.schema.metadata or {})[METADATA_KEY])
    assert facts["bicycle"]["wheelbase"] == Bicycle().wheelbase
    values = {name: table.column(name).to_numpy() for name in table.column_names}
    assert sorted(set(values["alpha"])) == document["alphas"]
    assert np.array_equal(values["stable"], values["growth_rate"] < 0)
    pushed = (values["normal_force_rear"] > 0) & (values["normal_force_front"] > 0)
    # On so shallow bowls no rim touches twice, and the benchmark's wheels are apart at every steer.
    assert np.array_equal(values["physical"], pushed)
    assert facts["obstacles"][:2] == ["rear wheel not pushed", "front wheel not pushed"]
    codes = (values["normal_force_rear"] <= 0) + 2 * (values["normal_force_front"] <= 0)
    assert np.array_equal(values["obstacles"], codes)
    assert np.array_equal(np.isfinite(values["required_friction"]), pushed)
    # The stable motions of a family are one piece of its curve at every alpha.
    for boundary in document["stable"]:
        for alpha in boundary["alpha"]:
            inside = values["stable"] & (values["family"] == boundary["family"]) & (values["alpha"] == alpha)
            assert np.all(np.diff(values["index"][inside]) == 1)
    assert {boundary["family"] for boundary in document["stable"]} == {2, 4}
    for boundary in document["stable"]:
        for side in (boundary["start"], boundary["end"]):
            assert {len(values) for values in side.values()} == {len(boundary["alpha"])}
            # Whatever is not defined has a reason.
            for name in ("criticality", "first_lyapunov_coefficient", "amplitude_slope", "amplitude_slope_error"):
                assert [value is None for value in side[name]] == [bool(why) for why in side["undefined_because"]]
    (degenerate,) = [(boundary["family"], point) for boundary in document["stable"] for point in boundary["bautin"]]
    assert (degenerate[0], degenerate[1]["side"]) == (4, "end")
    assert degenerate[1]["alpha"] == pytest.approx(0.009106767627, abs=1e-11)
    assert page.count('title="Bautin point of family 4"') == 1


@pytest.mark.slow
def test_an_atlas_says_within_what_circles_are_stable(tmp_path: Path) -> None:
    """Half-way in energy along family 2's section the bound is that of `velodrome families` there."""
    document = make_atlas(BENCHMARK, tmp_path, {}, size=2000, largest=0.02, within=True)
    assert (tmp_path / "within.png").stat().st_size > 10_000
    for boundary in document["stable"]:
        rows = boundary["within"]
        assert [row["alpha"] for row in rows] == [
            alpha for alpha in document["alphas"] if alpha in boundary["alpha"][1:]
        ]
        for row in rows:
            assert all(0 < bound < 0.1 for bound in row["stable_within"])
            at = boundary["alpha"].index(row["alpha"])
            low, high = sorted([boundary["start"]["rear_rate"][at], boundary["end"]["rear_rate"][at]])
            assert all(low < rate < high for rate in row["rear_rate"])
    row = next(boundary for boundary in document["stable"] if boundary["family"] == 2)["within"][-1]
    (curve,) = [
        curve
        for curve in follow_families(Bicycle(), Paraboloid(row["alpha"]), within=True).curves
        if curve.numbers[:1] == (2,)
    ]
    assert curve.bounds is not None
    known = curve.bounds[0].circles[4].stable_within
    assert row["stable_within"][4] == pytest.approx(known, abs=1e-9)


@pytest.mark.parametrize(
    ("size", "largest", "words"),
    [(10, 1.0, "--size 10"), (2000, 0.0, "--largest 0.0"), (2000, 1.5, "--largest 1.5"), (2000, np.nan, "--largest")],
)
def test_impossible_atlases_are_refused(tmp_path: Path, size: int, largest: float, words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        make_atlas(BENCHMARK, tmp_path / "atlas", {}, size, largest)
    assert not (tmp_path / "atlas").exists()


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ScenarioError, match="cannot be made"):
        make_atlas(BENCHMARK, tmp_path / "file" / "atlas", {}, 2000)
