"""Checks that an object follows the protocol of engines, and that its settings follow the rules of settings."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

from ...engines.engine import REQUIRED, SHAPES, Engine, why_failed
from ...engines.guard import GuardedEngine, call_engine
from ...engines.registry import load_engine
from ..measure import LARGEST_NOISE, ROUND_OFF
from .report import ConformanceCheck, make_check

_FACTS = ("name", "version", "gives", "settings")
_CALLS = {"check": 2, "step_noise": 1, "simulate": 3}
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
_OPTIONAL = tuple(name for name in SHAPES if name not in REQUIRED)


def guard_engine(engine: Engine | str) -> tuple[GuardedEngine | None, ConformanceCheck]:
    """Wrap an engine in the guard, and check that it has the members that the protocol requires.

    Returns
    -------
    engine : GuardedEngine or None
        None if a member is missing or cannot be used.
    check : ConformanceCheck
    """
    claim = "it has the members that velodrome.engines.engine.Engine lists, of the stated types"
    if isinstance(engine, str):
        try:
            engine = load_engine(engine)
        except ValueError as error:
            return None, make_check("protocol", claim, [str(error)])
    inner = engine.inner if isinstance(engine, GuardedEngine) else engine
    members, wrong = {}, []
    for name in (*_FACTS, *_CALLS):
        try:
            members[name] = call_engine(getattr, inner, name)
        except Exception as error:  # another package's code may break in any way
            wrong.append(f"its {name} cannot be read: {why_failed(error)}")
    if wrong:
        return None, make_check("protocol", claim, wrong)
    takes = call_engine(getattr, inner, "takes_inputs", False)
    guarded = GuardedEngine(inner, **{fact: members[fact] for fact in _FACTS}, takes_inputs=takes is True)
    wrong = [*_list_fact_faults(guarded), *_list_call_faults(members)]
    if not isinstance(takes, bool):
        wrong.append(f"its takes_inputs is {takes!r}; it must be True or False")
    model = guarded.settings
    usable = isinstance(model, type) and issubclass(model, BaseModel) and isinstance(guarded.gives, tuple)
    return guarded if usable else None, make_check("protocol", claim, wrong)


def _list_fact_faults(engine: GuardedEngine) -> Iterator[str]:
    if not isinstance(engine.name, str) or not _NAME.fullmatch(engine.name):
        yield f"its name is {engine.name!r}; files carry it: letters, digits, dots, dashes and underscores, 64 at most"
    if not isinstance(engine.version, str) or not engine.version.strip() or not engine.version.isprintable():
        yield f"its version is {engine.version!r}; it must be one line of text"
    if not isinstance(engine.gives, tuple):
        yield f"its gives is a {type(engine.gives).__name__}; it must be a tuple of names"
    else:
        for name in engine.gives:
            if name not in _OPTIONAL:
                yield f"its gives lists {name!r}; there are {', '.join(_OPTIONAL)}"
    if not (isinstance(engine.settings, type) and issubclass(engine.settings, BaseModel)):
        yield f"its settings is {engine.settings!r}; it must be a subclass of velodrome.engines.engine.Settings"


def _list_call_faults(members: Mapping[str, Any]) -> Iterator[str]:
    for name, count in _CALLS.items():
        if not callable(members[name]):
            yield f"its {name} is not a function"
            continue
        try:
            inspect.signature(members[name]).bind(*range(count))
        except TypeError:
            yield f"its {name} does not take {count} argument{'s' * (count > 1)}"
        except ValueError:  # a compiled function without a signature
            continue


def check_settings(engine: GuardedEngine) -> ConformanceCheck:
    """Check the model of the settings: defaults, refusals, bounds, descriptions, units and step noise."""
    return make_check(
        "settings",
        "every setting has a default, bounds and a description; unknown settings and values that are not numbers are "
        "refused",
        _list_settings_faults(engine),
        tolerance=f"step_noise from {ROUND_OFF / 2:.2g}, half a unit of round-off, to {LARGEST_NOISE:g}",
    )


def _list_settings_faults(engine: GuardedEngine) -> Iterator[str]:
    model: Any = engine.settings
    try:
        settings = call_engine(model)
    except Exception as error:  # a validator may be anybody's code
        yield f"they have no defaults: {why_failed(error)}"
        return
    fields = model.model_fields
    if _accepts(model, {"no_such_setting": 1}):
        yield "an unknown setting is accepted; extra='forbid' of velodrome.engines.engine.Settings refuses it"
    for name, field in fields.items():
        value = getattr(settings, name)
        if not field.description:
            yield f"{name} has no description"
        if isinstance(value, float):
            for wrong in (float("nan"), float("inf")):
                if _accepts(model, {name: wrong}):
                    yield f"{name} may be {wrong}"
            if _accepts(model, {name: "small"}):
                yield f"{name} may be text"
            if not any(type(bound).__name__ in ("Gt", "Ge", "Interval") for bound in field.metadata):
                yield f"{name} has no lower bound"
    if "step" in fields and not re.search(r"\[\w+\]", fields["step"].description or ""):
        yield "the description of step does not say its unit, [s]"
    if fields and not _frozen(settings, next(iter(fields))):
        yield "an instance can be changed; frozen=True of velodrome.engines.engine.Settings forbids it"
    try:
        if model.model_validate(settings.model_dump(mode="json")) != settings:
            yield "an instance differs from what its own JSON values give"
    except ValidationError as error:
        yield f"its own JSON values are refused: {error.errors()[0]['msg']}"
    if not callable(getattr(settings, "refined", None)):
        yield "they have no refined(factor); velodrome.engines.engine.Settings has one"
    try:
        noise: object = engine.step_noise(settings)
    except Exception as error:  # another package's code may break in any way
        yield f"its step_noise breaks: {why_failed(error)}"
        return
    if not (isinstance(noise, float) and ROUND_OFF / 2 <= noise <= LARGEST_NOISE):
        yield f"its step_noise is {noise!r}; it must be a number from {ROUND_OFF / 2:.2g} to {LARGEST_NOISE:g}"


def _accepts(model: Any, values: Mapping[str, Any]) -> bool:
    try:
        call_engine(model.model_validate, dict(values))
    except Exception:  # refused, in whatever way
        return False
    return True


def _frozen(settings: Any, name: str) -> bool:
    try:
        setattr(settings, name, getattr(settings, name))
    except (ValidationError, TypeError, AttributeError):
        return True
    return False


def step_noise_of(engine: GuardedEngine, settings: Any) -> float:
    """Return an engine's step noise, or round-off if that is not usable, which `check_settings` reports."""
    try:
        noise: object = engine.step_noise(settings)
    except Exception:  # `check_settings` reports it
        return ROUND_OFF
    return float(noise) if isinstance(noise, float) and 0 <= noise <= LARGEST_NOISE else ROUND_OFF
