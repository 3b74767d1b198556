"""`echolocate calibrate`: a robot file from a drive by a wall and a drum."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter
from rich.table import Table

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from config.files import utf8
from runtime.cli.commands.offline_io import plain_console
from runtime.cli.commands.output_files import check_outputs, writing
from runtime.cli.options import Force, RobotFile
from runtime.cli.source_options import File, LogOptions
from runtime.recording.conventions.options import AUTO, RingLogOptions

if TYPE_CHECKING:
    from config.robot import RingConfig
    from config.settings import Settings
    from drivers.messages import Firing
    from perception.calibration.calibrate import Calibration

FIRINGS_MIN: Final = 100
"""Fewest firings of a drive."""


def calibrate(
    file: File,
    /,
    *,
    out: str,
    way: float | None = None,
    drum: Annotated[tuple[float, ...], Parameter(negative="", show_default=False)] = (),
    force: Force = False,
    robot: RobotFile = None,
    options: LogOptions = AUTO,
) -> int:
    """Find a robot's mounts, beams and scales from a drive by a wall and a drum, and write them as a robot file.

    The drive: stand a metre from a bare wall, turn slowly twice on the spot; drive some metres, away from the wall
    and past something round; turn slowly twice again. Measure the way between both stands, and what is round.

    Parameters
    ----------
    out
        Robot file to write (TOML).
    way
        Measured distance between both stands, m; without it, a round object's radius alone shows lengths.
    drum
        Measured radius of a round object beside the way, m; may be repeated.
    force
        Overwrite files that exist already.
    file
        Recording or ring log of the drive.
    robot
        Ring logs: the nominal robot, file or name of a shipped one; None for the default.
    options
        The conventions of a ring log.

    Raises
    ------
    UserError
        The file cannot be read or written, or the drive does not show what is needed.
    """
    from perception.calibration.calibrate import calibrate as find_calibration
    from runtime.recording.conventions.echo_lag import at_heard_poses

    for option, value in (*(("--drum", radius) for radius in drum), ("--way", way)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise UserError(f"{option} {value}: must be a length above 0, in metres", WRONG_CALL)
    settings, firings = read_firings(
        file, robot, lambda: check_outputs({"--out": out}, (file,), force=force), options
    )
    if len(firings) < FIRINGS_MIN:
        raise UserError(f"{file}: holds only {len(firings)} firings; record the whole drive and try again", FAILED)
    if settings.ring.turning:
        which = f"{robot or file}: only some of its sensors turn with the wheels"
        raise UserError(f"{which}; calibrate each of its rings by a robot file of its own", WRONG_CALL)
    if settings.ring.has_servo:
        which = f"{robot or file}: a sensor on a servo looks in many directions"
        raise UserError(
            f"{which}; calibrate sensors that are fixed, and measure the servo's axis by hand", WRONG_CALL
        )
    lag, what = _echo_lag(firings, settings.ring, options)
    firings = list(at_heard_poses(firings, lag))
    found = find_calibration(firings, settings.ring, drum, way, synchro=settings.body.synchro)
    if found is None:
        raise UserError(
            f"{file}: no surface was heard often enough from enough places, so nothing was written; drive nearer to "
            "a wall and turn more slowly",
            FAILED,
        )
    refuse_without_gain(file, found, lag_is_new=lag != settings.ring.echo_lag_s)
    with writing("--out", out):
        Path(out).write_text(robot_text(settings, found, Path(file).name, lag), encoding="utf-8")
    output = plain_console()
    output.print(sensors_table(settings, found))
    output.print(scales_line(found))
    output.print(what)
    for what, sigmas in (("places", found.place_sigmas_m), ("directions", found.angle_sigmas_rad)):
        nominal = [str(i) for i, sigma in enumerate(sigmas.tolist()) if not math.isfinite(sigma)]
        if nominal:
            which = "all sensors" if len(nominal) == len(sigmas) else f"sensors {', '.join(nominal)}"
            output.print(f"the {what} of {which} are not shown by this drive and stay as they were")
    if way is None:
        output.print("without a measured way, lengths are known less well: measure it and give --way")
    output.print(f"{out}: robot file written; use it with: echolocate run --robot {out} --port DEVICE")
    return DONE


def refuse_without_gain(file: str, found: Calibration, *, lag_is_new: bool) -> None:
    """Refuse to write a robot file that would say no more than the one before.

    Parameters
    ----------
    file : str
        The drive's file.
    found : Calibration
        The calibration.
    lag_is_new : bool
        Whether the drive shows another lag of the ranges.

    Raises
    ------
    UserError
        The drive shows nothing of the robot, or nothing that its file does not say.
    """
    if not (found.shows_any or lag_is_new):
        raise UserError(
            f"{file}: the drive shows neither where the sensors are nor by how much odometry and ranges are wrong; "
            "nothing was written: turn slowly twice on the spot a metre from a bare wall, drive four metres past "
            "something round, turn twice again, and measure the way (--way) and the radius (--drum)",
            FAILED,
        )
    if not (found.has_gain or lag_is_new):
        raise UserError(
            f"{file}: the robot is as its file says, as far as this drive shows: nothing differs by more than the "
            "noise of the drive explains, so nothing was written; a longer drive shows smaller differences",
            FAILED,
        )


def _echo_lag(firings: Sequence[Firing], ring: RingConfig, options: RingLogOptions) -> tuple[float, str]:
    """Return by how much ranges lag behind odometry, s, and how that is known."""
    from perception.localization.submaps.echo_lag import lag_of

    if options.echo_lag_s is not None:
        return options.echo_lag_s, f"ranges lag behind odometry by {options.echo_lag_s:+.3f} s, as --echo-lag says"
    found = lag_of(firings, ring)
    if not math.isfinite(found.sigma_s):
        return ring.echo_lag_s, "by how much ranges lag behind odometry is not shown by this drive"
    if found.is_refuted:
        return found.lag_s, str(found)
    return ring.echo_lag_s, f"{found}: too little to change the {ring.echo_lag_s:g} s of before"


def sensors_table(settings: Settings, found: Calibration) -> Table:
    """Return a table of the mounts, beside the nominal ones.

    Parameters
    ----------
    settings : Settings
        The nominal robot.
    found : Calibration
        The calibration.
    """
    table = Table(title="Sensors, as calibrated")
    for name in ("sensor", "echoes", "x mm", "y mm", "±", "moved", "angle °", "±", "turned"):
        table.add_column(name, justify="right")
    for i, nominal in enumerate(settings.ring.mounts):
        x, y, angle = found.mounts[i].tolist()
        sigma = math.degrees(found.angle_sigmas_rad[i])
        table.add_row(
            str(i),
            str(found.readings[i]),
            f"{1e3 * x:.1f}",
            f"{1e3 * y:.1f}",
            _shown(1e3 * found.place_sigmas_m[i], 1),
            f"{1e3 * math.hypot(x - nominal.x_m, y - nominal.y_m):.1f}",
            f"{math.degrees(angle):.2f}",
            _shown(sigma, 2),
            f"{math.degrees(angle - nominal.angle_rad):+.2f}",
        )
    return table


def scales_line(found: Calibration) -> str:
    """Return scales, beam and noise in words.

    Parameters
    ----------
    found : Calibration
        The calibration.
    """
    scales = ", ".join(
        f"{name} {100.0 * (value - 1.0):+.2f} % (± {100.0 * sigma:.2f})"
        if math.isfinite(sigma)
        else f"{name} not shown"
        for name, value, sigma in zip(
            ("odometry's distance", "its turn", "range"), found.scales, found.scale_sigmas, strict=True
        )
    )
    beam = "all in the beam answers" if found.everything_echoes else "mirrors answer"
    return (
        f"scales, reported over true: {scales}\n"
        f"beam: half angle {math.degrees(found.half_angle_rad):.2f}°, {beam}; noise of a range: "
        f"{1e3 * found.noise.constant_m:.1f} mm and {100.0 * found.noise.share:.2f} % of it"
    )


def _shown(sigma: float, digits: int) -> str:
    """Return an uncertainty, or a dash where the drive does not show the value."""
    return f"{sigma:.{digits}f}" if math.isfinite(sigma) else "–"


def robot_text(settings: Settings, found: Calibration, source: str, echo_lag_s: float = 0.0) -> str:
    """Return the robot file of a calibrated robot.

    Parameters
    ----------
    settings : Settings
        The nominal robot.
    found : Calibration
        The calibration.
    source : str
        Name of the drive's file.
    echo_lag_s : float
        By how much ranges lag behind odometry.
    """
    import tomli_w

    from config.robot import RobotConfig

    parts = {name: getattr(settings, name) for name in RobotConfig.model_fields}
    parts |= settings.model_extra or {}  # of an installed driver
    tables = RobotConfig(**parts).model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    ring = tables.pop("ring")
    for name in ("count", "radius_m", "sensors", "echo_lag_s"):
        ring.pop(name, None)
    if echo_lag_s != 0.0:
        ring["echo_lag_s"] = round(echo_lag_s, 3)
    ring["beam_half_angle_deg"] = round(math.degrees(found.half_angle_rad), 2)
    firing = ring.pop("firing", None)
    before = settings.calibration
    tables["calibration"] = {
        "distance_scale": round(before.distance_scale * found.scales.distance, 5),
        "turn_scale": round(before.turn_scale * found.scales.turn, 5),
        "range_scale": round(before.range_scale * found.scales.range, 5),
    }
    rows = []
    for mount, place_m, angle_rad in zip(
        found.mounts.tolist(), found.place_sigmas_m, found.angle_sigmas_rad, strict=True
    ):
        x, y, angle = mount
        place = f"± {1e3 * place_m:.1f} mm" if math.isfinite(place_m) else "its place is the nominal one"
        sure = f"± {math.degrees(angle_rad):.2f}°" if math.isfinite(angle_rad) else "its direction is the nominal one"
        rows.append(
            f"    {{ x_m = {x:.4f}, y_m = {y:.4f}, angle_deg = {math.degrees(angle):.2f} }},  # {place}, {sure}"
        )
    d, t, r = (
        f"{100.0 * sigma:.2f} %" if math.isfinite(sigma) else "not shown by the drive" for sigma in found.scale_sigmas
    )
    head = [
        f"# Calibrated from {utf8(Path(source).name)}.",
        f"# Uncertainty of the scales (one standard deviation): distance {d}, turn {t}, range {r}.",
        "",
        "[ring]",
        *tomli_w.dumps(ring).splitlines(),
        "sensors = [",
        *rows,
        "]",
        "",
    ]
    if firing is not None:
        head += [*tomli_w.dumps({"ring": {"firing": firing}}).splitlines(), ""]
    return "\n".join([*head, *tomli_w.dumps(tables).splitlines(), ""])


def read_firings(
    file: str, robot: str | None, check: Callable[[], None], options: RingLogOptions = AUTO
) -> tuple[Settings, list[Firing]]:
    """Return the settings and the firings of a recording or ring log at the poses that the robot gave.

    Parameters
    ----------
    file : str
        The file.
    robot : str, optional
        Of a ring log: robot file, or the name of a shipped one.
    check : callable
        Called before the firings are read; raises an error if outputs cannot be written.
    options : RingLogOptions
        Conventions of a ring log. What is found in the data is printed.

    Raises
    ------
    UserError
        The file cannot be read.
    """
    from config.load import load_settings
    from runtime.analysis.export.ring_log_export import recorded_firings
    from runtime.recording.conventions.reading import open_ring_log
    from runtime.recording.reader import is_recording, open_recording

    path = Path(file)
    if not is_recording(path):
        settings = load_settings(None, (), robot=robot)
        check()
        console = plain_console(stderr=True)
        return settings, list(
            open_ring_log(
                path, settings, replace(options, echo_lag="0"), lambda text: console.print(f"echolocate: {text}")
            )
        )
    options.refuse_for(file)
    if robot is not None:
        raise UserError(f"{file}: is a recording and contains its robot; --robot is for ring logs", WRONG_CALL)
    with open_recording(path) as recording:
        check()
        return recording.settings, recorded_firings(recording)
