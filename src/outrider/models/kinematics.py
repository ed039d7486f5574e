"""The kinematic view: what a sensor can feel of a robot, whatever its process model.

Every process model writes its state into one vector k (`K_*` below) and the Jacobian of k's tangent by its own error
state. Every sensor is written once against k. The chain rule joins them: H = D @ K, with D the sensor's Jacobian by the
tangent of k (`T_*`) and K that of the tangent by the error state. A new vehicle so inherits every sensor, and a new
sensor every vehicle.

======  ==========  =============================================================  ========
k       tangent     meaning                                                        frame
======  ==========  =============================================================  ========
K_P     T_P         position of the body origin [m]                                world
K_R     T_TH        attitude R_world_body, row-major; tangent is body-side         -
K_V     T_V         velocity of the body origin [m/s]                              world
K_W     T_W         angular rate [rad/s]                                           body
K_F     T_F         specific force at the body origin [m/s^2]                      body
K_BG    T_BG        gyro bias [rad/s]                                              body
K_BA    T_BA        accelerometer bias [m/s^2]                                     body
K_S     T_S         wheel scale error: true speed = (1 + s) measured speed         -
K_BN    T_BN        slowly varying GNSS position error [m]                         world
K_WIND  T_WIND      horizontal wind [m/s]                                          world
K_BB    T_BB        barometer offset [m]                                           -
K_BR    T_BR        range offset common to all beacons [m]                         -
======  ==========  =============================================================  ========
"""

from typing import Final

K_P: Final = 0
K_R: Final = 3
K_V: Final = 12
K_W: Final = 15
K_F: Final = 18
K_BG: Final = 21
K_BA: Final = 24
K_S: Final = 27
K_BN: Final = 28
K_WIND: Final = 31
K_BB: Final = 33
K_BR: Final = 34
K_M: Final = 35
K_SIZE: Final = 38

T_P: Final = 0
T_TH: Final = 3
T_V: Final = 6
T_W: Final = 9
T_F: Final = 12
T_BG: Final = 15
T_BA: Final = 18
T_S: Final = 21
T_BN: Final = 22
T_WIND: Final = 25
T_BB: Final = 27
T_BR: Final = 28
T_M: Final = 29
T_SIZE: Final = 32
