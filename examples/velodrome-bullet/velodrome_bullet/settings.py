"""Settings of the engine in Bullet."""

from __future__ import annotations

from math import sqrt

from pydantic import Field

from velodrome.engines.engine import Settings


class BulletSettings(Settings):
    """How Bullet steps, and what touches the ground."""

    step: float = Field(
        default=1e-3,
        ge=1e-5,
        le=0.01,
        description="time step [s], fixedTimeStep of PyBullet, whose default is 1/240 s; it must divide the output "
        "interval",
        json_schema_extra={"unit": "s"},
    )
    friction: float = Field(
        default=2.0,
        ge=0,
        le=100,
        description="coefficient of friction between wheels and ground, with a cone, as is PyBullet's default",
        json_schema_extra={"unit": "1"},
    )
    half_thickness: float = Field(
        default=1e-3,
        ge=1e-5,
        le=0.05,
        description="half the width of the wheels, which are cylinders with edges that Bullet rounds by its margin of "
        "1 mm; at 1 mm nothing but the rounded rim is left, and with other widths the rides fail",
        json_schema_extra={"unit": "m"},
    )
    contact_erp: float = Field(
        default=0.0,
        ge=0,
        le=1,
        description="part of the depth of a contact by which a step lifts the wheels out of the ground (contactERP); "
        "Bullet's default is 0.2, with which plane-circle falls",
        json_schema_extra={"unit": "1"},
    )
    iterations: int = Field(
        default=200,
        ge=1,
        le=100_000,
        description="largest number of iterations of the contact solver in a step (numSolverIterations); Bullet's "
        "default is 50",
        json_schema_extra={"unit": "1"},
    )
    residual: float = Field(
        default=1e-14,
        ge=1e-30,
        le=1e-2,
        description="sum of the squared changes of velocities in an iteration at which the contact solver stops "
        "(solverResidualThreshold); Bullet's default is 1e-7",
        json_schema_extra={"unit": "m^2/s^2"},
    )

    @property
    def noise(self) -> float:
        """Change of velocities that the contact solver may leave in a step [m/s]; speeds are some metres a second."""
        return sqrt(self.residual)
