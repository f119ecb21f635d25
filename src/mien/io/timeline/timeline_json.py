"""Timeline documents: a performance as JSON. docs/reference/timeline.md describes them."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Collection, Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

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
from mien.errors import DocumentError, InputError
from mien.io.files.atomic import atomic_file
from mien.io.timeline.timeline_curves import curve_from_json, curve_to_json, rounded
from mien.limits import MAX_FPS, MAX_SECONDS, MAX_SIDE, MIN_FPS
from mien.reading.strict_json import (
    DocumentFormat,
    as_choice,
    as_list,
    as_number,
    as_object,
    as_text,
    as_whole,
    errors_name_file,
    join,
    need,
    read_json,
)

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
    data = read_json(path)
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


def timeline_from_json(data: Mapping[str, Any]) -> Timeline:
    """The performance that a document's contents describe. Raises: DocumentError; InputError."""
    TIMELINE_FORMAT.check(data)
    top = as_object(data, "", _TOP)
    clips = as_object(top.get("clips", {}), "clips")
    return Timeline(
        duration=_duration(top, ""),
        fps=as_number(top.get("fps", 30), "fps", least=MIN_FPS, most=MAX_FPS),
        size=_size(top["size"]) if "size" in top else None,
        pivot=np.array(_numbers(top.get("pivot", list(PIVOT_MM)), "pivot", 3)),
        tracks=_tracks(top, ""),
        placements=_placements(top, "", clips),
        clips={name: _clip(clip, f"clips.{name}", clips) for name, clip in clips.items()},
        layers=tuple(
            _layer(layer, f"layers[{index}]", clips)
            for index, layer in enumerate(as_list(top.get("layers", []), "layers"))
        ),
    )


def _duration(data: dict[str, Any], place: str) -> float:
    value = need(data, "duration", place)
    return as_number(value, join(place, "duration"), above=0, most=MAX_SECONDS)


def _size(value: object) -> tuple[int, int]:
    items = as_list(value, "size")
    if len(items) != 2:
        raise DocumentError("size", f"expected [width, height], found {len(items)} entries")
    width, height = (
        as_whole(item, f"size[{i}]", above=0, most=MAX_SIDE) for i, item in enumerate(items)
    )
    return width, height


def _numbers(value: object, place: str, count: int) -> list[float]:
    items = as_list(value, place)
    if len(items) != count:
        raise DocumentError(place, f"expected {count} numbers, found {len(items)} entries")
    return [as_number(item, f"{place}[{i}]") for i, item in enumerate(items)]


def _tracks(data: dict[str, Any], above: str) -> dict[str, Curve]:
    place = join(above, "tracks")
    tracks = {}
    groups = (HEAD, GAZE, UNITS, *REGION_NAMES)
    for group, members in as_object(data.get("tracks", {}), place, groups).items():
        inside = as_object(members, f"{place}.{group}", CHANNEL_NAMES.get(group))
        for name, track in inside.items():
            curve = curve_from_json(track, join(f"{place}.{group}", name))
            channel = f"{group}.{name}"
            tracks[channel] = curve.scaled(math.pi / 180) if channel in ANGLES else curve
    return tracks


def _placements(data: dict[str, Any], above: str, clips: Collection[str]) -> tuple[Placement, ...]:
    place = join(above, "play")
    return tuple(
        _placement(item, f"{place}[{index}]", clips)
        for index, item in enumerate(as_list(data.get("play", []), place))
    )


def _placement(value: object, place: str, clips: Collection[str]) -> Placement:
    data = as_object(value, place, _PLACEMENT)
    return Placement(
        clip=as_choice(need(data, "clip", place), f"{place}.clip", "clip", clips),
        at=as_number(need(data, "at", place), f"{place}.at"),
        speed=as_number(data.get("speed", 1), f"{place}.speed", above=0),
        weight=as_number(data.get("weight", 1), f"{place}.weight"),
        repeats=as_number(data.get("repeats", 1), f"{place}.repeats", above=0),
    )


def _clip(value: object, place: str, clips: Collection[str]) -> Clip:
    data = as_object(value, place, ("duration", *_MOTION))
    return Clip(_duration(data, place), _tracks(data, place), _placements(data, place, clips))


def _layer(value: object, place: str, clips: Collection[str]) -> Layer:
    data = as_object(value, place)
    generator = None
    parameters: tuple[str, ...] = ()
    if "generator" in data:
        kind = as_choice(data["generator"], f"{place}.generator", "generator", GENERATORS)
        parameters = tuple(item.name for item in fields(GENERATORS[kind]))
    as_object(data, place, ("name", "weight", "generator", *_MOTION, *parameters))
    if parameters:
        generator = _generator(kind, {k: data[k] for k in parameters if k in data}, place)
    return Layer(
        name=as_text(data.get("name", ""), f"{place}.name"),
        weight=curve_from_json(data.get("weight", 1), f"{place}.weight"),
        tracks=_tracks(data, place),
        placements=_placements(data, place, clips),
        generator=generator,
    )


def _generator(kind: str, given: dict[str, Any], place: str) -> Generator:
    values: dict[str, Any] = {}
    for name, value in given.items():
        where = f"{place}.{name}"
        if name == "seed":
            values[name] = as_whole(value, where, above=-1)
        else:
            factor = math.pi / 180 if name in DEGREES else 1.0
            values[name] = as_number(value, where) * factor
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
