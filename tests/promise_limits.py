"""What no promise holds against, since nothing that the robot knows contradicts it."""

from __future__ import annotations

from collections.abc import Sequence

LIMITS: Sequence[str] = (
    "A ring that falls silent as a whole where little was ahead or beside it, or whose sensors each fire seldom: "
    "most such silences are named at once, others by a line after half a metre or half a turn, or after twice the "
    "longest silence so far if that is more. After 4 m without anything new the robot creeps. What it had not heard "
    "before may be touched until then.",
    "Ranges that have been too long, or too short, by the same length since the ring's first readings, or that "
    "become so where the ring hears few echoes at that moment (three to eight: in 11 of 32 drives of rings of "
    "8, 16 and 24 sensors among mirrors something was touched when ranges became too long, in 0 of 16 when "
    "they became too short; through rooms, offices and corridors in 27 of 146, and in 0 of 27; "
    "14 of those 146 were not named): they "
    "change as the robot's motion says. "
    "A map of the room contradicts them; without one, only a bumper stops the robot.",
    "A ring that hears nothing from its first reading on: the robot creeps at 0.04 m/s, says why, and is stopped "
    "after 1 m; what stands within it is touched at no more. If the ring reaches less than 3 m, which hears a room "
    "late, the robot creeps on without a stop. So does an honest ring in the open (`servo1` in the middle of a room: "
    "for a minute), until it is halted and armed again after 1 m.",
    "A part of the ring that freezes or falls silent while the rest still hears: a sensor that does not change is "
    "named after a metre or two on which its neighbours change, and what stood ahead may be touched before. Half of "
    "the ring that freezes is named after 0.3 to 6 s (30 of 30 drives), but one by one, from its edge: where no "
    "neighbour changes, sensors are believed, and in 6 of 30 drives something was touched, at up to 0.3 m/s, after 5 "
    "to 19 s (ahead alone: in 6 of 122, and in 2 of 76 that went on for half a metre nothing was said). Where all "
    "that looks ahead falls silent, what other sensors heard in the last 30 s limits the speed, and what none has "
    "heard does not: in 14 of 128 drives something was touched, and in 17 of 73 nothing was said. Where "
    "nine of ten readings of every sensor are reported as silence, as of a mirror, it was so in 7 of 124; most are "
    "named before.",
    "Sensors that do not hear what is near, where they have heard nothing of it from farther away: a wall along "
    "which the robot drives goes on, and one that turns into it has never heard that part.",
    "Echoes of an earlier drive that fit the present one, until they come again: replays in a corridor along its "
    "walls, or of a drive like this one. They change as the motion says, and what returns to an earlier place are a "
    "few sensors ahead and behind. When they come again they are equal to the bit.",
    "A ring that is mounted turned by a small angle, until the objects that result are seen to be wrong: measure "
    "it with `echolocate calibrate`. Two sensors exchanged, one that looks backwards, or one that hears nothing, "
    "in a ring of up to sixteen: with `body.turns_at_start` they are named by a turn before the first drive (280 "
    "of 288); without it, or where they become so later, only once the robot has turned by about 60°, or by half "
    "a turn on one spot: 4 to 40 s in drives through rooms. The turn knows only what the other sensors hear: it "
    "names nothing where nothing echoes, nor a single sensor that looks backwards, nor the two of a pair that "
    "are exchanged. In a ring of more sensors they are not named at all. One of eight or fewer that is turned "
    "otherwise, and a ring that is turned while it drives: of a `hobby8` in a room and a corridor 1 of 8 drives "
    "touched something above 0.05 m/s, turned by 45°, 4 of 8 by 90° and 5 of 8 by 180°, at up to 0.3 m/s, and of a "
    "`p3dx` 0, 1 and 2 of 8; 20 and 15 of the 24 were not named. Mounted so from "
    "the start (by a half, as a Pioneer is whose two arrays are exchanged), the robot is slow where something would"
    " be ahead, until the motion has excluded that: among close furniture and in corridors six robots touched "
    "something above 0.05 m/s in 6 of 168 drives of 20 s, at up to 0.26 m/s, five of them with eight sensors, which "
    "hear little. A robot that seems turned creeps for up to 20 s before it is named, one whose only sensor is on a "
    "servo for longer (18 drives of one mounted backwards: slow with a reason after 13.9 s at most, nothing touched; "
    "of a servo among other sensors, or one that sweeps less than half a turn, it is not seen). A ring that only "
    "looks ahead hears nothing of what is then ahead of a half turn. A `p3dx` with a disc at the front and one at "
    "the back exchanged touched something in 3 of 27.",
    "Any lie while the robot stands, or among surfaces whose ranges its motion does not change: nothing differs "
    "then; after half a metre or half a turn of repeated echoes, or twice the longest such silence so far, the robot "
    "creeps, and after 4 m of silence. Where nothing echoes, silence is true and false alike.",
    "An object that appears nearer than the way that the robot drives until the ring next looks there, and then "
    "brakes: at .3 m/s an object set .1 m ahead of the rim is hit by every robot that drives straight at it, "
    "since it is there after .33 s.",
    "Something that is no recognised model and that no beam meets, or that returns no echo: glass at a "
    "slant, cloth, what is above or below the beams, or the end of a thin wall or a leg between two beams. Beams "
    "that overlap at a distance leave gaps near a ring: those of the Denning within half a metre. "
    "Beams that end side by side leave a strip at any range, 6 cm wide between the AmigoBot's: a drum that reflects "
    "like a mirror is not heard in it, and `check` says so.",
    "A smooth wall whose normal lies in a blind side of the ring: a robot that only looks ahead hears nothing of it "
    "as it draws near at a slant. Such a robot turns and looks to both sides every 2.5 m, remembers the walls that "
    "it heard, and presumes that they go on; a wall that begins between two looks is not known. A ring that does not "
    "turn with the wheels cannot look: a goal or mission that leads to its blind side is refused. Nor does a ring "
    "all round hear such a wall between two beams that do not touch, as 10° at 70° from ahead of a `p3at`: what "
    "it heard of the wall before counts there for a metre, what it never heard does not.",
    "A robot's clock that is wrong by less than a twentieth, or by little more: a note after a minute, no stop.",
    "Odometry that counts too little, or too much by less than a quarter, or that stands for moments of less than a "
    "second: a base may be slower than commanded. The map suffers, and the distances that are kept do not; with half "
    "or 0.7 of the way something was touched in 1 of 20 drives. What counts half as much again is named (10 of 10).",
)
"""What nothing that the robot reports can contradict, so that no stop and no message is promised."""
