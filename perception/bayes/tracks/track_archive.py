"""Which tracks are worked on: those near the robot. What lies behind is archived until the robot returns.

The limit of the arrays is never met in silence: before they are full the farthest object is archived, and where more
is near than fits, the farthest wait and are counted. No object starts twice: a track that starts in the place
of an archived object becomes that object. Tentative tracks are no objects, and are not archived.
"""

from __future__ import annotations

import contextlib
import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import ESTABLISHED, FREE, CircleTrack, Memory, PolygonTrack
from perception.bayes.tracks.archived_tracks import archived_bounds, archived_dtype, free_row, move_rows, pack, unpack
from perception.bayes.tracks.manual_tracks import leave_job
from perception.bayes.tracks.naming import sure_polygons
from perception.bounds import COUNT, PLACE, bounds
from perception.kernel import Floats, Ints
from perception.map_moves import MapMoves
from perception.mapping.archive import Archive
from perception.records import Structured

BEHIND_M: Final = 2.0
"""An object this much beyond the sensors' range is behind the robot."""
AHEAD_M: Final = 1.0
"""An object less than this beyond the sensors' range is near."""
LOOK_M: Final = 0.5
"""After this way the robot looks for objects to archive and to take up."""
HELD_SHARE: Final = 0.8
"""Share of the tracks that objects may take; the others are for hypotheses."""


LOOKED: Final = PLACE._replace(infinite=True)
"""Of where the robot last looked for objects, m; infinite before the first look."""


class TrackArchive:
    """The archived objects, circles and polygons.

    Attributes
    ----------
    circles, polygons : Archive
        Their records, of `archived_tracks.archived_dtype`.
    waiting : int
        Archived objects near the robot for which no track was free at the last look.
    submap : int
        Number of the map of the way that goes on, with which what is archived now moves.
    """

    BOUNDS: Final = bounds(waiting=COUNT, submap=COUNT, _numbered=COUNT, _looked_x=LOOKED, _looked_y=LOOKED)

    def __init__(self) -> None:
        self.circles = Archive(archived_dtype(CircleTrack), archived_bounds(CircleTrack))
        self.polygons = Archive(archived_dtype(PolygonTrack), archived_bounds(PolygonTrack))
        self.waiting = self.submap = 0
        self._numbered = 0
        self._looked_x = self._looked_y = math.inf
        self._is_due = False

    def clear(self) -> None:
        """Remove all objects."""
        self.circles.clear()
        self.polygons.clear()
        self.waiting, self._looked_x, self._is_due = 0, math.inf, False

    def drop_caches(self) -> None:
        """Build what is derived anew, after a snapshot was restored."""
        self.circles.drop_caches()
        self.polygons.drop_caches()

    def follow_maps(self, submap: int, moves: MapMoves | None) -> bool:
        """Note the map of the way that goes on, and move each object with its map; return whether any may move."""
        self.submap = submap
        if moves is None:
            return False
        for archive in (self.circles, self.polygons):
            move_rows(archive.held(), moves)
            archive.drop_caches()
        return True

    def update(self, memory: Memory, p: SettingsRecord, sure: float) -> bool:
        """Archive or take up at most one object of each kind; return whether any track became another.

        Parameters
        ----------
        memory, p
            Memory, updated, and settings.
        sure : float
            Least probability with which a polygon is reported.
        """
        has_changed = False
        numbered: int = memory.objects_numbered.item()
        if numbered != self._numbered:
            for kind in self._kinds(memory, p, sure):
                has_changed |= kind.recognise_new(self._numbered, float(p[0].merge_m))
            self._numbered = numbered
        x, y = float(memory.state["ring_x"][0]), float(memory.state["ring_y"][0])
        if self._is_due or not math.hypot(x - self._looked_x, y - self._looked_y) <= LOOK_M:
            self._looked_x, self._looked_y = x, y
            # Before the first object none is looked for: to read all tracks takes a tenth of a millisecond.
            kinds = self._kinds(memory, p, sure) if numbered else ()
            exchanged = [kind.exchange(x, y, float(p[0].range_max_m)) for kind in kinds]
            self._is_due = any(exchanged)
            if not self._is_due:
                self.waiting = sum(kind.waiting for kind in kinds)
            has_changed |= self._is_due
        return has_changed

    def make_room(self, memory: Memory, p: SettingsRecord, sure: float) -> None:
        """Archive the farthest object of each kind of which no track is free.

        Parameters
        ----------
        memory, p, sure
            As for `update`.
        """
        for kind in self._kinds(memory, p, sure):
            self._is_due |= kind.make_room(self._looked_x, self._looked_y)

    def take_up(self, memory: Memory, p: SettingsRecord, sure: float, number: int) -> None:
        """Make an archived object a track again, in place of the farthest if there is no other; nothing if unknown.

        Parameters
        ----------
        memory, p, sure
            As for `update`.
        number : int
            The object's number.
        """
        for kind in self._kinds(memory, p, sure):
            if kind.archive.find(number) is not None:
                kind.make_room(self._looked_x, self._looked_y)
                kind.take_up(number)
                self._is_due = True

    @contextlib.contextmanager
    def borrowed(self, memory: Memory, p: SettingsRecord, number: int) -> Iterator[None]:
        """Make an archived object a track for a look at it; afterwards all is as before. Nothing if unknown.

        Parameters
        ----------
        memory, p
            Memory and settings.
        number : int
            The object's number.
        """
        for kind in self._kinds(memory, p, 1.0):
            row = kind.archive.find(number)
            if row is not None:
                t = max(free_row(kind.tracks), 0)
                track = kind.tracks[t : t + 1]
                before = track.copy()
                unpack(row, track)
                try:
                    yield
                finally:
                    track[:] = before
                return
        yield

    def _kinds(self, memory: Memory, p: SettingsRecord, sure: float) -> Sequence[_Kind]:
        kinds: list[_Kind] = [_Circles(self.circles, memory, memory.circles, self.submap)]
        if p[0].polygon_count > 0:
            kinds.append(_Polygons(self.polygons, memory, memory.polygons, self.submap, sure))
        return kinds


class _Kind(ABC):
    """The tracks of one kind and their archive."""

    def __init__(self, archive: Archive, memory: Memory, tracks: Structured, submap: int) -> None:
        self.archive, self.memory, self.tracks, self.submap = archive, memory, tracks, submap
        self.waiting = 0

    @abstractmethod
    def is_reported(self, t: int) -> bool:
        """Return whether a track is reported as a model."""

    @abstractmethod
    def leave(self, t: int) -> None:
        """End what is computed for a track."""

    def held(self) -> Ints:
        """Return the tracks that are objects."""
        tracks = self.tracks
        status, marks = tracks["status"], tracks["marks"]
        return np.flatnonzero((status == ESTABLISHED) | ((status != FREE) & (marks != 0)))

    def distances(self, which: Ints, x: float, y: float) -> Floats:
        """Return the distances of tracks from (x, y), m."""
        found: Floats = np.hypot(self.tracks["x"][which] - x, self.tracks["y"][which] - y)
        return found

    def exchange(self, x: float, y: float, range_max_m: float) -> bool:
        """Archive the farthest object, or take up the nearest; return whether there was one to do so with."""
        held = self.held()
        distances = self.distances(held, x, y)
        limit = int(HELD_SHARE * len(self.tracks))
        near = self.archive.near(x, y, range_max_m + AHEAD_M)
        farthest = float(distances.max(initial=0.0))
        is_nearer = bool(near) and self.archive.distance(near[0], x, y) < farthest - LOOK_M
        if farthest > range_max_m + BEHIND_M or len(held) > limit or (len(held) == limit and is_nearer):
            self.put_away(int(held[distances.argmax()]))
            return True
        self.waiting = len(near)
        if near and len(held) < limit:
            self.take_up(near[0])
            return True
        return False

    def recognise_new(self, numbered: int, merge_m: float) -> bool:
        """Make each track that has started in the place of an archived object that object; return whether any has.

        Parameters
        ----------
        numbered : int
            Tracks of greater numbers are new.
        merge_m : float
            Two objects nearer than this are one, m.
        """
        has_changed = False
        new = np.flatnonzero((self.tracks["number"] > numbered) & (self.tracks["status"] != FREE))
        for t in new.tolist() if self.archive.count else ():
            known = self.archive.near(float(self.tracks["x"][t]), float(self.tracks["y"][t]), merge_m)
            if known:
                self.leave(t)
                unpack(self.archive.take(known[0]), self.tracks[t : t + 1])
                has_changed = True
        return has_changed

    def make_room(self, x: float, y: float) -> bool:
        """Archive the farthest object if no track is free; return whether none was."""
        if free_row(self.tracks) >= 0:
            return False
        held = self.held()
        self.put_away(int(held[self.distances(held, x, y).argmax()]))
        return True

    def put_away(self, t: int) -> None:
        """Archive track `t`."""
        self.leave(t)
        row = pack(self.tracks[t : t + 1], self.archive.archived_rows.dtype, is_reported=self.is_reported(t))
        row["submap"] = self.submap
        self.archive.add(row)
        self.tracks["status"][t] = FREE
        self.tracks["marks"][t] = 0

    def take_up(self, number: int) -> None:
        """Make an archived object a track."""
        t = free_row(self.tracks)
        if t >= 0:
            self.leave(t)
            unpack(self.archive.take(number), self.tracks[t : t + 1])


class _Circles(_Kind):
    def is_reported(self, t: int) -> bool:
        track = self.tracks[t]
        return bool((track["status"] == ESTABLISHED and track["is_named"]) or track["marks"] != 0)

    def leave(self, t: int) -> None:
        """Nothing: a circle's refinement ends with its quantum."""


class _Polygons(_Kind):
    def __init__(self, archive: Archive, memory: Memory, tracks: Structured, submap: int, sure: float) -> None:
        super().__init__(archive, memory, tracks, submap)
        self._sure = sure

    def is_reported(self, t: int) -> bool:
        sure = np.zeros(len(self.tracks), np.int64)
        return t in sure[: sure_polygons(self.memory.s, self._sure, sure)].tolist()

    def leave(self, t: int) -> None:
        leave_job(self.memory.s, t)
