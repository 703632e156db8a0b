"""What becomes of a disturbed ride."""

from __future__ import annotations

from dataclasses import dataclass

RETURNED = "returned"  # to the stable circle of the ride's energy
ORBIT = "orbit"  # to the stable periodic orbit of the ride's energy
ELSEWHERE = "elsewhere"  # to another stable circle of the same energy
LOST_CONTACT = "lost-contact"  # the ground would have to pull a wheel
TOUCHED = "touched"  # a rim touched the ground at a second place
FELL = "fell"
BROKE_OFF = "broke-off"  # the ground ended, or the equations became singular
UNDECIDED = "undecided"  # none of these within the longest time
NO_START = "no-start"  # no wheel can stand there, or a rim would be inside the ground

KINDS = (RETURNED, ORBIT, ELSEWHERE, LOST_CONTACT, TOUCHED, FELL, BROKE_OFF, UNDECIDED, NO_START)
SURVIVED = (RETURNED, ORBIT)


@dataclass(frozen=True)
class RideOutcome:
    """What became of a ride.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    time : float
        When this happened, or when it was decided [s].
    energy : float
        Of the ride, kinetic and potential, the latter zero at z = 0 [J]; nan without a start.
    lean_amplitude : float
        Half of the peak-to-peak of the lean in the last stretch that was looked at [rad]; nan where the ride ended
        within it.
    detail : str
        Which wheel, or why.
    """

    kind: str
    time: float
    energy: float
    lean_amplitude: float = float("nan")
    detail: str = ""

    @property
    def survived(self) -> bool:
        """Whether the ride has come back to a circle near by, or to the stable orbit about it."""
        return self.kind in SURVIVED

    @property
    def lost(self) -> bool:
        """Whether the ride certainly has not survived; neither is known of an undecided one."""
        return not self.survived and self.kind != UNDECIDED
