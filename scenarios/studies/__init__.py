"""Studies that run one scenario many times."""

from .precision import all_ran, study_precision, write_precision

__all__ = ["all_ran", "study_precision", "write_precision"]
