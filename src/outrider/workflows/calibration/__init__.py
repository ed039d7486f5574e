"""Parameters of the sensors of a log, estimated from the log itself."""

from outrider.workflows.calibration.calibrate import Calibration, calibrate
from outrider.workflows.calibration.tune import Tuned

__all__ = ["Calibration", "Tuned", "calibrate"]
