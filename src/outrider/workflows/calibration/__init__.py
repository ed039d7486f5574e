"""Parameters of the sensors of a log, estimated from the log itself."""

from outrider.workflows.calibration.calibrate import Calibration, calibrate

__all__ = ["Calibration", "calibrate"]
