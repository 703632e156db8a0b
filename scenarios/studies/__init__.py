"""Studies that run one scenario many times."""

from .precision import all_ran, precision, write_precision

__all__ = ["all_ran", "precision", "write_precision"]
