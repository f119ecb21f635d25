"""Timeline documents: a performance as JSON. docs/reference/timeline.md describes them."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Collection
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from mien.animate.channels import (
    ANGLES,
    CHANNEL_NAMES,
    GAZE,
    HEAD,
    REGION_NAMES,
    UNITS,
    split_channel,
)
from mien.animate.curves import Curve
from mien.animate.layers import GENERATORS, Generator
from mien.animate.timeline import PIVOT_MM, Clip, Layer, Placement, Timeline, Tracks
from mien.arrays import Array, Float
from mien.errors import DocumentError, InputError
from mien.io.files.atomic import atomic_file
from mien.io.timeline.timeline_curves import curve_from_json, curve_to_json, rounded
from mien.limits import MAX_FPS, MAX_SECONDS, MAX_SIDE, MIN_FPS
from mien.reading.strict_json import DocumentFormat, JsonValue, errors_name_file, read_json

TIMELINE_FORMAT = DocumentFormat("mien timeline", 1)

_MOTION = ("tracks", "play")
_TOP = ("format", "version", "duration", "fps", "size", "pivot", *_MOTION, "clips", "layers")
_PLACEMENT = ("clip", "at", "speed", "weight", "repeats")
DEGREES = frozenset(("tip", "sway"))
"""Parameters of generators that are angles: degrees in the file."""

_LEAF_LIST = re.compile(r'\[\n[^\[\]{}"]*\]')
_LEAF_OBJECT = re.compile(r"\{\n[^\[\]{}]*\}")


def load_timeline_json(path: str | Path) -> Timeline:
    """The performance in a timeline document.

    Raises:
        InputError: the file cannot be read.
        FileFormatError: names the place, as `tracks.mouth.joy.keys[3].time`: an unknown or repeated
            name (the nearest one is suggested), a value of another type, NaN, a time that does not
            rise, a duration or rate out of range, a clip that contains itself, a newer version.
    """
    data = JsonValue(read_json(path))
    with errors_name_file(path):
        return timeline_from_json(data)


def save_timeline(path: str | Path, timeline: Timeline) -> None:
    """Write a timeline document, whole or not at all; load_timeline gives the timeline back.

    Raises:
        InputError: a place that cannot be written.
    """
    text = json.dumps(timeline_to_json(timeline), indent=2, ensure_ascii=False, allow_nan=False)
    # A key, a clip that is played, a pair of numbers are a line each.
    for inner in (_LEAF_LIST, _LEAF_OBJECT):
        text = inner.sub(lambda match: " ".join(match.group().split()), text)
    with atomic_file(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def timeline_from_json(data: JsonValue) -> Timeline:
    """The performance that a document's contents describe. Raises: DocumentError; InputError."""
    TIMELINE_FORMAT.check(data)
    data.members(_TOP)
    clips = data.get("clips", {}).members()
    return Timeline(
        duration=_duration(data),
        fps=data.get("fps", 30).number(least=MIN_FPS, most=MAX_FPS),
        size=_size(data["size"]) if "size" in data else None,
        pivot=_pivot(data.get("pivot", list(PIVOT_MM))),
        tracks=_tracks(data),
        placements=_placements(data, clips),
        clips={name: _clip(clip, clips) for name, clip in clips.items()},
        layers=tuple(_layer(layer, clips) for layer in data.get("layers", []).items()),
    )


def _duration(data: JsonValue) -> float:
    return data["duration"].number(above=0, most=MAX_SECONDS)


def _size(value: JsonValue) -> tuple[int, int]:
    items = value.items()
    if len(items) != 2:
        raise value.error(f"expected [width, height], found {len(items)} entries")
    width, height = (item.whole(above=0, most=MAX_SIDE) for item in items)
    return width, height


def _pivot(value: JsonValue) -> Float[Array, " 3"]:
    items = value.items()
    if len(items) != 3:
        raise value.error(f"expected 3 numbers, found {len(items)} entries")
    return value.array(3)


def _tracks(data: JsonValue) -> dict[str, Curve]:
    tracks = {}
    groups = (HEAD, GAZE, UNITS, *REGION_NAMES)
    for group, members in data.get("tracks", {}).members(groups).items():
        for name, track in members.members(CHANNEL_NAMES.get(group)).items():
            curve, channel = curve_from_json(track), f"{group}.{name}"
            tracks[channel] = curve.scaled(math.pi / 180) if channel in ANGLES else curve
    return tracks


def _placements(data: JsonValue, clips: Collection[str]) -> tuple[Placement, ...]:
    return tuple(_placement(item, clips) for item in data.get("play", []).items())


def _placement(data: JsonValue, clips: Collection[str]) -> Placement:
    data.members(_PLACEMENT)
    return Placement(
        clip=data["clip"].choice("clip", clips),
        at=data["at"].number(),
        speed=data.get("speed", 1).number(above=0),
        weight=data.get("weight", 1).number(),
        repeats=data.get("repeats", 1).number(above=0),
    )


def _clip(data: JsonValue, clips: Collection[str]) -> Clip:
    data.members(("duration", *_MOTION))
    return Clip(_duration(data), _tracks(data), _placements(data, clips))


def _layer(data: JsonValue, clips: Collection[str]) -> Layer:
    members = data.members()
    generator = None
    parameters: tuple[str, ...] = ()
    if "generator" in members:
        kind = data["generator"].choice("generator", GENERATORS)
        parameters = tuple(item.name for item in fields(GENERATORS[kind]))
    data.members(("name", "weight", "generator", *_MOTION, *parameters))
    if parameters:
        given = {name: members[name] for name in parameters if name in members}
        generator = _generator(kind, given, data.place)
    return Layer(
        name=data.get("name", "").text(),
        weight=curve_from_json(data.get("weight", 1)),
        tracks=_tracks(data),
        placements=_placements(data, clips),
        generator=generator,
    )


def _generator(kind: str, given: dict[str, JsonValue], place: str) -> Generator:
    values: dict[str, Any] = {}
    for name, value in given.items():
        if name == "seed":
            values[name] = value.whole(above=-1)
        else:
            values[name] = value.number() * (math.pi / 180 if name in DEGREES else 1.0)
    try:
        return GENERATORS[kind](**values)
    except InputError as error:
        problem = f"expected {error.expected}, found {error.got}"
        raise DocumentError(f"{place}.{error.name}", problem) from None


def timeline_to_json(timeline: Timeline) -> dict[str, Any]:
    """The contents of the document that describes this timeline."""
    data = TIMELINE_FORMAT.header
    data |= {"duration": rounded(timeline.duration), "fps": rounded(timeline.fps)}
    if timeline.size is not None:
        data["size"] = list(timeline.size)
    data["pivot"] = [rounded(value) for value in timeline.pivot]
    data |= _motion_to_json(timeline.tracks, timeline.placements)
    if timeline.clips:
        data["clips"] = {
            name: {"duration": rounded(clip.duration)}
            | _motion_to_json(clip.tracks, clip.placements)
            for name, clip in timeline.clips.items()
        }
    if timeline.layers:
        data["layers"] = [_layer_to_json(layer) for layer in timeline.layers]
    return data


def _motion_to_json(tracks: Tracks, placements: tuple[Placement, ...]) -> dict[str, Any]:
    data: dict[str, Any] = {}
    groups: dict[str, dict[str, Any]] = {}
    for channel, curve in tracks.items():
        group, name = split_channel(channel)
        shown = curve.scaled(180 / math.pi) if channel in ANGLES else curve
        groups.setdefault(group, {})[name] = curve_to_json(shown)
    if groups:
        data["tracks"] = groups
    if placements:
        data["play"] = [
            {key: value if key == "clip" else rounded(value) for key, value in asdict(item).items()}
            for item in placements
        ]
    return data


def _layer_to_json(layer: Layer) -> dict[str, Any]:
    data: dict[str, Any] = {"name": layer.name, "weight": curve_to_json(layer.weight)}
    if layer.generator is not None:
        kinds = {made: name for name, made in GENERATORS.items()}
        data["generator"] = kinds[type(layer.generator)]
        for name, value in asdict(layer.generator).items():
            factor = 180 / math.pi if name in DEGREES else 1
            data[name] = value if name == "seed" else rounded(value * factor)
    return data | _motion_to_json(layer.tracks, layer.placements)
