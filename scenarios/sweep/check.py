"""Whether runs of a sweep are possible, and whether its file or a point is at fault if they are not."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from ...engines.engine import REFERENCE, UnsuitableProblem
from ..error import ScenarioError
from ..run import configure_engine
from ..scenario import (
    Scenario,
    error_place,
    join_complaints,
    list_complaints,
    list_engine_faults,
    make_start,
    set_keys,
)

# Types of pydantic's errors that a value of the right type may have.
_OF_A_POINT = ("value_error", "greater_than", "greater_than_equal", "less_than", "less_than_equal", "finite_number")
_CHECKED = 50  # kinds of runs whose engine is asked beforehand; each may need a motion, a tenth of a second


def prune_settings(data: dict[str, Any], engine: str) -> dict[str, Any]:
    """Return a scenario's data with the settings of this engine and the reference only."""
    engines = data.get("engines", {})
    if not isinstance(engines, Mapping):
        return data
    return data | {"engines": {name: engines[name] for name in (REFERENCE, engine) if name in engines}}


def canonical_text(data: Any) -> str:
    """Return JSON that is the same for equal data."""
    return json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)


class SweepFileError(ScenarioError):
    """Error of the sweep file itself, not of one of its points.

    Attributes
    ----------
    complaints : list of str
    """

    def __init__(self, complaints: Sequence[str]) -> None:
        super().__init__(join_complaints(complaints))
        self.complaints = list(complaints)


class PointChecker:
    """Validate runs, each part only once.

    Parameters
    ----------
    base : dict
        The base scenario as resolved.
    drawn : collection of str
        Dotted keys of values that are not in the file but drawn.
    """

    def __init__(self, base: dict[str, Any], drawn: Collection[str]) -> None:
        self._base, self._drawn = base, drawn
        self._settings: set[str] = set()
        self._kinds: dict[str, str | None] = {}

    def find_refusal(self, engine: str, changes: Mapping[str, Any], ask_engine: bool) -> str | None:
        """Validate a run; return why it is refused, or None if it is not.

        Parameters
        ----------
        engine : str
        changes : mapping
            Values by dotted key.
        ask_engine : bool
            Whether to ask the engine too, which may need a motion.

        Raises
        ------
        SweepFileError
            If the file is wrong.
        """
        try:
            data = prune_settings(set_keys(self._base, changes), engine)
        except ValueError as error:
            raise SweepFileError([str(error)]) from error
        try:
            self._validate(engine, data, changes, ask_engine)
        except SweepFileError:
            raise
        except ScenarioError as error:
            return str(error)
        return None

    def _validate(self, engine: str, data: dict[str, Any], changes: Mapping[str, Any], ask_engine: bool) -> None:
        stated = [key for key in changes if key not in self._drawn]
        try:
            scenario = Scenario.model_validate(data)
        except ValidationError as error:
            complaints = list_complaints(error)
            if _is_file_error(error, stated):
                raise SweepFileError([*complaints, *list_engine_faults(data.get("engines"))]) from error
            raise ScenarioError(join_complaints(complaints)) from error
        resolved = scenario.model_dump(mode="json", exclude_none=True)
        # Not a set, whose order differs between processes.
        for name in dict.fromkeys((engine, REFERENCE)):
            self._configure(name, resolved["engines"].get(name, {}), stated)
        if ask_engine:
            self._check_engine(engine, scenario, resolved)

    def _configure(self, engine: str, settings: dict[str, Any], stated: Collection[str]) -> None:
        text = canonical_text([engine, settings])
        if text not in self._settings:
            try:
                configure_engine(engine, settings)
            except ScenarioError as error:
                if _is_file_error(error.__cause__, stated, ("engines", engine)):
                    raise SweepFileError([str(error)]) from error
                raise
            self._settings.add(text)

    def _check_engine(self, engine: str, scenario: Scenario, data: Mapping[str, Any]) -> None:
        """Raise an error if the engine refuses the run, such as a step that does not divide the output interval."""
        kind = canonical_text([engine, data["engines"].get(engine, {}), data["simulation"]])
        if kind not in self._kinds and len(self._kinds) < _CHECKED:
            self._kinds[kind] = _why_refused(engine, scenario)
        if refused := self._kinds.get(kind):
            raise ScenarioError(refused)


def _why_refused(engine: str, scenario: Scenario) -> str | None:
    """Return why an engine refuses a run, None if it does not; errors that only the run can show do not count."""
    try:
        problem = make_start(scenario).problem
    except ScenarioError:
        return None  # a motion that does not exist becomes a row
    library, settings = configure_engine(engine, scenario.engines.get(engine, {}))
    try:
        library.check(problem, settings)
    except UnsuitableProblem:
        return None  # as does ground that does not suit the engine
    except ValueError as error:
        return f"engines.{engine}: {error}"
    except Exception:
        return None  # as does an engine that breaks
    return None


def _is_file_error(cause: BaseException | None, stated: Collection[str], place: tuple[str, ...] = ()) -> bool:
    """Return whether an error is one of the sweep file itself and not of one of its points.

    Errors of a point are values that contradict one another and drawn values out of range. Errors of the file are
    unknown names, values of another type, and values out of range that the file itself states.
    """
    if not isinstance(cause, ValidationError):
        return True
    for error in cause.errors():
        where = ".".join((*place, *error_place(error)))
        ours = any(where == key or where.startswith(f"{key}.") for key in stated)
        if ours or error["type"] not in _OF_A_POINT:
            return True
    return False
