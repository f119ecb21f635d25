"""Timelines of face and head: tracks of keys, layers added to them, reusable clips."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from mien.animate import channels
from mien.animate.curves import Curve, constant
from mien.animate.layers import Generator
from mien.arrays import Array, Float, check_array, check_positive, frozen
from mien.errors import InputError
from mien.limits import MAX_FPS, MAX_FRAMES, MAX_SECONDS, MAX_SIDE, UNIT_RANGE
from mien.rig.state import FaceState

PIVOT_MM = (0.0, -60.0, -80.0)
"""Head space: the top of the neck, about which the head rotates."""

MAX_PLAYS, MAX_DEPTH = 10_000, 32
"""Limits on nested clips, whose number of plays grows exponentially."""

_BLOCK = 1024
"""Moments sampled at once, to limit memory."""

Tracks = Mapping[str, Curve]
"""Curves by channel (`units.jawOpen`, `mouth.joy`, `head.yaw`, `gaze.pitch`); radians and mm."""


@dataclass(frozen=True)
class Placement:
    """A clip placed on a timeline.

    Attributes:
        clip: its name.
        at: seconds where it starts.
        speed: 2 plays it in half the time.
        weight: factor on its values.
        repeats: number of plays one after the other; may be a fraction.

    Raises:
        InputError: a speed or a number of repeats of 0 or less, NaN.
    """

    clip: str
    at: float
    speed: float = 1.0
    weight: float = 1.0
    repeats: float = 1.0

    def __post_init__(self) -> None:
        check_positive("speed", self.speed)
        check_positive("repeats", self.repeats)
        check_array("at and weight", (self.at, self.weight), (2,))


@dataclass(frozen=True)
class Clip:
    """A motion that can be placed any number of times; 0 outside of its duration.

    Attributes:
        duration: seconds.
        tracks: curves by channel, from 0 to the duration.
        placements: of other clips in this one.
    """

    duration: float
    tracks: Tracks = field(default_factory=dict)
    placements: tuple[Placement, ...] = ()

    def __post_init__(self) -> None:
        check_positive("duration", self.duration)
        _check_channels(self.tracks)


@dataclass(frozen=True)
class Layer:
    """Motion that is added to that below it.

    Attributes:
        name: for display.
        weight: factor on the layer, over time.
        tracks: as a timeline's.
        placements: as a timeline's.
        generator: procedural motion.
    """

    name: str = ""
    weight: Curve = field(default_factory=lambda: constant(1.0))
    tracks: Tracks = field(default_factory=dict)
    placements: tuple[Placement, ...] = ()
    generator: Generator | None = None

    def __post_init__(self) -> None:
        _check_channels(self.tracks)


@dataclass(frozen=True)
class Moment:
    """Face and head at one time: a vertex x in head space is seen at rotation x + translation.

    Attributes:
        time: seconds.
        state: of the face.
        rotation: (3, 3).
        translation: (3,) mm; includes the effect of the pivot.
    """

    time: float
    state: FaceState
    rotation: Float[Array, "3 3"]
    translation: Float[Array, " 3"]


@dataclass(frozen=True)
class Timeline:
    """Tracks, placed clips and layers, added channel by channel.

    Attributes:
        duration: seconds.
        fps: frames a second that it was made for.
        size: width and height in px of its pictures, if given.
        pivot: (3,) mm, head space: the point about which the head rotates.
        tracks: by channel; a missing channel is 0.
        placements: of clips, added to the tracks.
        clips: by name.
        layers: added on top.
        notes: for the user, on what was adapted when it was loaded.

    Raises:
        InputError: a duration, rate or size of 0 or less, or beyond mien.limits; an unknown clip,
            one that contains itself, an unknown channel.
    """

    duration: float
    fps: float = 30.0
    size: tuple[int, int] | None = None
    pivot: Float[Array, " 3"] = field(default_factory=lambda: np.array(PIVOT_MM))
    tracks: Tracks = field(default_factory=dict)
    placements: tuple[Placement, ...] = ()
    clips: Mapping[str, Clip] = field(default_factory=dict)
    layers: tuple[Layer, ...] = ()
    notes: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        _check_at_most("duration", self.duration, MAX_SECONDS)
        _check_at_most("fps", self.fps, MAX_FPS)
        for length in self.size or ():
            _check_at_most("size", length, MAX_SIDE)
        object.__setattr__(self, "pivot", frozen(check_array("pivot", self.pivot, (3,))))
        _check_channels(self.tracks)
        _check_placements(self)

    def sample(self, times: Float[Array, " n"]) -> dict[str, Float[Array, " n"]]:
        """(N,) values at these times in seconds, by channel; radians and mm."""
        times = check_array("times", times, (None,))
        total: dict[str, Array] = {}
        _add(total, self.tracks, times, np.ones_like(times))
        self._add_clips(total, self.placements, times, np.ones_like(times))
        for layer, generated in zip(self.layers, self._generated, strict=True):
            weight = layer.weight.at(times)
            _add(total, layer.tracks, times, weight)
            self._add_clips(total, layer.placements, times, weight)
            before = dict(total)
            _add(total, generated, times, weight)
            _limit_units(total, before, generated)
        return total

    @cached_property
    def _generated(self) -> tuple[Tracks, ...]:
        """Tracks of each layer's generator."""
        generators = (layer.generator for layer in self.layers)
        return tuple({} if item is None else item.channels(self.duration) for item in generators)

    def at(self, time: float) -> Moment:
        """Face and head at a time in seconds."""
        return next(self.moments_at(np.array([time])))

    def moments_at(self, times: Float[Array, " n"]) -> Iterator[Moment]:
        """Face and head at these times in seconds, one after the other."""
        for start in range(0, len(times), _BLOCK):
            block = times[start : start + _BLOCK]
            values = self.sample(block)
            for index, time in enumerate(block):
                yield self._moment(float(time), {name: row[index] for name, row in values.items()})

    def _moment(self, time: float, values: Mapping[str, float]) -> Moment:
        pose = [
            float(values.get(f"head.{name}", 0.0)) for name in channels.CHANNEL_NAMES[channels.HEAD]
        ]
        rotation = channels.head_rotation(pose[0], pose[1], pose[2])
        translation = self.pivot - rotation @ self.pivot + pose[3:]
        return Moment(time, channels.state_from_channels(values), rotation, translation)

    def _add_clips(
        self,
        total: dict[str, Array],
        placements: tuple[Placement, ...],
        times: Array,
        weight: Array,
    ) -> None:
        for placement in placements:
            clip = self.clips[placement.clip]
            played = (times - placement.at) * placement.speed
            # Half open, so that a clip that follows at once does not overlap.
            inside = (played >= 0) & (played < placement.repeats * clip.duration)
            here = weight * placement.weight * inside
            within = np.mod(played, clip.duration)
            _add(total, clip.tracks, within, here)
            self._add_clips(total, clip.placements, within, here)


def _add(total: dict[str, Array], tracks: Tracks, times: Array, weight: Array) -> None:
    for channel, curve in tracks.items():
        total[channel] = total.get(channel, 0.0) + weight * curve.at(times)


def _limit_units(
    total: dict[str, Array], before: Mapping[str, Array], generated: Mapping[str, Curve]
) -> None:
    """Limits face units to their range where a generator was added, as when two blinks coincide."""
    for channel in generated:
        if channel.startswith(f"{channels.UNITS}."):
            given = before.get(channel, np.zeros_like(total[channel]))
            low, high = np.minimum(given, UNIT_RANGE[0]), np.maximum(given, UNIT_RANGE[1])
            total[channel] = np.clip(total[channel], low, high)


def _check_at_most(name: str, value: float, most: float) -> None:
    if check_positive(name, value) > most:
        raise InputError(name, f"at most {most:g}", f"{value:g}")


def _check_channels(tracks: Tracks) -> None:
    for channel in tracks:
        channels.split_channel(channel)


def _check_placements(timeline: Timeline) -> None:
    counts: dict[str, int] = {}
    for name in timeline.clips:
        _count_plays(timeline.clips, name, (), counts)
    placements = (*timeline.placements, *(p for a in timeline.layers for p in a.placements))
    plays = sum(_count_plays(timeline.clips, item.clip, (), counts) for item in placements)
    if plays > MAX_PLAYS:
        raise InputError("play", f"at most {MAX_PLAYS} plays of clips", plays)
    generators = [layer.generator for layer in timeline.layers if layer.generator is not None]
    motions = sum(timeline.duration / generator.period for generator in generators)
    if motions > MAX_FRAMES:
        expected = f"at most {MAX_FRAMES} blinks and breaths"
        raise InputError("layers", expected, f"{motions:.0f} in {timeline.duration:g} s")


def _count_plays(
    clips: Mapping[str, Clip], name: str, above: tuple[str, ...], counts: dict[str, int]
) -> int:
    """Number of plays in one play of a clip, nested clips included."""
    if name not in clips:
        raise InputError("clip", f"one of {', '.join(clips) or 'no clips at all'}", name)
    if name in above:
        chain = " > ".join((*above[above.index(name) :], name))
        raise InputError(f"clips.{name}", "a clip that does not contain itself", chain)
    if len(above) >= MAX_DEPTH:
        raise InputError(f"clips.{name}", f"clips nested at most {MAX_DEPTH} deep", "deeper ones")
    if name not in counts:
        inner = (p.clip for p in clips[name].placements)
        counts[name] = 1 + sum(_count_plays(clips, n, (*above, name), counts) for n in inner)
    if counts[name] > MAX_PLAYS:
        raise InputError(f"clips.{name}", f"at most {MAX_PLAYS} plays inside", counts[name])
    return counts[name]
