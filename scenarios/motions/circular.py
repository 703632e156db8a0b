"""One circular motion, with its contact forces, eigenvalues and stability."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from ...reference.bicycle import Bicycle
from ...reference.circular import CircularMotion, Steady
from ...reference.contact import observe
from ...reference.families import find_motion
from ...reference.inputs import NO_INPUTS, Inputs
from ...reference.kinematics import YAW
from ...reference.missing_motion import NoSuchMotion, SearchFailed
from ...reference.regularity import require_inertia, require_inertia_in_turns
from ...reference.rideability import assess_state, explain_motion
from ...reference.stability import growth_rate, linearise
from ...reference.surface import SurfaceOfRevolution
from ..error import ScenarioError
from ..scenario import describe_missing_motion, name_bicycle, name_surface, show_value

NOT_SEARCHED = "it was not searched for"
_NOT_STABLE = "the motion is not Lyapunov stable"


@dataclass(frozen=True, eq=False, repr=False)
class CircularSolution:
    """A circular motion with its contacts, energy and stability; solutions are compared by identity.

    Parameters
    ----------
    bicycle : Bicycle
    motion : CircularMotion
        The 21 constants of the motion (Xiong et al. 2020, Eqs. 9-14).
    surface : SurfaceOfRevolution
        The ground.
    family : int or None
        Number of the family, 1 to 4; None for a curve without a number, and for a straight motion.
    contact_point : numpy.ndarray, shape (2, 3)
        Contact points of the rear and the front wheel in the heading frame [m].
    normal_force : numpy.ndarray, shape (2,)
        Forces along the ground's normals on the rear and the front wheel [N].
    energy : float
        Kinetic and potential energy, with the datum z = 0 [J].
    eigenvalues : numpy.ndarray, shape (7,)
        Eigenvalues of the reduced linear system, sorted by real part, then imaginary part [1/s].
    jacobian : numpy.ndarray, shape (7, 7)
        Matrix of the reduced linear system (Eq. 17), variables in the order of `reference.stability.VARIABLES`.
    growth_rate : float
        Largest real part of the eigenvalues that symmetry leaves free [1/s].
    wheel_friction : numpy.ndarray, shape (2,)
        Coefficient of friction that the rear and the front wheel need to roll; inf where the ground does not push.
    unphysical_because : tuple of str
        Why the motion cannot be ridden: the ground does not push a wheel, a rim touches the ground at a second place,
        or the wheels overlap, each with how much. Empty if it can. Frames have no known shape and are not looked at.
    inputs : Inputs
        Inputs that are held in the motion.
    stable_within : float or None
        Half of the peak-to-peak of the lean of the unstable orbit that bounds the stable motion, of the same energy
        [rad]; None where none is known, see `no_bound_because`.
    no_bound_because : str or None
        Why `stable_within` is None.
    """

    bicycle: Bicycle = field(repr=False)
    motion: CircularMotion
    surface: SurfaceOfRevolution = field(repr=False)
    family: int | None
    contact_point: np.ndarray = field(repr=False)
    normal_force: np.ndarray
    energy: float
    eigenvalues: np.ndarray
    jacobian: np.ndarray = field(repr=False)
    growth_rate: float
    wheel_friction: np.ndarray = field(repr=False)
    unphysical_because: tuple[str, ...]
    inputs: Inputs = NO_INPUTS
    stable_within: float | None = None
    no_bound_because: str | None = None

    @property
    def lyapunov_stable(self) -> bool:
        """Whether the motion is Lyapunov stable."""
        return bool(self.growth_rate < 0)

    @property
    def physical(self) -> bool:
        """Whether the motion can be ridden: the ground pushes both wheels, and they touch nothing else."""
        return not self.unphysical_because

    @property
    def required_friction(self) -> float | None:
        """Coefficient of friction that rolling needs, the larger of both wheels; None where a wheel is not pushed."""
        largest = float(self.wheel_friction.max())
        return largest if np.isfinite(largest) else None

    def __repr__(self) -> str:
        motion = self.motion
        rates = ", ".join(f"{name} {getattr(motion, name):.6g}" for name in ("rear_rate", "front_rate", "yaw_rate"))
        angles = ", ".join(f"{name} {getattr(motion, name):.6g}" for name in ("lean", "steer", "pitch"))
        stable = "Lyapunov stable" if self.lyapunov_stable else "not Lyapunov stable"
        if self.stable_within is not None:
            stable += f" within {self.stable_within:.6g} rad of lean"
        ground = name_surface(self.surface)
        where = f"alpha {ground['alpha']:g} 1/m" if ground["alpha"] is not None else show_value(repr(self.surface))
        kind = "straight" if motion.is_straight else f"family {self.family}"
        return "\n".join(
            [
                f"CircularSolution: {kind}, {where}",
                *([f"  inputs: {self.inputs.describe()}"] if self.inputs != NO_INPUTS else []),
                f"  rates [rad/s]: {rates}",
                f"  angles [rad]: {angles}",
                f"  normal forces [N]: rear {self.normal_force[0]:.6g}, front {self.normal_force[1]:.6g}",
                f"  energy [J]: {self.energy:.6g}",
                f"  {self._describe_rideability()}",
                f"  {stable}: growth rate {self.growth_rate:.6g} 1/s",
            ]
        )

    def _describe_rideability(self) -> str:
        if not self.physical:
            return f"cannot be ridden: {'; '.join(self.unphysical_because)}"
        return f"can be ridden with a coefficient of friction of {self.required_friction:.6g}"

    def as_json(self, bicycle_name: str | None = None) -> dict[str, Any]:
        """Return the JSON document of `velodrome circular`; see `name_bicycle` for the name."""
        motion = self.motion
        names = ("rear_rate", "front_rate", "yaw_rate", "lean", "steer", "pitch")
        return {
            **name_surface(self.surface),
            **name_bicycle(self.bicycle, bicycle_name),
            "family": self.family,
            "inputs": asdict(self.inputs),
            **{name: getattr(motion, name) for name in names},
            "position": motion.position.tolist(),
            "contact_point": _split_by_wheel(self.contact_point),
            "contact_force": _split_by_wheel(motion.force),
            "normal_force": _split_by_wheel(self.normal_force),
            "energy": self.energy,
            "residual": motion.residual,
            "eigenvalues": [[value.real, value.imag] for value in self.eigenvalues.tolist()],
            "jacobian": self.jacobian.tolist(),
            "lyapunov_stable": self.lyapunov_stable,
            "stable_within": self.stable_within,
            "no_bound_because": self.no_bound_because,
            "physical": self.physical,
            "unphysical_because": list(self.unphysical_because),
            "required_friction": self.required_friction,
        }


def solve_circular(
    bicycle: Bicycle,
    surface: SurfaceOfRevolution,
    rear_rate: float,
    family: int | None = None,
    near: tuple[float, float] | None = None,
    inputs: Inputs = NO_INPUTS,
) -> CircularSolution:
    """Compute one circular motion.

    Parameters
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
        The ground.
    rear_rate : float
        Rate of the rear wheel, positive [rad/s].
    family : int, optional
        Number of the family, 1 to 4. Either this or ``near`` is needed; both if the family has several motions at this
        rate.
    near : tuple of float, optional
        Lean and steer that the motion is near to [rad].
    inputs : Inputs
        Held constant. With a steer torque there are no families, and ``near`` is needed.

    Returns
    -------
    CircularSolution

    Raises
    ------
    MissingMotionError
        If there is no such motion.
    ScenarioError
        If an argument is invalid, or the bicycle's equations of motion are singular.
    """
    try:
        require_inertia_in_turns(bicycle)
        number, motion = find_motion(bicycle, surface, rear_rate, family, near, inputs)
        q, qd = motion.state()
        require_inertia(bicycle, surface, q)
        reduced = linearise(bicycle, surface, q, qd, inputs)
    except (NoSuchMotion, SearchFailed) as error:
        raise describe_missing_motion(error) from error
    except ValueError as error:
        raise ScenarioError(str(error)) from error
    contact = observe(bicycle, surface, q[None], qd[None])
    rideability = assess_state(bicycle, surface, q, motion.contact, motion.force)
    growth = growth_rate(surface, reduced.eigenvalues, float(qd[YAW]))
    return CircularSolution(
        bicycle=bicycle,
        motion=motion,
        surface=surface,
        family=number,
        contact_point=contact.point[0],
        normal_force=np.einsum("wi,wi->w", motion.force, contact.normal[0]),
        energy=float(contact.kinetic_energy[0] + contact.potential_energy[0]),
        eigenvalues=reduced.eigenvalues,
        jacobian=reduced.jacobian,
        growth_rate=growth,
        no_bound_because=NOT_SEARCHED if growth < 0 else _NOT_STABLE,
        inputs=inputs,
        wheel_friction=rideability.friction[0],
        unphysical_because=explain_motion(bicycle, surface, motion),
    )


def search_bound(solution: CircularSolution) -> CircularSolution:
    """Search for the unstable orbit that bounds a stable motion; this takes some seconds.

    Parameters
    ----------
    solution : CircularSolution
        As `solve_circular` returns it.

    Returns
    -------
    CircularSolution
        With `stable_within`, or the reason why it is not known; unchanged if the motion is not stable.
    """
    if not solution.lyapunov_stable:
        return solution
    from ...reference.bifurcations.stable_within import bound_circle  # one motion alone does not need orbits

    found = bound_circle(Steady(solution.bicycle, solution.surface, solution.inputs), solution.motion)
    return replace(solution, stable_within=found.stable_within, no_bound_because=found.why_not)


def _split_by_wheel(pair: np.ndarray) -> dict[str, Any]:
    return dict(zip(("rear", "front"), pair.tolist(), strict=True))
