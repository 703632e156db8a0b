"""Cross-validation of multibody engines on a bicycle that rides hands-free in circles inside a bowl.

The names in `__all__` and the modules on the reference pages are public; everything else may change in any release.
Names are imported when they are first used: ``import velodrome`` by itself loads no library.

Examples
--------
>>> import velodrome
>>> run = velodrome.run("q2-plus", engines=["exudyn"], duration=0.2)
>>> list(run.metrics)
['reference', 'exudyn']
>>> run.trajectories["exudyn"].q.shape
(21, 9)
"""

from importlib import import_module as _import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .engines.engine import Engine as Engine
    from .engines.engine import Problem as Problem
    from .engines.engine import Settings as Settings
    from .engines.engine import Trajectory as Trajectory
    from .engines.engine import UnsuitableProblem as UnsuitableProblem
    from .engines.guard import EngineError as EngineError
    from .engines.registry import engine_names as engine_names
    from .engines.registry import load_engine as load_engine
    from .reference.bicycle import Bicycle as Bicycle
    from .reference.bowls import Cone as Cone
    from .reference.bowls import Sphere as Sphere
    from .reference.bowls import Torus as Torus
    from .reference.height_field import HeightField as HeightField
    from .reference.inputs import Inputs as Inputs
    from .reference.profile import PolynomialProfile as PolynomialProfile
    from .reference.profile import SplineProfile as SplineProfile
    from .reference.stability import Linearisation as Linearisation
    from .reference.stability import linearise as linearise
    from .reference.surface import Paraboloid as Paraboloid
    from .reference.surface import Plane as Plane
    from .reference.surface import Surface as Surface
    from .reference.surface import SurfaceOfRevolution as SurfaceOfRevolution
    from .reference.surface import surface_function as surface_function
    from .scenarios.error import MissingMotionError as MissingMotionError
    from .scenarios.error import ScenarioError as ScenarioError
    from .scenarios.motions import CircularSolution as CircularSolution
    from .scenarios.motions import CriticalShapes as CriticalShapes
    from .scenarios.motions import FamilyCurve as FamilyCurve
    from .scenarios.motions import SolutionFamilies as SolutionFamilies
    from .scenarios.scenario import library_names as scenario_names
    from .scenarios.session import MetricsTable as MetricsTable
    from .scenarios.session import Run as Run
    from .scenarios.session import circular as circular
    from .scenarios.session import critical as critical
    from .scenarios.session import families as families
    from .scenarios.session import load as load
    from .scenarios.session import run as run

    __version__: str

__all__ = [
    "Bicycle",
    "CircularSolution",
    "Cone",
    "CriticalShapes",
    "Engine",
    "EngineError",
    "FamilyCurve",
    "HeightField",
    "Inputs",
    "Linearisation",
    "MetricsTable",
    "MissingMotionError",
    "Paraboloid",
    "Plane",
    "PolynomialProfile",
    "Problem",
    "Run",
    "ScenarioError",
    "Settings",
    "SolutionFamilies",
    "Sphere",
    "SplineProfile",
    "Surface",
    "SurfaceOfRevolution",
    "Torus",
    "Trajectory",
    "UnsuitableProblem",
    "__version__",
    "circular",
    "critical",
    "engine_names",
    "families",
    "linearise",
    "load",
    "load_engine",
    "run",
    "scenario_names",
    "surface_function",
]

# Modules of the public names.
_HOMES = {
    ".engines.engine": ("Engine", "Problem", "Settings", "Trajectory", "UnsuitableProblem"),
    ".engines.guard": ("EngineError",),
    ".engines.registry": ("engine_names", "load_engine"),
    ".reference.bicycle": ("Bicycle",),
    ".reference.bowls": ("Cone", "Sphere", "Torus"),
    ".reference.height_field": ("HeightField",),
    ".reference.inputs": ("Inputs",),
    ".reference.profile": ("PolynomialProfile", "SplineProfile"),
    ".reference.stability": ("Linearisation", "linearise"),
    ".reference.surface": ("Paraboloid", "Plane", "Surface", "SurfaceOfRevolution", "surface_function"),
    ".scenarios.error": ("MissingMotionError", "ScenarioError"),
    ".scenarios.motions": ("CircularSolution", "CriticalShapes", "FamilyCurve", "SolutionFamilies"),
    ".scenarios.session": ("MetricsTable", "Run", "circular", "critical", "families", "load", "run"),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}


if not TYPE_CHECKING:  # with __getattr__, type checkers would accept any name

    def __getattr__(name: str) -> object:
        """Import a public name when it is first used."""
        if name == "__version__":
            from importlib.metadata import version

            value: object = version("velodrome")
        elif name == "scenario_names":
            value = _import_module(".scenarios.scenario", __name__).library_names
        elif name in _HOME:
            value = getattr(_import_module(_HOME[name], __name__), name)
        else:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted(__all__)
