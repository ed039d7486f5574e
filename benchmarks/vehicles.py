"""Vehicles: one integration step, with all that a simulated sensor needs: pose, velocity, body rate, specific force."""

import importlib.util
from dataclasses import replace
from functools import cache

import numpy as np

from benchmarks.table import Row, Side
from outrider.models.vehicles import LEVEL, ROW_SIZE, Mecanum, Multirotor, Rotorcraft
from outrider.models.vehicles.rigid import X_ROTORS

QUAD = replace(Rotorcraft(), direct=True, drag=(0.0, 0.0, 0.0), gravity=9.81)  # RotorPy knows no other gravity
SPEEDS = np.array([470.0, 505.0, 480.0, 500.0])  # rad/s: it tumbles away
STEPS = 20_000


@cache
def arrays(events, columns, actuators):
    """Commands, wind and rows."""
    return np.zeros((events, columns)), np.zeros((events, 3)), np.empty((events, ROW_SIZE + actuators))


def run(vehicle, x, events, command):
    """The last row after so many steps."""
    u, air, out = arrays(events, len(vehicle.inputs), len(vehicle.actuators))
    u[:] = command
    vehicle.run(x, u, air, LEVEL, out)
    return out[-1].copy()


def ours(events):
    """Rotor speeds commanded, rotors already there."""
    x = QUAD.launch(np.array([0.0, 0.0, 100.0]), np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3))
    x[X_ROTORS : X_ROTORS + 8] = np.tile(SPEEDS, 2)
    return run(QUAD, x, events, SPEEDS)[:ROW_SIZE]


def controlled(events):
    """The same body under its velocity controller."""
    return run(Rotorcraft(), Rotorcraft().start(np.array([0.0, 0.0, 100.0]), 0.0), events, [1.0, 2.0, 0.1, 0.2])


def velocity_response(events):
    """First-order multirotor."""
    return run(Multirotor(), Multirotor().start(np.array([0.0, 0.0, 100.0]), 0.0), events, [1.0, 2.0, 0.1, 0.2])


def mecanum(events):
    """Four wheels."""
    return run(Mecanum(), Mecanum().start(np.zeros(3), 0.0), events, [0.5, 0.2, 0.1])


@cache
def mujoco_model():
    """The same body, its rotors as motors at sites, RK4, gyroscope and accelerometer."""
    import mujoco

    sites = "".join(f'<site name="r{i}" pos="{r.x} {r.y} 0"/>' for i, r in enumerate(QUAD.rotors))
    motors = "".join(
        f'<motor site="r{i}" gear="0 0 {r.thrust} 0 0 {-r.spin * r.torque}"/>' for i, r in enumerate(QUAD.rotors)
    )
    inertia = " ".join(map(str, QUAD.inertia))
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{QUAD.step_s}" integrator="RK4" gravity="0 0 {-QUAD.gravity}"/>
        <worldbody><body pos="0 0 100"><freejoint/><site name="imu"/>{sites}
        <inertial pos="0 0 0" mass="{QUAD.mass}" diaginertia="{inertia}"/></body></worldbody>
        <actuator>{motors}</actuator>
        <sensor><gyro site="imu"/><accelerometer site="imu"/></sensor></mujoco>"""
    )


def mujoco_steps(events):
    """All steps in one call of MuJoCo; the sensors once more at the end, for they lag its steps."""
    import mujoco

    model = mujoco_model()
    data = mujoco.MjData(model)
    data.ctrl[:] = SPEEDS**2
    mujoco.mj_step(model, data, nstep=events)
    mujoco.mj_forward(model, data)
    w, x, y, z = data.qpos[3:7]
    return np.concatenate((data.qpos[:3], [x, y, z, w], data.qvel[:3], data.sensordata))


def rotorpy_steps(events):
    """RotorPy without aerodynamics, from Python, as it is made to be used."""
    from rotorpy.vehicles.hummingbird_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor as Peer

    rotors = QUAD.rotors
    params = quad_params | {
        "mass": QUAD.mass, "Ixx": QUAD.inertia[0], "Iyy": QUAD.inertia[1], "Izz": QUAD.inertia[2],
        "rotor_pos": {f"r{i}": np.array([r.x, r.y, 0.0]) for i, r in enumerate(rotors)},
        "rotor_directions": np.array([-r.spin for r in rotors]), "k_eta": rotors[0].thrust, "k_m": rotors[0].torque,
    }  # fmt: skip
    state = {"x": np.array([0.0, 0.0, 100.0]), "v": np.zeros(3), "q": np.array([0.0, 0.0, 0.0, 1.0])}
    state |= {"w": np.zeros(3), "wind": np.zeros(3), "rotor_speeds": SPEEDS}
    peer = Peer(params, initial_state=state, aero=False)
    for _ in range(events):
        state = peer.step(state, {"cmd_motor_speeds": SPEEDS}, QUAD.step_s)
    f = np.array([0.0, 0.0, rotors[0].thrust * (state["rotor_speeds"] ** 2).sum() / QUAD.mass])
    return np.concatenate((state["x"], state["q"], state["v"], state["w"], f))


def rows():
    """Rows of this module; RotorPy, which brings many packages with it, where it is installed."""
    peers = [Side("MuJoCo, all steps in one call", mujoco_steps, 5000)]
    if importlib.util.find_spec("rotorpy"):
        peers.append(Side("RotorPy", rotorpy_steps, 100))
    return [
        Row("rigid quadrotor, RK4, 5 ms, per step", Side("Rotorcraft", ours, STEPS), peers, target=0.5, tolerance=1e-8),
        Row("the same under its velocity controller", Side("Rotorcraft", controlled, STEPS), target=0.5),
        Row("multirotor, velocity response, per step", Side("Multirotor", velocity_response, STEPS), target=0.5),
        Row("four mecanum wheels, per step", Side("Mecanum", mecanum, STEPS), target=0.5),
    ]
