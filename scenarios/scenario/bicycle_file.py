"""Bicycle files: parameters of a bicycle in the formats that are common in the field.

Three conventions are read and recognized by the names of the parameters:

- Meijaard's symbols (``w``, ``c``, ``lam``, ``IBxz``, ...), axes x forward, y right and z down, as the package
  BicycleParameters writes them: text (``c = 0.0685+/-0.0017``) or YAML;
- principal radii of gyration of frame, person and front frame (``kDaa``, ``alphaD``, ...), z down, as in Moore and
  Hubbard (2019), also written by BicycleParameters;
- the suite's names (``wheelbase``, ``rear_frame_Ixz``, ...), axes x forward, y left and z up: TOML, as in a scenario.

Heights and products of inertia are converted to the suite's axes here and nowhere else.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from math import cos, isfinite, sin
from pathlib import Path
from typing import Any

from yaml import YAMLError, safe_load

from ...reference.bicycle import Bicycle
from ..error import ScenarioError
from .table import read_toml, show_value

# Meijaard's symbol to the suite's name and the factor between them.
_SYMBOLS = {
    **{"w": ("wheelbase", 1), "c": ("trail", 1), "lam": ("steer_axis_tilt", 1), "g": ("gravity", 1)},
    **{"rR": ("rear_wheel_radius", 1), "mR": ("rear_wheel_mass", 1)},
    **{"IRxx": ("rear_wheel_Ixx", 1), "IRyy": ("rear_wheel_Iyy", 1)},
    **{"xB": ("rear_frame_x", 1), "zB": ("rear_frame_z", -1), "mB": ("rear_frame_mass", 1)},
    **{"IBxx": ("rear_frame_Ixx", 1), "IByy": ("rear_frame_Iyy", 1)},
    **{"IBzz": ("rear_frame_Izz", 1), "IBxz": ("rear_frame_Ixz", -1)},
    **{"xH": ("front_frame_x", 1), "zH": ("front_frame_z", -1), "mH": ("front_frame_mass", 1)},
    **{"IHxx": ("front_frame_Ixx", 1), "IHyy": ("front_frame_Iyy", 1)},
    **{"IHzz": ("front_frame_Izz", 1), "IHxz": ("front_frame_Ixz", -1)},
    **{"rF": ("front_wheel_radius", 1), "mF": ("front_wheel_mass", 1)},
    **{"IFxx": ("front_wheel_Ixx", 1), "IFyy": ("front_wheel_Iyy", 1)},
}
# Symbols that follow from others in this model: files may contain them, with these values only.
_IMPLIED = {
    **{name: lambda p: 0.0 for name in ("xR", "yR", "yB", "yH", "yF", "yD", "yP", "IRxz", "IFxz")},
    **{"xF": lambda p: p["w"], "zR": lambda p: -p["rR"], "zF": lambda p: -p["rF"]},
    **{"IRzz": lambda p: p["IRxx"], "IFzz": lambda p: p["IFxx"]},
    **{"kRbb": lambda p: p["kRaa"], "kFbb": lambda p: p["kFaa"]},
}
_PRINCIPAL = (
    *("w", "c", "lam", "g", "rR", "rF", "mR", "mF", "mH", "mD", "mP", "xD", "zD", "xP", "zP", "xH", "zH"),
    *("alphaD", "alphaP", "alphaH", "kRaa", "kRyy", "kFaa", "kFyy"),
    *(f"k{body}{axis}" for body in "DPH" for axis in ("aa", "bb", "yy")),
)
# Symbols in such files that are not used: a speed, the person's outline, and the handlebar and fork, the parts
# of the front frame.
_BESIDE = re.compile(r"v|[lw]P|[mxz][GS]|I[GS](xx|yy|zz|xz)")
_GAIN = re.compile(r"kT(phi|del)_(phi|del)d?")
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_VALUE = re.compile(rf"\(?\s*({_NUMBER})\s*(?:(?:\+/-|±)\s*({_NUMBER})\s*)?\)?(?:[eE]([-+]?\d+))?")
# Relative difference allowed between values that must be equal: printed values may be rounded.
_ROUNDED = 1e-4


@dataclass(frozen=True)
class BicycleFile:
    """A bicycle as a file describes it.

    Attributes
    ----------
    name : str
        Name of the file, without its suffix.
    bicycle : Bicycle
    uncertainties : dict
        Standard deviations by name of the parameter, as in `Bicycle`, if the file has them.
    convention : str
        Names and axes that the file uses.
    ignored : tuple of str
        Names in the file that do not belong to the bicycle.
    """

    name: str
    bicycle: Bicycle
    uncertainties: dict[str, float] = field(default_factory=dict)
    convention: str = ""
    ignored: tuple[str, ...] = ()


def read_bicycle_file(path: Path) -> BicycleFile:
    """Read a bicycle file in any of the known conventions.

    Parameters
    ----------
    path : Path
        A ``.toml``, ``.yml`` or ``.yaml`` file; any other file is read as lines ``name = value``.

    Returns
    -------
    BicycleFile

    Raises
    ------
    ScenarioError
        If the file cannot be read, a parameter is missing, unknown or not a number, or the numbers describe no bicycle.
    """
    shown_path = show_value(str(path))
    try:
        if not path.is_file():
            raise ScenarioError(
                f"{shown_path}: there is no such file; give a bicycle file, e.g. one of BicycleParameters"
            )
        text = path.read_text(encoding="utf-8-sig")
        entries, deviations = _read_entries(text, path.suffix.lower())
        values, given = _split_deviations({name: _parse_number(name, value) for name, value in entries.items()})
        given |= {name: _parse_number(name, value)[0] for name, value in deviations.items()}
        convention, parameters, uncertainties, ignored = _interpret(values, given)
        return BicycleFile(path.stem, Bicycle(**parameters), uncertainties, convention, ignored)
    except ScenarioError:
        raise
    except (OSError, ValueError, RecursionError, YAMLError) as error:
        raise ScenarioError(f"{shown_path}: {show_value(' '.join(str(error).split()))}") from error


def _read_entries(text: str, suffix: str) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
    """Return the values by name as written, and the standard deviations that have a table of their own."""
    if suffix == ".toml":
        document = read_toml(text)
        table = document.get("bicycle", {key: value for key, value in document.items() if key != "uncertainties"})
        return _require_table("bicycle", table), _require_table("uncertainties", document.get("uncertainties", {}))
    if suffix in (".yml", ".yaml"):
        content = _require_table("the file", safe_load(text))
        return _require_table("values", content.get("values", content)), {}
    entries: dict[str, Any] = {}
    for number, line in enumerate(text.splitlines(), 1):
        written = line.partition("#")[0].strip()
        if not written:
            continue
        name, separator, value = (part.strip() for part in written.partition("="))
        if not separator:
            raise ValueError(f"line {number}: {written!r} must be a name and a value, as in c = 0.0685+/-0.0017")
        if name in entries:
            raise ValueError(f"line {number}: {name} is given a second time")
        entries[name] = value
    return entries, {}


def _require_table(name: str, value: Any) -> Mapping[str, Any]:
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise ValueError(f"{name} must be a table of names and numbers")
    return value


def _parse_number(name: str, value: Any) -> tuple[float, float | None]:
    """Return a value and its standard deviation, if it has one."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        number, deviation = float(value), None
    else:
        found = _VALUE.fullmatch(value.strip()) if isinstance(value, str) else None
        if found is None:
            raise ValueError(f"{name} is {value!r}; it must be a number, or one with its deviation as 0.0685+/-0.0017")
        factor = 10.0 ** int(found[3] or 0)
        number, deviation = float(found[1]) * factor, None if found[2] is None else float(found[2]) * factor
    if not isfinite(number) or not (deviation is None or 0 <= deviation < float("inf")):
        raise ValueError(f"{name} is {value!r}; it must be finite, and its deviation not negative")
    return number, deviation


def _split_deviations(values: Mapping[str, tuple[float, float | None]]) -> tuple[dict[str, float], dict[str, float]]:
    given = {name: deviation for name, (_, deviation) in values.items() if deviation is not None}
    return {name: number for name, (number, _) in values.items()}, given


def _interpret(
    values: dict[str, float], deviations: dict[str, float]
) -> tuple[str, dict[str, float], dict[str, float], tuple[str, ...]]:
    """Return the convention, the suite's parameters, their deviations, and the names that were not used."""
    own = {parameter.name for parameter in fields(Bicycle)}
    if own & set(values):
        _require_known(values, own, "the suite's names (wheelbase, trail, ...)")
        _require_known(deviations, own, "the suite's names (wheelbase, trail, ...)")
        missing = [name for name in Bicycle.__dataclass_fields__ if name not in values and name != "gravity"]
        if missing:
            raise ValueError(f"{', '.join(missing)} missing; a bicycle file has every parameter")
        return "the suite's names, z up", values, deviations, ()
    for name in [name for name in values if _GAIN.fullmatch(name)]:
        if values.pop(name) != 0:
            raise ValueError(f"{name} is a gain of a controller; only a bicycle without control can be read")
    ignored = tuple(name for name in values if _BESIDE.fullmatch(name))
    values = {name: value for name, value in values.items() if name not in ignored}
    principal = "kDaa" in values
    convention = "principal radii of gyration, z down" if principal else "Meijaard's symbols, z down"
    needed = _PRINCIPAL if principal else tuple(name for name in _SYMBOLS if name != "g")
    _require_known(values, {*needed, *_IMPLIED, "g"}, convention)
    values.setdefault("g", Bicycle.gravity)
    missing = [name for name in needed if name not in values]
    if missing:
        raise ValueError(
            f"{', '.join(missing)} missing ({convention}); a ride needs every one, the linear model does not"
        )
    for name, implied in _IMPLIED.items():
        if name in values and abs(values[name] - implied(values)) > _ROUNDED * abs(implied(values)):
            raise ValueError(f"{name} is {values[name]!r}; in this model it can only be {implied(values)!r}")
    if principal:
        if deviations:
            raise ValueError("deviations of principal radii of gyration cannot be converted; give Meijaard's symbols")
        values = _convert_principal(values)
    parameters = {name: factor * values[symbol] for symbol, (name, factor) in _SYMBOLS.items()}
    uncertainties = {_SYMBOLS[name][0]: size for name, size in deviations.items() if name in _SYMBOLS}
    return convention, parameters, uncertainties, ignored


def _require_known(values: Mapping[str, float], known: set[str], convention: str) -> None:
    unknown = sorted(set(values) - known)
    if unknown:
        raise ValueError(f"{unknown[0]!r} is no parameter of a bicycle in {convention}")


def _convert_principal(p: Mapping[str, float]) -> dict[str, float]:
    """Convert principal radii of gyration to Meijaard's symbols (Moore and Hubbard 2019).

    The rear frame D and the person P are one rigid body B.
    """

    def make_tensor(body: str) -> tuple[float, float, float, float]:
        """Return Ixx, Iyy, Izz and Ixz: the axis a of the radii is turned by alpha about y from the axis x."""
        ia, ib, iy = (p[f"m{body}"] * p[f"k{body}{axis}"] ** 2 for axis in ("aa", "bb", "yy"))
        cosine, sine = cos(p[f"alpha{body}"]), sin(p[f"alpha{body}"])
        return (
            ia * cosine**2 + ib * sine**2,
            iy,
            ia * sine**2 + ib * cosine**2,
            (ib - ia) * sine * cosine,
        )

    mass = p["mD"] + p["mP"]
    x, z = ((p["mD"] * p[f"{axis}D"] + p["mP"] * p[f"{axis}P"]) / mass for axis in "xz")
    xx = yy = zz = xz = 0.0
    for body in "DP":
        ixx, iyy, izz, ixz = make_tensor(body)
        dx, dz = p[f"x{body}"] - x, p[f"z{body}"] - z
        m = p[f"m{body}"]
        xx, yy, zz = xx + ixx + m * dz**2, yy + iyy + m * (dx**2 + dz**2), zz + izz + m * dx**2
        xz += ixz - m * dx * dz
    found = {name: p[name] for name in ("w", "c", "lam", "g", "rR", "rF", "mR", "mF", "mH", "xH", "zH")}
    found |= {"mB": mass, "xB": x, "zB": z, "IBxx": xx, "IByy": yy, "IBzz": zz, "IBxz": xz}
    found |= dict(zip(("IHxx", "IHyy", "IHzz", "IHxz"), make_tensor("H"), strict=True))
    for wheel in "RF":
        found |= {f"I{wheel}xx": p[f"m{wheel}"] * p[f"k{wheel}aa"] ** 2}
        found |= {f"I{wheel}yy": p[f"m{wheel}"] * p[f"k{wheel}yy"] ** 2}
    return found
