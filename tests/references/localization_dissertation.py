"""What the dissertation states of localizing its rotor (ch. 6): numbers, and the place in the text."""

from __future__ import annotations

# 6.1.3 and Fig. 6.6: one Hall sensor, 600 samples at 20 Hz, the rotor at 1 Hz.
ISOLINE_STRENGTHS = (6e-6, 10e-6, 20e-6, 50e-6, 100e-6)  # T
SAMPLES, SAMPLING_RATE, MOTOR_FREQUENCY = 600, 20.0, 1.0  # –, Hz, Hz
FARTHEST = 43e-3  # m, the distance at 6 µT
LEAST_SIGNAL_TO_NOISE = 10.0  # dB, at 6 µT
# Bounds of the errors over all isolines and β of 0° to 90°, Fig. 6.6c (iv) to (ix).
RATIO_ERROR = 0.12  # where b_max − b_min is at least 2 µT
BETA_ERROR, ALPHA_ERROR = 23.0, 10.0  # degrees
POSITION_ERROR = 7e-3  # m
DIRECTION_ERROR, AXIS_ERROR = 11.0, 23.0  # degrees
# 6.1.4: along the tracks of Fig. 6.7.
TRACK_DIRECTION_ERRORS, TRACK_AXIS_ERRORS = (5.0, 15.0), (10.0, 40.0)  # degrees
# 6.2: the sensor.
SENSOR_PEAK_NOISE, SENSOR_RESOLUTION = 3e-6, 0.1e-6  # T
# 6.1.2, Fig. 6.3d: the greatest field measured at distances along the moment.
MEASURED_FIELD = {10e-3: 411e-6, 20e-3: 55e-6, 30e-3: 18e-6, 40e-3: 7e-6}  # m: T
# 6.2: ranges of β that are told well, and b_ratio at their ends.
WELL_TOLD_BETA = (25.0, 60.0)  # degrees
WELL_TOLD_RATIO = (1.9, 1.4)
# 6.2: |dα/dβ| is at most one for β up to this.
ANGLE_SLOPE_BELOW_ONE = 60.0  # degrees
# 6.1.3, 6.2, Fig. S6.6: the rotor's field over the stator's at 200 mA, "one to two orders".
STATOR_CURRENT = 0.2  # A
ORDERS_OF_STATOR = (1.0, 2.0)
