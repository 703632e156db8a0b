"""The public face in a notebook: a kernel runs the cells, as Jupyter does, and what they show is looked at."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

nbclient = pytest.importorskip("nbclient")
nbformat = pytest.importorskip("nbformat")
pytest.importorskip("ipykernel")

CELLS = (
    "import velodrome\nrun = velodrome.run('q2-plus', engines=['mujoco-native'], duration=0.2)\nrun",
    "run.metrics",
    "run.metrics.to_pandas()[['position_error_max', 'max_slip']]",
    "%matplotlib inline\nrun.trajectories['mujoco-native'].to_pandas()['lean'].plot();",
    "run.show()",
    "velodrome.circular(alpha=0.005, rear_rate=18.0, family=2).lyapunov_stable",
)


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """What each cell shows: text by its kind."""
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in CELLS])
    folder = tmp_path_factory.mktemp("notebook")
    # The default kernel's file is that of whatever environment was set up last.
    client = nbclient.NotebookClient(
        notebook, timeout=120, kernel_name="python3", resources={"metadata": {"path": folder}}
    )
    client.execute()
    assert not list(Path(folder).iterdir())
    outputs = [[output for output in cell.outputs if output.output_type != "stream"] for cell in notebook.cells]
    return [output[0]["data"] if output else {} for output in outputs]


def test_a_run_and_its_metrics_are_tables(shown: list[dict[str, Any]]) -> None:
    for page in (shown[0], shown[1]):
        assert "<th>mujoco-native</th>" in page["text/html"]
        assert "mujoco-native" in page["text/plain"]
    assert "Q2, disturbed to the right" in shown[0]["text/html"]
    assert 'class="dataframe"' in shown[2]["text/html"]


def test_a_ride_is_plotted(shown: list[dict[str, Any]]) -> None:
    assert len(shown[3]["image/png"]) > 1000


def test_the_recording_is_reruns_widget(shown: list[dict[str, Any]]) -> None:
    pytest.importorskip("rerun_notebook")
    assert "application/vnd.jupyter.widget-view+json" in shown[4]


def test_a_motion_is_found(shown: list[dict[str, Any]]) -> None:
    assert shown[5]["text/plain"] == "True"
