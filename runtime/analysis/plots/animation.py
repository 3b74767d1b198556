"""The animation of a run: the state of its map and objects over time.

Frames are drawn one by one. Pillow makes a GIF of them and ffmpeg, if it is installed, an MP4.
"""

from __future__ import annotations

import math
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.lines import Line2D
from numpy.typing import NDArray
from PIL import Image

from runtime.analysis.plots.cross_arcs import heard_cross_paths, newest_cross_paths
from runtime.analysis.plots.layers import (
    draw_arcs,
    draw_clusters,
    draw_cross_paths,
    draw_objects,
    draw_path,
    draw_segments,
    draw_world,
)
from runtime.analysis.plots.paper_figures import Canvas, legend
from runtime.analysis.plots.plot_style import MUTED
from runtime.analysis.timeline import RunSnapshot, Timeline
from runtime.support.length_format import Units

FRAMES_MAX: Final = 72
"""Frames at most, so that the GIF stays below a few megabytes."""
SECONDS: Final = 8.0
"""Duration of the animation before it pauses on the last frame."""
REST_S: Final = 2.5
"""Pause on the last frame."""
DPI: Final = 100
MOVING: Final = ("gif", "mp4")
"""Formats; the second only if ffmpeg is installed."""
ROOM_IN: Final = 1.45
"""Height for title, axis label and legend, which lists everything."""
COLOURS: Final = 128
"""Colours in the GIF's palette."""
COLOUR_STEP: Final = 8
"""Colours closer than this in every channel count as one, because pillow does not distinguish them."""
ECHOES_SHOWN: Final = 48
"""Newest echoes drawn: two firings of a ring of 24."""

Pixels = NDArray[np.uint8]


def frames(timeline: Timeline, units: Units) -> Iterator[Pixels]:
    """Yield the frames as RGB arrays of shape (height, width, 3), all of the same size."""
    snapshots = timeline.snapshots[:: max(1, math.ceil(len(timeline.snapshots) / FRAMES_MAX))]
    if timeline.last is not None and snapshots[-1] is not timeline.last:
        snapshots.append(timeline.last)
    canvas = Canvas(timeline, units)
    figure, axes = canvas.figure(ROOM_IN)
    painter: Any = FigureCanvasAgg(figure)  # its methods have no types
    figure.set_dpi(DPI)
    handles = draw_world(axes, timeline, canvas.frame)
    _title(axes, timeline.last, timeline)
    still = set(_drawn(axes))
    if timeline.last is not None:  # the layout includes everything that any frame shows
        legend(figure, [*handles, *_draw(axes, timeline, timeline.last, canvas)])
    painter.draw()
    figure.set_layout_engine("none")
    for snapshot in snapshots:
        for artist in _drawn(axes):
            if artist not in still:
                artist.remove()
        _draw(axes, timeline, snapshot, canvas)
        _title(axes, snapshot, timeline)
        painter.draw()
        shown: Pixels = np.asarray(painter.buffer_rgba())[: -1 if figure.bbox.height % 2 else None, :, :3].copy()
        yield shown


def _drawn(axes: Axes) -> list[Artist]:
    return [*axes.lines, *axes.patches, *axes.collections, *axes.texts]


def _title(axes: Axes, snapshot: RunSnapshot | None, timeline: Timeline) -> None:
    if snapshot is not None:
        axes.set_title(f"{snapshot.t_s:5.1f} s of {timeline.seconds:.1f} s")
        counts = (
            f"{len(snapshot.segments)} segments, {len(snapshot.clusters)} clusters, {len(snapshot.objects)} objects"
        )
        axes.set_title(counts, loc="right", fontsize=8.5, fontweight="normal", color=MUTED)


def _draw(axes: Axes, timeline: Timeline, snapshot: RunSnapshot, canvas: Canvas) -> list[Line2D]:
    """Draw the run at a snapshot: readings, segments, clusters, objects, path; return the handles of the legend."""
    settings, frame = timeline.settings, canvas.frame
    newest = timeline.echoes[max(0, snapshot.echoes - ECHOES_SHOWN) : snapshot.echoes]
    newest = newest[np.isfinite(newest["range_m"])]
    crosses = heard_cross_paths(newest_cross_paths(timeline.cross_paths, snapshot.t_s))
    half = math.radians(settings.ring.beam_half_angle_deg)
    poses = [m.pose for m in timeline.snapshots if m.t_s <= snapshot.t_s]
    return [
        *draw_arcs(axes, newest, half, frame),
        *draw_cross_paths(axes, crosses, half, frame),
        *draw_segments(axes, snapshot.segments, frame, faint=True),
        *draw_clusters(axes, snapshot.clusters, settings.perception.clusters.segments_min, frame),
        *draw_objects(axes, snapshot.objects, timeline, frame, "m", labelled=False),
        *draw_path(axes, poses, frame, settings.body.radius_m),
    ]


def save_moving(
    timeline: Timeline, units: Units, folder: Path, name: str, on_frame: Callable[[], None] = lambda: None
) -> list[Path]:
    """Write the animation as a GIF and, if ffmpeg is installed, as an MP4, and return the files.

    Axes are in `units`; `name` has no suffix; `on_frame` is called after each frame, for a progress bar.

    Raises
    ------
    OSError
        A file cannot be written.
    """
    shown = []
    for frame in frames(timeline, units):
        shown.append(frame)
        on_frame()
    if not shown:
        return []
    step_s = max(0.05, SECONDS / len(shown))
    gif, mp4 = (folder / f"{name}.{kind}" for kind in MOVING)
    paths = [_gif(shown, step_s, gif)]
    if (ffmpeg := shutil.which("ffmpeg")) is not None:
        paths += _mp4(shown, step_s, mp4, ffmpeg)
    return paths


def _gif(shown: list[Pixels], step_s: float, path: Path) -> Path:
    """Write the frames, the last of which rests for a while; return the file."""
    palette = _palette(shown)
    images = [Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in shown]
    step_ms = round(1000.0 * step_s)
    lasts = [step_ms] * (len(images) - 1) + [step_ms + round(1000.0 * REST_S)]
    images[0].save(path, save_all=True, append_images=images[1:], duration=lasts, loop=0, optimize=True)
    return path


def _palette(shown: list[Pixels]) -> Image.Image:
    """Return one palette for all frames, so that nothing flickers: the colours that cover most of two frames."""
    pixels = np.concatenate([shown[len(shown) // 2].reshape(-1, 3), shown[-1].reshape(-1, 3)])
    colours, counts = np.unique(pixels, axis=0, return_counts=True)
    colours = colours[np.argsort(-counts)]
    _, first = np.unique(colours // COLOUR_STEP, axis=0, return_index=True)
    palette = Image.new("P", (1, 1))
    palette.putpalette(colours[np.sort(first)[:COLOURS]].astype(np.uint8).tobytes())
    return palette


def _mp4(shown: list[Pixels], step_s: float, path: Path, ffmpeg: str) -> list[Path]:
    """Write the frames with ffmpeg; return the file, or nothing if ffmpeg cannot."""
    height, width, _ = shown[0].shape
    rest = [shown[-1]] * round(REST_S / step_s)
    command = [
        ffmpeg,
        "-y",
        "-loglevel",
        "error",
        "-f",
        "rawvideo",
        "-pix_fmt",
        "rgb24",
        "-s",
        f"{width}x{height}",
        "-r",
        f"{1.0 / step_s:.3f}",
        "-i",
        "-",
        "-vf",
        "pad=ceil(iw/2)*2:ceil(ih/2)*2",
        "-pix_fmt",
        "yuv420p",
        "-movflags",
        "+faststart",
        str(path),
    ]
    pixels = b"".join(frame.tobytes() for frame in [*shown, *rest])
    done = subprocess.run(command, input=pixels, capture_output=True, check=False)  # noqa: S603 - found by which
    return [path] if done.returncode == 0 else []
