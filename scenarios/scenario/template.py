"""Scenarios that differ from one base in a few values: only the tables with changes are validated again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from ..error import ScenarioError
from .schema import CircularTable, InputsTable, Perturbation, Scenario, Simulation, UprightTable, validate_scenario
from .surfaces import SurfaceTable
from .table import set_keys

# Tables that are valid or not by themselves, whatever stands in the others.
_TABLES: dict[str, Callable[[Any], Any]] = {
    "surface": TypeAdapter(SurfaceTable).validate_python,
    "motion": TypeAdapter(Annotated[CircularTable | UprightTable, Field(discriminator="kind")]).validate_python,
    "perturbation": Perturbation.model_validate,
    "simulation": Simulation.model_validate,
    "inputs": InputsTable.model_validate,
}


class ScenarioTemplate:
    """A valid base scenario, to which changes are applied.

    Parameters
    ----------
    data : mapping
        The base scenario as resolved.
    source : str
        What it is, for errors.
    adapt : callable
        Applied to changed data before they are validated. It leaves the tables alone that determine a ride.
    """

    def __init__(self, data: Mapping[str, Any], source: str, adapt: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
        self._data, self._source, self._adapt = data, source, adapt
        self._base: Scenario | None = None

    def apply(self, changes: Mapping[str, Any]) -> Scenario:
        """Return the scenario with values changed, by dotted key; it equals that of `validate_scenario`.

        Raises
        ------
        ScenarioError
            If the changed scenario is not valid.
        ValueError
            If a key leads through a value that is not a table.
        """
        tables = {key.partition(".")[0] for key in changes}
        if tables <= _TABLES.keys() and all("." in key for key in changes):
            try:
                return self._change_tables(changes, tables)
            except (ScenarioError, ValidationError, ValueError):
                pass  # the validation of the whole scenario says what is wrong
        return validate_scenario(self._adapt(set_keys(self._data, changes)), self._source)

    def _change_tables(self, changes: Mapping[str, Any], tables: set[str]) -> Scenario:
        if self._base is None:
            self._base = validate_scenario(self._adapt(dict(self._data)), self._source)
        changed = set_keys({name: self._data[name] for name in tables if name in self._data}, changes)
        return self._base.model_copy(update={name: _TABLES[name](changed[name]) for name in tables})
