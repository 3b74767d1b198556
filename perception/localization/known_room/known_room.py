"""The robot in a known room: global localisation from an unknown start, tracking, and kidnapping noticed.

Readings are compounded by odometry into keyframes, so that those of one sensor are independent. Without a pose, a
search of the whole room gives hypotheses, which the exact likelihood of all raw readings then weighs keyframe by
keyframe. The robot tracks once one place has nearly all probability and explains the readings better than no place
would. It is lost when its place no longer does. A place that the operator names is compared with the best ones of the
whole room, by all readings that are remembered: the operator may be wrong, and the robot may have been carried. A
firing is only taken down; all else is done in quanta.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from config.robot import RingConfig
from drivers.messages import IDENTITY, Firing, Pose, wrap_angle
from perception.bounds import CONSTANT, COUNT, FINITE, PLACE, SHARE, Bound, bounds, index_of, up_to
from perception.localization.known_room.background import Background
from perception.localization.known_room.keyframes import KEYFRAMES_MAX, Keyframes
from perception.localization.known_room.mixed_reflection import LearnedShares
from perception.localization.known_room.pose_grid import GRID_CELL_M, GRID_READINGS_MAX, GRID_STEP_RAD, PoseGrid
from perception.localization.known_room.pose_particles import HYPOTHESES_MAX, MERGE_M, MERGE_RAD
from perception.localization.known_room.pose_track import LEAST_LOG, SEARCH_LEAST_LOG, PoseTrack, heading_noise
from perception.localization.known_room.surroundings import make_surroundings
from perception.localization.localized_pose import LocalizedPose, Status
from perception.localization.room.range_likelihood import OUTLIERS, RangeModel
from perception.localization.room.room import Room
from perception.sensor_mounts import mounts_array

MAP_NOISE_M: Final = 0.03
"""Noise of a range compared with the map, whose own errors it contains."""
DROPOUT: Final = 0.15
"""Share of the expected echoes that are missed."""
WINDOW_M: Final = 9.0
"""Way over which odometry compounds keyframes for a search."""
WINDOW_LEAST: Final = 9
"""Keyframes of a search at least: their way may be longer than `WINDOW_M`."""
WINDOW_FAR_M: Final = 16.0
"""Longest way of these keyframes."""
WINDOW_MAX: Final = 96
"""Most keyframes of it."""
SEARCH_M: Final = (1.0, 3.0)
"""Way until the first search, and the longest one between two searches."""
SEARCH_GROWTH: Final = 1.5
"""Factor by which that way grows from one search to the next."""
STAND_SEARCH_M: Final = 0.3
"""A robot that stands searches if it has driven so far since the last search."""
ASSUMED_M: Final = 0.3
"""Standard deviation of a place that the operator names, on each axis."""
ASSUMED_RAD: Final = math.radians(12.0)
"""Half the width of the row of headings at such a place."""
SUSPECT_LOG: Final = 4.5
"""Evidence for a tracked place below which a search looks for a better one, nat: the robot may have been carried."""
LEAD_LOG: Final = 2.0
"""What a search finds must explain its readings better by this than what is tracked, nat."""
PLACE_SURE: Final = 0.9
"""Probability above which a place is the robot's."""
PLACE_DOUBT: Final = 0.5
"""Probability below which a tracked place is no longer its own."""
STATUSES: Final[tuple[Status, ...]] = ("localizing", "tracking", "lost")
"""The statuses; snapshots hold their indices."""
LOCALIZING, TRACKING, LOST = range(3)
IDLE, DUE, COMPARING, WEIGHING = range(4)
"""Stages of a search: none, one is to begin, readings are compared with the grid, its hypotheses are weighed."""


class KnownRoom:
    """Localisation in one known room, firing by firing.

    Parameters
    ----------
    room : Room
        The surfaces, in the map frame.
    ring : RingConfig
        The sensors.
    model : RangeModel, optional
        Errors of a range compared with the map.
    seed : int
        Of the particles' random walk.

    Attributes
    ----------
    probability : float
        That the reported place is the robot's.
    shares : LearnedShares
        How often a reading has which cause.
    refuted : int
        Places named by the operator that the readings have refuted so far.
    rivals : int
        Places elsewhere that explain the readings as well as the reported one, when they were compared last.
    """

    SCRATCH: Final = ("_search_evidence",)
    """What follows from the room."""
    BOUNDS: Final = bounds(
        _mounts=CONSTANT,
        _odometry=PLACE,
        _status=index_of(len(STATUSES)),
        probability=SHARE,
        _window_begin=COUNT,
        _stage=Bound(IDLE, WEIGHING),
        _search_begin=COUNT,
        _searched_at_m=FINITE,
        _pause_m=FINITE,
        _travel=PLACE,
        _named_at=COUNT,
        refuted=COUNT,
        rivals=up_to(HYPOTHESES_MAX),
    )

    def __init__(self, room: Room, ring: RingConfig, model: RangeModel | None = None, seed: int = 0) -> None:
        model = model or RangeModel(
            ring.resolution_m, ring.window_m, noise_m=MAP_NOISE_M, dropout=DROPOUT, outliers=OUTLIERS
        )
        surroundings = make_surroundings(room, model, math.radians(ring.beam_half_angle_deg))
        radius_m = max(math.hypot(x, y) for x, y, _ in ring.mounts)
        noise = heading_noise(seed)
        clear_m = max(GRID_CELL_M, radius_m - GRID_CELL_M)
        self._grid = PoseGrid(room, surroundings, clear_m)
        self._background = Background(room, surroundings, clear_m)
        self._search_evidence = -math.log(max(1.0, room.area_m2 / MERGE_M**2) * math.pi / MERGE_RAD)
        """Log odds of the best of all places of the room before any reading: some fit by chance."""
        self._tracked = PoseTrack(surroundings, self._background, noise)
        self._candidates = PoseTrack(surroundings, self._background, noise)
        """Hypotheses of a search, until they have entered all keyframes."""
        self._mounts, self._turning = mounts_array(ring.mounts), ring.turning
        self.shares = LearnedShares()
        self._odometry = np.zeros(3)
        """Of the ring at the last firing."""
        self.reset()

    def reset(self) -> None:
        """Start again with an unknown place, as after a reset of the odometry."""
        self._keyframes = Keyframes(self._mounts, self._turning)
        self._tracked.clear()
        self._candidates.clear()
        self._grid.cancel()
        self._status = LOCALIZING
        self.probability = 0.0
        self.shares.reset()
        self._background.reset()
        self._window_begin = 0
        """Number of the first keyframe that a search uses."""
        self._stage = IDLE
        self._search_begin = 0
        """The same of the search that goes on."""
        self._is_complete = self._is_confirmed = False
        """Whether the last search left out no place that may be the robot's; whether two have the same answer."""
        self._searched_at_m = -STAND_SEARCH_M
        self._pause_m = SEARCH_M[0]
        self._travel = 0.0
        """Direction of travel at the last firing."""
        self._named_at = 0
        """Number of the first keyframe since the operator named a place."""
        self._is_named, self._is_compared = False, True
        """Whether the operator named the reported place and no search has found it since; whether one has ended."""
        self.refuted = self.rivals = 0

    @property
    def status(self) -> Status:
        """Whether the place is being looked for, known, or lost."""
        return STATUSES[self._status]

    def observe(self, firing: Firing) -> None:
        """Take a firing with its pose by odometry."""
        self._odometry[:] = firing.pose.x, firing.pose.y, firing.ring_yaw
        self._travel = float(firing.pose.theta)
        if not self._keyframes.observe(firing):
            return
        keyframes = self._keyframes
        self._background.observe(keyframes.latest_ranges())
        if self._stage in {IDLE, DUE}:
            self._window_begin = max(self._window_begin, keyframes.count - WINDOW_MAX)
            while self._is_window_long():
                self._window_begin += 1
        if self._stage != IDLE:
            return
        if self._status == TRACKING:
            if self._tracked.evidence <= SUSPECT_LOG:
                self._window_begin = max(self._window_begin, min(self._tracked.peak_at + 1, keyframes.count - 1))
            elif self.probability > PLACE_SURE and not self._is_named:
                return
        way_m = keyframes.driven_m - self._searched_at_m
        if way_m >= self._pause_m or (keyframes.is_stand and way_m >= STAND_SEARCH_M):
            self._searched_at_m = keyframes.driven_m
            self._pause_m = (
                min(SEARCH_M[1], SEARCH_GROWTH * self._pause_m) if way_m >= self._pause_m else self._pause_m
            )
            self._stage = DUE

    def assume(self, pose: Pose) -> None:
        """Take the operator's word that the robot is at a pose (position, direction of travel) in the map frame.

        The keyframes before are kept: if the readings refute the place, a search may still use them.
        """
        heading = pose.theta - self._travel + float(self._odometry[2])
        here = np.array([[pose.x, pose.y, heading]])
        self._grid.cancel()
        self._candidates.clear()
        self._stage = IDLE
        self._tracked.start(here, ASSUMED_M, ASSUMED_RAD, self._at_last_firing(), self._keyframes.count, 0.0)
        self._tracked.conclude()
        self._keyframes.begin()
        self._status, self.probability, self._is_confirmed = LOCALIZING, 0.0, True
        self._named_at, self._is_named, self._is_compared, self.rivals = self._keyframes.count, True, False, 0
        self._searched_at_m, self._pause_m = self._keyframes.driven_m, SEARCH_M[0]

    @property
    def can_refine(self) -> bool:
        """Whether keyframes are to be entered or a search has work left."""
        return self._stage != IDLE or self._tracked.is_behind(self._keyframes)

    def refine(self) -> int:
        """Do one quantum: of what the tracked hypotheses have not entered, then of a search; return 1."""
        if self._tracked.is_behind(self._keyframes):
            if self._enter(self._tracked):
                self._judge()
        elif self._stage == DUE:
            readings = self._keyframes.compounded(self._window_begin, GRID_READINGS_MAX)
            self._grid.begin(readings, self.shares.profiles())
            self._search_begin = self._window_begin
            self._stage = COMPARING if len(readings) else IDLE
        elif self._stage == COMPARING:
            self._grid.refine()
            if not self._grid.is_searching:
                self._weigh_starts()
        elif self._stage == WEIGHING:
            self._enter(self._candidates)
            if not self._candidates.is_behind(self._keyframes):
                self._conclude_search()
                self._candidates.clear()
                self._stage = IDLE
                self._judge()
        return 1

    def _weigh_starts(self) -> None:
        """Let the places that the grid has found enter the keyframes since; search anew if those are overwritten."""
        begin, keyframes = self._search_begin, self._keyframes
        if keyframes.count - begin > KEYFRAMES_MAX:
            self._window_begin, self._stage = max(self._window_begin, keyframes.count - WINDOW_MAX), DUE
            return
        if len(self._grid):
            self.shares.guess(self._grid.best_profile)
        starts, self._is_complete = self._grid.best_starts(HYPOTHESES_MAX), self._grid.is_complete
        self._candidates.start(
            starts, GRID_CELL_M, GRID_STEP_RAD, keyframes.pose(begin), begin, self._search_evidence
        )
        self._stage = WEIGHING if len(starts) else IDLE

    def localized(self) -> LocalizedPose:
        """Return where the robot was at the last firing, as far as known."""
        at = self._at_last_firing()
        pose, covariance = at, np.diag([np.inf, np.inf, np.inf])
        if len(self._tracked):
            pose, covariance = self._tracked.pose(at), self._tracked.covariance()
        travel = Pose(pose.x, pose.y, wrap_angle(pose.theta + self._travel - at.theta))
        return LocalizedPose(travel, wrap_angle(pose.theta), covariance, self.status, self.probability)

    def odometry_from_map(self) -> Pose:
        """Return the pose of the map frame in odometry's frame; they are the same until a place is known."""
        at = self._at_last_firing()
        return at.compose(self._tracked.pose(at).inverse()) if len(self._tracked) else IDENTITY

    def drop_caches(self) -> None:
        """Discard cached results, after the memory was restored from a snapshot."""
        self._grid.drop_caches()

    def drop_table(self) -> None:
        """Discard cached results and the table of the whole room, which takes quanta to compute."""
        self._grid.drop_table()

    def _is_window_long(self) -> bool:
        """Return whether the window may begin with a later keyframe."""
        most_m = WINDOW_M if self._keyframes.count - self._window_begin > WINDOW_LEAST else WINDOW_FAR_M
        return self._keyframes.way_since(self._window_begin) > most_m

    def _at_last_firing(self) -> Pose:
        """Return the ring's pose by odometry at the last firing."""
        x, y, yaw = self._odometry.tolist()
        return Pose(x, y, yaw)

    def _enter(self, track: PoseTrack) -> bool:
        """Do a quantum of entering a keyframe; return whether it is done."""
        before = track.entered
        least_log = LEAST_LOG if track is self._tracked else SEARCH_LEAST_LOG
        readings = track.enter(self._keyframes, self.shares, least_log)
        is_place = track is self._tracked and float(track.best.share) > PLACE_SURE
        if readings and is_place and min(track.explains, track.fits) > PLACE_SURE:
            self.shares.learn(track.best, readings)
        return track.entered > before

    def _is_sure(self, tracked: PoseTrack) -> bool:
        """Return whether what is tracked is the place so surely that another one must overcome a search's chance."""
        return float(tracked.best.share) * tracked.explains > (PLACE_DOUBT if self._is_named else PLACE_SURE)

    def _are_one(self, tracked: PoseTrack, found: PoseTrack) -> bool:
        """Return whether two tracks are at the same place."""
        if not len(tracked):
            return False
        at = self._at_last_firing()
        one, other = tracked.pose(at), found.pose(at)
        turn = abs(wrap_angle(one.theta - other.theta))
        return math.hypot(one.x - other.x, one.y - other.y) <= MERGE_M and turn <= MERGE_RAD

    def _conclude_search(self) -> None:
        """Take what a search found if it explains its readings better than what is tracked; or confirm that.

        The best of all places fits by chance what the one that is tracked does not. So that is kept until the search
        overcomes this too, and has found one place rather than many. A place that explains also what was heard before
        the operator named another one is no chance.
        """
        tracked, found = self._tracked, self._candidates
        is_same = self._are_one(tracked, found)
        begin = max(self._search_begin, self._named_at)
        is_sure = len(tracked) > 0 and self._is_sure(tracked)
        heard_before = found.gained_since(self._search_begin) - found.gained_since(begin)
        is_chance = heard_before <= -self._search_evidence
        lead = LEAD_LOG - (self._search_evidence if is_sure and is_chance else 0.0)
        ahead = found.gained_since(begin) - tracked.gained_since(begin) if len(tracked) else math.inf
        is_choice = self._status != TRACKING or float(found.best.share) > PLACE_DOUBT
        if ahead > lead and is_choice and not (is_same and tracked.explains > PLACE_DOUBT):
            self._tracked, self._candidates = found, tracked
            self._status = LOCALIZING if self._status == TRACKING else self._status
            self._is_confirmed = self._is_complete
            if self._is_named and not is_same:
                self._refute()
            self._is_named, self.rivals = False, found.rivals
        else:
            self._is_confirmed = self._is_confirmed or is_same or self._is_complete
            self.rivals = found.rivals if is_same else max(1, found.rivals) if ahead > -LEAD_LOG else 0
            self._is_named = self._is_named and not (is_same and self.rivals == 0)
        if is_same:
            # From the whole window, with what is known of the causes now.
            tracked.likeness = max(tracked.likeness, found.likeness)

    def _judge(self) -> None:
        """Set status and probability after a keyframe."""
        track = self._tracked
        explains = track.explains
        self.probability = (
            float(track.best.share) * min(explains, track.fits) * (1.0 if self._is_confirmed else PLACE_SURE)
        )
        if self._is_named and explains < PLACE_DOUBT:
            self._refute()
        if not self._is_named:
            self.rivals = track.rivals
        if self._status == TRACKING:
            if explains < PLACE_DOUBT:
                self._lose()
        elif self._stage == IDLE:
            self._status = (
                TRACKING if self.probability > PLACE_SURE else LOST if explains < PLACE_DOUBT else LOCALIZING
            )
            if self._named_at < self._keyframes.count:
                self._compare_named(explains)

    def _refute(self) -> None:
        """Give up the place that the operator named."""
        self._is_named = False
        self.refuted += 1

    def _compare_named(self, explains: float) -> None:
        """Search the room once the operator's place has its first keyframe: from before it, then only since.

        The robot may have been carried before the operator named a place.
        """
        if not self._is_compared:
            self._is_compared, self._stage = True, DUE
        elif explains < PLACE_DOUBT and self._window_begin < self._named_at:
            self._window_begin, self._stage = self._named_at, DUE

    def _lose(self) -> None:
        """Begin anew, with what was heard since the readings began to speak against the place."""
        self._status = LOST
        latest = self._keyframes.count - 1
        self._window_begin = max(min(self._tracked.peak_at + 1, latest), latest + 1 - WINDOW_MAX)
        self._pause_m, self._searched_at_m = SEARCH_M[0], self._keyframes.driven_m
        self._stage = DUE
