"""Outrider navigates teams of ground and aerial robots outdoors.

Conventions, decided once
-------------------------
Frames      World is ENU (x east, y north, z up), body is FLU (x forward, y left, z up): ROS REP-103. The chain is
            ``map -> odom -> base_link`` (REP-105): ``odom`` is continuous and drifts, ``map`` may be corrected.
            NED and FRD (MAVLink, PX4) are converted where they enter, in `outrider.io`, by `outrider.core.frames`.
Names       ``R_ab`` rotates from b to a, ``p_a`` is a vector in a, ``h_D_x`` is the Jacobian of h. Filters use the
            printed letters: x P F Q H R K S, and y for the innovation.
Rotations   Hamilton quaternions ordered **x y z w**. The error of an attitude is a rotation vector in the body frame:
            R = R_hat Exp(dtheta). No quaternion and no Euler angle is ever added to.
Headings    Radians counter-clockwise from east; a compass azimuth (clockwise from north) is converted on entry.
Units       SI and radians inside. Degrees appear in files, plots and on the command line, with the unit in the name.
Time        Integer nanoseconds in logs and results; float seconds since the log's first event inside kernels.
Covariance  Row-major, ordered as the state layout; a pose is (x y z, rotation vector in the body frame).
Datum       A site has one origin (latitude, longitude, height and what the height is measured from); positions are
            metres in the tangent plane there, never UTM.
Randomness  A `numpy.random.Generator` is an argument. The same input and seed give the same bits.
"""

__all__ = ["__version__"]  # pyright: ignore[reportUnsupportedDunderAll] - see below


def __getattr__(name: str) -> str:
    """`__version__`, looked up when asked for: reading the metadata costs a quarter of a help text's time."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("outrider")
    except PackageNotFoundError:  # a source tree that was never installed
        return "0+unknown"
