"""Makes the robot that robot_config.py describes."""

import gc
import os

from ring.robot import Robot

gc.collect()  # what compiling leaves behind, so that the next module finds room
from ring.wheel import Wheel, make_encoder

gc.collect()
from machine import ADC, I2C, UART, Pin, Timer

from ring.base import PERIOD_MS, Base
from ring.pulse_sensors import PulseSensor, kind_of

I2C_KINDS = ("srf08", "srf10")


def build(config) -> Robot:
    """Return the robot, whose base is already under control of a timer."""
    scan = None
    if config.SERVOS:
        from ring.scan import Scan

        scan = Scan(config.SERVOS)
        gc.collect()
    line = _line(config)
    gc.collect()
    sensors = make_sensors(config)
    config.SENSORS = None  # memory is scarce
    gc.collect()
    left = _wheel(config, 0)
    right = _wheel(config, 1)
    bumper = None if config.BUMPER is None else Pin(config.BUMPER, Pin.IN, Pin.PULL_UP)
    base = Base(config, left, right, bumper, _battery_low(config))
    base.timer = Timer(config.TIMER)
    base.timer.init(period=PERIOD_MS, mode=Timer.PERIODIC, callback=base.tick)
    boot_id = int.from_bytes(os.urandom(4), "little") or 1
    return Robot(config, sensors, base, line, boot_id, scan)


def _wheel(config, side: int) -> Wheel:
    encoder = make_encoder(side, *config.ENCODERS[side])
    return Wheel(config.MOTORS[side], encoder, config.ENCODER_COUNTS_PER_M, config.FULL_SPEED_MM_S)


def _battery_low(config):
    if config.BATTERY is None:
        return lambda: False
    pin, volts_at_full, low_volts = config.BATTERY
    adc = ADC(Pin(pin))
    low = int(65535 * low_volts / volts_at_full)
    return lambda: adc.read_u16() < low


def _line(config):
    if config.LINE is None:
        from ring.usb_line import UsbLine

        return UsbLine()
    from ring.uart_line import UartLine

    number, tx, rx, baud = config.LINE
    return UartLine(UART(number, baudrate=baud, tx=Pin(tx), rx=Pin(rx), txbuf=1024, rxbuf=512, timeout=0))


def make_sensors(config) -> tuple:
    """Return the ring's sensors, counter-clockwise from forward; sensors may share pins."""
    i2c = None
    triggers, timers, kinds, group, sensors = {}, {}, {}, [], []
    for entry in config.SENSORS:
        kind = entry[0]
        if kind in I2C_KINDS:
            from ring.i2c_sensors import I2cSensor

            if i2c is None:
                number, sda, scl = config.I2C
                i2c = I2C(number, sda=Pin(sda), scl=Pin(scl), freq=100_000)
            sensors.append(I2cSensor(i2c, entry[1]))
            continue
        _, trigger, echo = entry
        if kind not in kinds:
            kinds[kind] = kind_of(kind, config.TRIGGER_US)
        if trigger not in triggers:
            triggers[trigger] = Pin(trigger, Pin.OUT, value=0)
        if echo not in timers:
            timers[echo] = _timer(config, len(timers), group, echo)
        sensors.append(PulseSensor(kinds[kind], triggers[trigger], timers[echo]))
    return tuple(sensors)


def _timer(config, number: int, group: list, pin: int):
    if config.ECHO_TIMING == "irq":
        from ring.irq import IrqTimer

        return IrqTimer(group, pin)
    from ring.pio import PioTimer

    return PioTimer(number, pin)
