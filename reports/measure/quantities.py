"""Definitions and units of the quantities of ``metrics.json``."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """What one key of ``metrics.json`` is.

    Attributes
    ----------
    meaning : str
        Definition, in sentences.
    unit : str
        ``1`` for a ratio, empty where the value is no number.
    parts : tuple of str
        Keys of the value where it is an object, such as ``max`` and ``end``.
    absent : str
        When the value is null; empty where it never is.
    """

    meaning: str
    unit: str
    parts: tuple[str, ...] = ()
    absent: str = ""


_NO_REFERENCE = "for the reference itself, and in a run without it"
_NO_FORCES = "where the engine gives no contact forces"
_EXTREMES = ("max", "end")

# In the order of `velodrome.reports.measure.metrics.compute_metrics`.
QUANTITIES: dict[str, Quantity] = {
    "position_error": Quantity(
        "Largest distance of the point D, on the steering axis, from where the reference has it at the same time.",
        "m",
        _EXTREMES,
        _NO_REFERENCE,
    ),
    "orientation_error": Quantity(
        "Largest angle between the rear frame and the reference's.", "rad", _EXTREMES, _NO_REFERENCE
    ),
    "rate_error": Quantity(
        "Largest difference of any of the nine rates from the reference's: rates of D relative to its "
        "largest speed, the others to the largest angular rate.",
        "1",
        absent=f"{_NO_REFERENCE}; where the reference stands still",
    ),
    "rear_rate_error": Quantity(
        "Largest difference of the rear wheel's rate from the reference's.", "rad/s", absent=_NO_REFERENCE
    ),
    "contact_force_error": Quantity(
        "Largest difference of a contact force from the reference's, relative to the largest force "
        "that the reference needs.",
        "1",
        absent=f"{_NO_REFERENCE}; {_NO_FORCES}",
    ),
    "contact_force_error_at": Quantity(
        "Time of the sample with the largest error of a contact force.",
        "s",
        absent=f"{_NO_REFERENCE}; {_NO_FORCES}; where there is no such error",
    ),
    "settled_force_error": Quantity(
        "`contact_force_error` from 0.2 s on, when contacts that start unsettled have settled.",
        "1",
        absent=f"{_NO_REFERENCE}; {_NO_FORCES}; in a ride that is shorter",
    ),
    "radius_drift_rate": Quantity(
        "Slope of the distance from the bowl's axis, less the reference's: does the circle widen or shrink of itself?",
        "m/s",
        absent=f"{_NO_REFERENCE}; for a straight start; with fewer than two samples",
    ),
    "phase_drift_rate": Quantity(
        "Slope of the polar angle of D about the bowl's axis, less the reference's.",
        "rad/s",
        absent=f"{_NO_REFERENCE}; for a straight start; with fewer than two samples",
    ),
    "rear_rate_drift_rate": Quantity(
        "Slope of the rear wheel's rate, less the reference's.",
        "rad/s^2",
        absent=f"{_NO_REFERENCE}; with fewer than two samples",
    ),
    "energy_drift": Quantity(
        "Largest change of the total energy less the work of the inputs, relative to the start's energy: zero in an "
        "exact ride. With steer damping at least the error of its work, which is integrated over the samples.",
        "1",
        absent="where the energy at the start is zero",
    ),
    "energy_drift_rate": Quantity(
        "Slope of the line through the total energy less the work of the inputs.",
        "W",
        absent="with fewer than two samples; where the error of the damping's work is larger",
    ),
    "energy_variation": Quantity(
        "100 (Emax - Emin) / |E(0)|, which the IFToMM benchmark limits; E less the work of the inputs.",
        "percent",
        absent="where the energy at the start is zero",
    ),
    "max_gap": Quantity("Largest distance of a rim from the ground, above or below it.", "m"),
    "max_slip": Quantity(
        "Largest speed of a wheel's material at its contact point: zero for a wheel that rolls.", "m/s"
    ),
    "mean_slip": Quantity("That speed, averaged over both wheels and all samples.", "m/s"),
    "adaptations": Quantity(
        "What the engine left out or replaced, as the release of its library lacks something; text, see "
        "`velodrome show`.",
        "",
    ),
    "not_finite": Quantity("Names of the fields of the trajectory that are not finite in some samples.", ""),
    "inconsistent_reports": Quantity(
        "What the engine reports and its own coordinates contradict: field, part, difference, limit, unit, time.", ""
    ),
    "required_friction": Quantity(
        "Coefficient of friction that the reference's contact forces need to roll without slip; the engine's own "
        "forces where there is no reference.",
        "1",
        absent=f"{_NO_FORCES}; where the ground would have to pull",
    ),
    "friction": Quantity(
        "Coefficient of friction that the engine's contacts have in every direction.",
        "1",
        absent="where wheels are bound to roll",
    ),
    "friction_left_at": Quantity(
        "First time at which rolling needs more friction than the engine's contacts have.",
        "s",
        absent="where that never happens, or where wheels are bound to roll",
    ),
    "steps": Quantity("Integration steps of the whole ride.", "1"),
    "unconverged_steps": Quantity(
        "Steps in which an iteration stopped before it met its tolerance.",
        "1",
        absent="where the engine does not say",
    ),
    "largest_residual": Quantity(
        "Largest relative residual that an iteration left in any step.", "1", absent="where the engine does not say"
    ),
    "cpu_time": Quantity(
        "Process time of the integration alone; it says as much of the machine as of the engine.", "s"
    ),
    "real_time_factor": Quantity(
        "Simulated time over CPU time.", "1", absent="where the CPU time is too short to be measured"
    ),
    "min_normal_force": Quantity(
        "Least contact force along the ground's normal; negative where the ground would have to pull.",
        "N",
        absent=_NO_FORCES,
    ),
    "fell_at": Quantity("Time of the fall.", "s", absent="where it did not fall"),
    "ended": Quantity("Why the ride ended before its time, in words.", "", absent="where it did not"),
    "horizon": Quantity(
        "Time up to which the comparison means anything: until then the motion's own instability has not grown the "
        "engine's first error to the size of the motion.",
        "s",
        absent=f"{_NO_REFERENCE}; where the motion amplifies no error, or there is no error",
    ),
}
