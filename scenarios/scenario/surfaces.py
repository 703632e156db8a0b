"""The surfaces that a scenario can name, and their notation on the command line and in documents."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter, ValidationError, field_validator, model_validator

from ...reference.bowls import Cone, Sphere, Torus
from ...reference.height_field import HeightField
from ...reference.profile import PolynomialProfile, SplineProfile
from ...reference.surface import InclinedPlane, Paraboloid, Plane, Surface, SurfaceOfRevolution, is_of_revolution
from ..error import ScenarioError
from .table import Table, format_validation_error, read_toml, show_value

_Length = Annotated[float, Field(gt=0, le=1e6)]
_Moderate = Annotated[float, Field(ge=-1e6, le=1e6)]
_Numbers = Annotated[tuple[_Moderate, ...], Field(strict=False, max_length=1000)]  # TOML has arrays only


# The effect of a flatter bowl on a disturbance is lost in the round-off of eigenvalues, about 1e-15 1/s: at 1e-12 1/m
# it is known to a few thousandths; at 1e-15 1/m not even its sign is known.
FLATTEST = 1e-12


def told_from_level(alpha: float) -> float:
    """Return the shape of a paraboloid [1/m] if it is 0, the plane, or can be distinguished from the plane.

    Raises
    ------
    ValueError
        If the paraboloid is too flat.
    """
    if 0 < alpha < FLATTEST:
        raise ValueError(f"must be 0, which is the plane, or at least {FLATTEST!r}: less is lost in round-off")
    return alpha


class PlaneTable(Table):
    """Level ground."""

    kind: Literal["plane"]

    def make(self) -> Plane:
        """The surface."""
        return Plane()


class InclinedPlaneTable(Table):
    """A plane through the origin that rises in one direction."""

    kind: Literal["inclined-plane"]
    slope: float = Field(gt=0, le=1e3, description="rise over run", json_schema_extra={"unit": "1"})
    direction: float = Field(
        default=0.0,
        ge=-10.0,
        le=10.0,
        description="direction in which it rises, from the x axis towards y",
        json_schema_extra={"unit": "rad"},
    )

    def make(self) -> InclinedPlane:
        """The surface."""
        return InclinedPlane(self.slope, self.direction)


class ParaboloidTable(Table):
    """The bowl z = alpha (x^2 + y^2)."""

    kind: Literal["paraboloid"]
    alpha: float = Field(ge=0, description="shape; 0 is the plane", json_schema_extra={"unit": "1/m"})

    @field_validator("alpha")
    @classmethod
    def _told_from_level(cls, alpha: float) -> float:
        return told_from_level(alpha)

    def make(self) -> Paraboloid:
        """The surface."""
        return Paraboloid(self.alpha)


class SphereTable(Table):
    """The lower half of a sphere."""

    kind: Literal["sphere"]
    radius: _Length = Field(description="radius of the sphere", json_schema_extra={"unit": "m"})

    def make(self) -> Sphere:
        """The surface."""
        return Sphere(self.radius)


class ConeTable(Table):
    """A cone with a rounded tip."""

    kind: Literal["cone"]
    slope: float = Field(ge=1e-6, le=1e6, description="slope far from the axis", json_schema_extra={"unit": "1"})
    rounding: float = Field(ge=1e-6, le=1e6, description="scale of the tip", json_schema_extra={"unit": "m"})

    def make(self) -> Cone:
        """The surface."""
        return Cone(self.slope, self.rounding)


class TorusTable(Table):
    """A circular trough."""

    kind: Literal["torus"]
    ring: float = Field(ge=0, le=1e6, description="radius of the tube's centre line", json_schema_extra={"unit": "m"})
    tube: _Length = Field(description="radius of the tube", json_schema_extra={"unit": "m"})

    def make(self) -> Torus:
        """The surface."""
        return Torus(self.ring, self.tube)


class ProfileTable(Table):
    """A bowl z = g(r): a polynomial in r^2, or a spline through points."""

    kind: Literal["profile"]
    coefficients: _Numbers | None = Field(
        default=None, description="coefficients of r^2, r^4, ...", json_schema_extra={"unit": "1/m, 1/m^3, ..."}
    )
    radii: _Numbers | None = Field(
        default=None, description="radii of the points, rising", json_schema_extra={"unit": "m"}
    )
    heights: _Numbers | None = Field(default=None, description="heights of the points", json_schema_extra={"unit": "m"})

    @model_validator(mode="after")
    def _one_way(self) -> ProfileTable:
        points = self.radii is not None and self.heights is not None
        polynomial = self.coefficients is not None and self.radii is None and self.heights is None
        if not polynomial and not (points and self.coefficients is None):
            raise ValueError("a profile needs either coefficients = [...] or radii = [...] and heights = [...]")
        self.make()
        return self

    def make(self) -> PolynomialProfile | SplineProfile:
        """The surface."""
        if self.radii is not None and self.heights is not None:
            return SplineProfile(self.radii, self.heights)
        return PolynomialProfile(self.coefficients or ())


class HeightFieldTable(Table):
    """Ground through a regular grid of heights."""

    kind: Literal["height-field"]
    heights: Annotated[tuple[_Numbers, ...], Field(strict=False, max_length=1000)] = Field(
        description="heights, row i and column j at origin + spacing (i, j)", json_schema_extra={"unit": "m"}
    )
    spacing: _Length = Field(description="distance of neighbours in the grid", json_schema_extra={"unit": "m"})
    origin: Annotated[tuple[_Moderate, _Moderate], Field(strict=False)] = Field(
        default=(0.0, 0.0), description="x and y of the first height", json_schema_extra={"unit": "m"}
    )

    @model_validator(mode="after")
    def _possible(self) -> HeightFieldTable:
        self.make()
        return self

    def make(self) -> HeightField:
        """The surface."""
        return HeightField(self.heights, self.spacing, self.origin)


SurfaceTable = Annotated[
    PlaneTable
    | InclinedPlaneTable
    | ParaboloidTable
    | SphereTable
    | ConeTable
    | TorusTable
    | ProfileTable
    | HeightFieldTable,
    Field(discriminator="kind"),
]

_KINDS: dict[type, str] = {
    Plane: "plane",
    InclinedPlane: "inclined-plane",
    Paraboloid: "paraboloid",
    Sphere: "sphere",
    Cone: "cone",
    Torus: "torus",
    PolynomialProfile: "profile",
    SplineProfile: "profile",
    HeightField: "height-field",
}


def parse_surface(text: str, given_by: str = "surface") -> Surface:
    """Make the surface that ``KIND`` or ``KIND:KEY=VALUE,...`` names, e.g. ``sphere:radius=20``.

    Values are TOML: ``profile:coefficients=[0.005, 1e-6]``.

    Parameters
    ----------
    text : str
    given_by : str
        What the text was given by, for errors: an argument or an option.

    Raises
    ------
    ScenarioError
        If the text names no surface. The message is one line.
    """
    kind, _, fields = text.partition(":")
    where = f"{given_by} {show_value(text)}"
    try:
        table = read_toml(f"surface = {{ {fields} }}")["surface"]
        # A line break would start a second TOML statement.
        if "\n" in fields or "kind" in table:
            raise ValueError
    except ValueError:
        raise ScenarioError(f"{where}: must be KIND:KEY=VALUE,..., e.g. sphere:radius=20") from None
    try:
        return TypeAdapter(SurfaceTable).validate_python({"kind": kind.strip(), **table}).make()
    except ValidationError as error:
        raise ScenarioError(f"{where}: {format_validation_error(error)}") from error


def make_bowl(ground: Surface | float) -> SurfaceOfRevolution:
    """Return a ground as a surface of revolution; a number is the alpha of a paraboloid.

    Raises
    ------
    ScenarioError
        If the ground is not a surface of revolution, or too flat.
    """
    try:
        surface = Paraboloid(told_from_level(ground)) if isinstance(ground, int | float) else ground
    except ValueError as error:
        where = "" if str(error).startswith("alpha") else f"alpha is {ground!r}; it "
        raise ScenarioError(f"{where}{error}") from error
    if not is_of_revolution(surface):
        raise ScenarioError(
            f"circular motions ride on a surface of revolution; {describe_surface(surface)['kind']} is none"
        )
    return surface


def describe_surface(surface: Surface) -> dict[str, Any]:
    """Return the kind and the fields of a surface as JSON values.

    For a surface that scenarios cannot name, return the name of its class and its parameters.
    """
    kind: Any = _KINDS.get(type(surface))
    if kind is None:
        return {"kind": type(surface).__name__, "parameters": surface.parameters.tolist()}
    fields: Any = surface
    return {"kind": kind} | {name: _convert_tuples(value) for name, value in asdict(fields).items()}


def _convert_tuples(value: Any) -> Any:
    return [_convert_tuples(item) for item in value] if isinstance(value, tuple) else value


def name_surface(surface: Surface) -> dict[str, Any]:
    """Return the entries that name a surface in a document.

    The entry ``alpha`` is a number for a paraboloid or the plane. For other surfaces it is None, and the entry
    ``surface`` describes the surface.
    """
    if isinstance(surface, Plane | Paraboloid):
        return {"alpha": surface.alpha if isinstance(surface, Paraboloid) else 0.0}
    return {"alpha": None, "surface": describe_surface(surface)}
