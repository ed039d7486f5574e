"""A scenario small enough for the plain Python pass."""

YARD = """
name: yard
seed: 3
duration_s: 3
world:
  place: {type: open_field, side: 60}
team:
  rover:
    vehicle: {type: differential, step_s: 0.02, drive: {lag_s: 0.1}}
    start: {x: 1, yaw_deg: 90}
    sensors:
      - {type: imu, rate_hz: 20}
      - {type: body_twist, name: wheels, rate_hz: 10}
      - {type: gnss, rate_hz: 5}
    mission: {type: schedule, t_s: [0], u: [[0.5, 0, 0.1]]}
"""
