"""The robot: pins and geometry, the one file to edit. Afterwards run `echolocate firmware` again for the robot file.

ESP32-WROOM-32: 12 HC-SR04 in a circle, TB6612FNG or L298N, two motors with encoders. Pins are GPIO numbers.
"""

NAME = "ring"
LINE = None  # the USB socket, through the board's converter; or (UART number, TX pin, RX pin, baud)
WATCHDOG = False  # True resets a board that hangs; then new files need the flash erased first

# The ring. Sensors counter-clockwise from forward: ("hc-sr04", trigger pin, echo pin), "mb10xx" or "mb12xx" with
# RX and PW pin, or ("srf08", I2C address of 7 bits), "srf10". Sensors that share a trigger pin fire together; sensors
# may share an echo pin, through a diode each, if they never fire together. Echoes of 5 V need dividers to 3.3 V.
SENSORS = (
    ("hc-sr04", 25, 34),
    ("hc-sr04", 26, 34),
    ("hc-sr04", 27, 34),
    ("hc-sr04", 25, 35),
    ("hc-sr04", 26, 35),
    ("hc-sr04", 27, 35),
    ("hc-sr04", 25, 36),
    ("hc-sr04", 26, 36),
    ("hc-sr04", 27, 36),
    ("hc-sr04", 25, 39),
    ("hc-sr04", 26, 39),
    ("hc-sr04", 27, 39),
)
TRIGGER_US = 20  # pulse that fires an hc-sr04; waterproof modules need 20 or more, the plain ones 10
# Sensors on servos, with MOUNTS: (sensor, pin, µs ahead, µs a quarter turn to the left, bearings, sweep in degrees).
SERVOS = ()
I2C = None  # (number, SDA pin, SCL pin) for srf08 and srf10
ECHO_TIMING = "irq"  # interrupts; the ESP32 has no state machines
RING_RADIUS_MM = 90  # from the middle between the wheels to the sensors
MOUNTS = (
    None  # for a ring that is no circle: (x mm, y mm, angle in degrees) of each sensor; the radius is the largest
)
BEAM_HALF_ANGLE_DEG = 15.0
RESOLUTION_M = 0.003  # what a range is good for; the clock measures to .2 mm
RANGE_MIN_M = 0.02
RANGE_MAX_M = 4.0
FIRING = "quadrants"  # a preset, or sets of sensors: ((0, 3, 6, 9), (1, 4, 7, 10), (2, 5, 8, 11))
STEP_PERIOD_S = 0.05

# The base. Motors and encoders: left, right; swap a motor's IN1 and IN2 if it turns backward, an encoder's A and B if
# it counts backward.
MOTORS = ((16, 17, 4), (18, 19, 5))  # IN1, IN2, PWM of the H-bridge
ENCODERS = ((21, 22), (23, 13))  # A, B
ENCODER_COUNTS_PER_M = 6860.0  # 4 edges × 7 pulses × gear 50 / (π × 65 mm)
WHEEL_BASE_MM = 150.0  # between the middles of the wheels
FULL_SPEED_MM_S = 600.0  # at full supply, wheels in the air
BODY_RADIUS_MM = 100.0
SPEED_MAX_MM_S = 400
TURN_MAX_MRAD_S = 2500
ACCELERATION_MM_S2 = 500.0
TURN_ACCELERATION_MRAD_S2 = 4000.0
DEADMAN_MS = 400  # after the last command the base stops by itself
BUMPER = None  # a pin that a contact pulls to ground
BATTERY = None  # (ADC pin, volts that read full scale, volts that are low)
TIMER = 0  # a hardware timer, 0 to 3
