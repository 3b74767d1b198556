"""`echolocate map`: the map of a finished run as a world file, an occupancy image and GeoJSON."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Literal

from config.errors import DONE, FAILED, UserError
from config.files import utf8
from runtime.cli.commands.offline_io import plain_console, read_timeline
from runtime.cli.commands.output_files import check_outputs, writing
from runtime.cli.options import Force, Sets
from runtime.cli.source_options import NO_OPTIONS, File, SourceOptions
from runtime.support.kernel_cache import use_kernel_cache
from runtime.support.progress import progress


def map_run(
    file: File,
    /,
    *,
    out: str,
    grid: str | None = None,
    geojson: str | None = None,
    force: Force = False,
    options: SourceOptions = NO_OPTIONS,
    sets: Sets = (),
) -> int:
    """Write the map of a run as a world file, as an occupancy image with the YAML of ROS's map_server, as GeoJSON.

    What is not straight, a polyline, is a wall for each of its pieces.
    Of a run in a known room (`run --map`) it is that map, corrected by what the run found, and what changed is said.

    Parameters
    ----------
    out
        World file to write (TOML).
    grid
        Image to write (PGM); its YAML is written beside it.
    geojson
        GeoJSON to write: drums, polygons and walls in metres of the map's own frame.
    force
        Overwrite files that exist already.
    file
        Recording or ring log of the run.
    options
        Settings that a recording contains and a ring log does not.
    sets
        Single settings, each `path=value`, that override the others.

    Raises
    ------
    UserError
        The input cannot be read, an output cannot be written, or the map is too large for one.
    """
    import numpy as np
    import orjson

    from config.world import ITEMS_MAX
    from runtime.analysis.export.geojson import world_geojson
    from runtime.analysis.export.occupancy_image import occupancy_image, yaml_beside
    from runtime.analysis.export.shapes import scans_of
    from runtime.analysis.export.world_file import round_names, with_places, world_of, world_text
    from runtime.analysis.map_changes import MapChange, compare_with_map
    from runtime.analysis.timeline_builder import wall_ends

    use_kernel_cache()
    console, output, source = plain_console(stderr=True), plain_console(), options.timeline_source(file, sets)
    beside = None if grid is None else yaml_beside(Path(grid))
    files = {"--out": out, "--grid": grid, "--grid (its YAML)": beside, "--geojson": geojson}
    timeline = read_timeline(source, console, partial(check_outputs, files, source.inputs, force=force))
    settings, view, changes = timeline.settings, timeline.map_view, list[MapChange]()
    objects, walls, polylines = (
        (timeline.objects, wall_ends(timeline.walls), timeline.polylines)
        if view is None
        else (view.objects, view.walls, view.polylines)
    )
    if len(objects) + len(walls) + sum(len(one.points) - 1 for one in polylines) > ITEMS_MAX:
        raise UserError(f"{file}: a world file holds at most {ITEMS_MAX} objects, walls and pieces together", FAILED)
    world = world_of(objects, walls, settings.models, polylines if view is None else ())
    echoes = timeline.echoes if timeline.known_echoes is None else timeline.known_echoes
    half_angle_rad = math.radians(settings.ring.beam_half_angle_deg)
    head = f"Map of {utf8(Path(file).name)}: what was recognised, in the frame of its odometry (m)."
    if view is not None:
        if not len(view.echoes):
            raise UserError(
                f"{file}: the robot never knew its place in the map; drive farther, or check that it is the "
                "map of this room",
                FAILED,
            )
        echoes = view.echoes
        changes, world = compare_with_map(
            view.known, world, round_names(objects, settings.models), echoes, half_angle_rad, polylines
        )
        head = f"The map of {utf8(Path(file).name)}, corrected by what that run found (m)."
    world = with_places(world, settings.places)
    with writing("--out", out):
        Path(out).write_text(world_text(world, (head,)), encoding="utf-8")
    output.print(f"{out}: {len(world.drum)} drums, {len(world.polygon)} polygons, {len(world.wall)} walls")
    if (marked := world.places()).has_any:
        output.print(f"{out}: {marked}")
    for change in changes:
        output.print(str(change))
    if view is not None and not changes:
        output.print("nothing has changed where the robot has looked")
    if geojson is not None:
        frame: Literal["odom", "map"] = "odom" if view is None else "map"
        features = world_geojson(world, utf8(Path(file).stem), frame)
        with writing("--geojson", geojson):
            Path(geojson).write_bytes(orjson.dumps(features) + b"\n")
        output.print(f"{geojson}: {len(features['features'])} features")
    if grid is not None:
        try:
            scans = np.array([(scan.x, scan.y) for scan in scans_of(echoes, settings.ring)]).reshape(-1, 2)
            way = scans if view is None else view.way
            with progress(console, "drawing the map"):
                image = occupancy_image(
                    world,
                    echoes,
                    settings.ring,
                    way,
                    settings.body.radius_m,
                    settings.perception.grid.method,
                    surfaces_mapped=settings.perception.maps_surfaces,
                )
        except ValueError as error:
            raise UserError(f"--grid {grid}: {error}; the robot's way is too wide for one", FAILED) from error
        with writing("--grid", grid):
            beside = image.write(Path(grid))
        rows, columns = image.pixels.shape
        output.print(f"{grid}: {columns} × {rows} pixels, described by {beside}")
    for note in timeline.notes:
        console.print(note)
    return DONE
