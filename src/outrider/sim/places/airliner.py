"""A parked airliner of the size of an Airbus A320: 37.57 m long, 34.1 m wide (35.8 m with sharklets), 11.76 m high.

Its own frame is forward-left-up with the origin on the ground below the tip of the nose. Overall sizes, the fuselage's
diameter and the places of the gear legs are the aircraft's; the rest is drawn to look like it.
"""

from math import cos, pi, radians, sin, tan
from typing import Final

import numpy as np

from outrider.core.attitudes import rpy_to_quats
from outrider.core.solids import box, capsule, cylinder, plate, tapered
from outrider.sim.world import Body, Solids, Wind, World
from outrider.typing import Floats

LENGTH: Final = 37.57  # m
SPAN: Final = 34.1
SHARKLET_SPAN: Final = 35.8
HEIGHT: Final = 11.76
_RADIUS, _AXIS = 1.975, 3.75  # of the fuselage, and its height
_SWEEP = radians(25.0)  # of the quarter-chord line
_DIHEDRAL = radians(5.1)
_FORWARD = (1.0, 0.0, 0.0)

LEGS: Final = ("nose gear", "left main gear", "right main gear")
_LEG_PLACES = ((-5.07, 0.0), (-17.71, 3.795), (-17.71, -3.795))

Part = tuple[str, Floats]


def parked_airliner(*, sharklets: bool = False, wind: Wind = Wind()) -> World:
    """The apron of the aircraft inspection: the airliner with its nose towards the origin and its tail to the north.

    Source: coop2024 describes it in north-east-down axes: nose at x = +1 m, fuselage along +x, robots starting near
    (-2, 0, 0). Here axes are east-north-up: x there is our y, y there our x, z there our -z. So the nose is at
    (0, 1) m and points south, the tail ends at (0, 38.57), and the robots start near (0, -2, 0), facing north.
    """
    p, q = np.array([0.0, 1.0, 0.0]), rpy_to_quats(np.array([[0.0, 0.0, -0.5 * pi]]))[0]
    legs = {name: np.array([x, y, 0.0]) for name, (x, y) in zip(LEGS, _LEG_PLACES, strict=True)}
    return World(
        name="parked airliner",
        solids=airliner(sharklets=sharklets).moved(p, q),
        objects={"airliner": Body(p=p, q=q, features=legs)},
        wind=wind,
    )


def airliner(*, sharklets: bool = False) -> Solids:
    """The aircraft in its own frame."""
    parts = [*_fuselage(), *_gear()]
    for side, name in ((1.0, "left"), (-1.0, "right")):
        parts += [*_wing(side, name, sharklets), *_engine(side, name), _tailplane(side, name)]
    return Solids.of(*parts)


def _fuselage() -> list[Part]:
    joint, end = -25.0, 0.35
    fin = plate(
        (-29.3, 0.0, 5.3),
        _FORWARD,
        (0.0, 0.0, 1.0),
        span=HEIGHT - 5.3,
        chords=(6.0, 2.0),
        back=(HEIGHT - 5.3) * tan(radians(40.0)),
        thickness=(0.5, 0.2),
    )
    return [
        ("fuselage", capsule((-_RADIUS, 0.0, _AXIS), (joint, 0.0, _AXIS), _RADIUS)),
        ("tail cone", tapered((joint, 0.0, _AXIS), (end - LENGTH, 0.0, _AXIS + 1.15), _RADIUS, end)),
        ("fin", fin),
    ]


def _half_span(width: float, tip: float, dihedral: float) -> float:
    """Length of a half wing along itself so that its tip, `tip` thick, ends `width` from the middle."""
    return (width - 0.5 * tip * sin(dihedral)) / cos(dihedral)


def _outward(side: float, dihedral: float) -> tuple[float, float, float]:
    return (0.0, side * cos(dihedral), sin(dihedral))


def _wing(side: float, name: str, sharklets: bool) -> list[Part]:
    root, chords, thickness = np.array([-11.9, 0.0, 2.5]), (5.6, 1.6), (0.75, 0.18)
    span, outward = _half_span(0.5 * SPAN, thickness[1], _DIHEDRAL), _outward(side, _DIHEDRAL)
    back = span * tan(_SWEEP) + 0.25 * (chords[0] - chords[1])
    wing = plate(root, _FORWARD, outward, span=span, chords=chords, back=back, thickness=thickness)
    if not sharklets:
        return [(f"{name} wing", wing)]
    tip = root + span * np.array(outward) - back * np.array(_FORWARD)
    lean, thin = radians(70.0), 0.1
    rise = _half_span(0.5 * SHARKLET_SPAN - abs(tip[1]), thin, lean)
    up = _outward(side, lean)
    sharklet = plate(tip, _FORWARD, up, span=rise, chords=(1.6, 0.7), back=1.2, thickness=(thin, thin))
    return [(f"{name} wing", wing), (f"{name} sharklet", sharklet)]


def _tailplane(side: float, name: str) -> Part:
    dihedral, thin = radians(6.0), 0.12
    span = _half_span(6.225, thin, dihedral)
    root, outward, back = (-31.9, 0.0, 4.75), _outward(side, dihedral), span * tan(radians(32.0))
    surface = plate(root, _FORWARD, outward, span=span, chords=(4.1, 1.4), back=back, thickness=(0.4, thin))
    return f"{name} tailplane", surface


def _engine(side: float, name: str) -> list[Part]:
    y, z, radius = 5.75 * side, 1.7, 1.1
    return [
        (f"{name} engine", cylinder((-11.2, y, z), (-14.4, y, z), radius)),
        (f"{name} engine", tapered((-14.3, y, z), (-15.9, y, z), radius - 0.05, 0.45)),
        (f"{name} engine", box((-14.6, y, 2.8), (3.6, 0.3, 0.5))),  # pylon
    ]


def _gear() -> list[Part]:
    """A strut and its twin wheels, as one roller, standing on the ground."""
    parts: list[Part] = []
    sizes = ((0.12, 1.9, 0.38, 0.5), (0.17, 2.6, 0.585, 1.3), (0.17, 2.6, 0.585, 1.3))
    for name, (x, y), (strut, top, wheel, width) in zip(LEGS, _LEG_PLACES, sizes, strict=True):
        parts.append((name, capsule((x, y, wheel), (x, y, top), strut)))
        parts.append((name, cylinder((x, y - 0.5 * width, wheel), (x, y + 0.5 * width, wheel), wheel)))
    return parts
