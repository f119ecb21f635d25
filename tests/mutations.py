"""Changes to files such as damage, other programs and mischief make them."""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

NUMBERS = (
    *("1e308", "-1e308", "1e999", "NaN", "Infinity", "-Infinity", "-1", "0", "0.5", "1e-320"),
    *(str(10**30), "9" * 5000, "2147483648", "-0", "1e9", "1_0", "0x10", "true", "1,5", ""),
)
VALUES = (
    None,
    True,
    -5,
    1.5,
    10**30,
    10**400,
    1e308,
    float("nan"),
    float("inf"),
    "",
    "x\0\n",
    "é" * 99,
)
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")

Rng = np.random.Generator


def mutated_bytes(data: bytes, rng: Rng) -> bytes:
    """Bits flipped, a piece lost, doubled, moved, filled or added, a number replaced."""
    return _BYTES[rng.integers(len(_BYTES))](data, rng)


def _flipped(data: bytes, rng: Rng) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.integers(1, 5)):
        if changed:
            changed[rng.integers(len(changed))] ^= 1 << rng.integers(8)
    return bytes(changed)


def _cut(data: bytes, rng: Rng) -> bytes:
    return data[: rng.integers(len(data) + 1)]


def _pieces(data: bytes, rng: Rng) -> tuple[bytes, bytes, bytes]:
    first, last = np.sort(rng.integers(len(data) + 1, size=2))
    return data[:first], data[first:last], data[last:]


def _lost(data: bytes, rng: Rng) -> bytes:
    before, _, after = _pieces(data, rng)
    return before + after


def _doubled(data: bytes, rng: Rng) -> bytes:
    before, piece, after = _pieces(data, rng)
    return before + piece + piece + after


def _filled(data: bytes, rng: Rng) -> bytes:
    before, piece, after = _pieces(data, rng)
    return before + rng.choice([b"\0", b"\xff", b"[", b"9", b"\n", b","]) * len(piece) + after


def _swapped_lines(data: bytes, rng: Rng) -> bytes:
    lines = data.split(b"\n")
    first, last = rng.integers(len(lines), size=2)
    lines[first], lines[last] = lines[last], lines[first]
    return b"\n".join(lines)


def _other_number(data: bytes, rng: Rng) -> bytes:
    found = list(_NUMBER.finditer(data[:200_000]))
    if not found:
        return b""
    match = found[rng.integers(len(found))]
    return data[: match.start()] + str(rng.choice(NUMBERS)).encode() + data[match.end() :]


_BYTES: tuple[Callable[[bytes, Rng], bytes], ...] = (
    *(_flipped, _cut, _lost, _doubled, _filled, _swapped_lines),
    *(_other_number,) * 3,
)


def mutated_json(data: bytes, rng: Rng) -> bytes:
    """A value of another kind, a key lost, renamed or doubled, a list longer or shorter, depth."""
    document = json.loads(data)
    place, key = _somewhere(document, rng)
    action = rng.integers(6)
    if action == 0:
        place[key] = VALUES[rng.integers(len(VALUES))]
    elif action == 1:
        place[key] = [place[key]] if rng.integers(2) else {"a": place[key]}
    elif action == 2:
        del place[key]
    elif action == 3 and isinstance(place, dict):
        place[f"{key}x"] = place.pop(key)
    elif action == 4 and isinstance(place, list):
        place.append(place[key])
    else:
        for _ in range(int(rng.choice([3, 100, 100_000]))):
            # Too deep for what writes JSON: made of text below.
            place[key] = "DEEP"
        depth = int(rng.choice([3, 100, 100_000]))
        text = json.dumps(document).replace('"DEEP"', "[" * depth + "]" * depth)
        return text.encode()
    return json.dumps(document).encode()


def _somewhere(document: Any, rng: Rng) -> tuple[Any, Any]:
    """A list or an object in a document, and one of its keys."""
    places = []
    waiting = [document]
    while waiting:
        item = waiting.pop()
        keys = list(item) if isinstance(item, dict) else range(len(item))
        places += [(item, key) for key in keys]
        waiting += [item[key] for key in keys if isinstance(item[key], dict | list)]
    # Those near the top as often as the many below.
    shallow = [(document, key) for key in document] if rng.integers(3) == 0 else places
    return shallow[rng.integers(len(shallow))]


def mutated_npz(data: bytes, rng: Rng) -> bytes:
    """An array of another kind, shape, order or range, lost, renamed, doubled, or a false claim."""
    with np.load(io.BytesIO(data)) as file:
        arrays = dict(file)
    name = list(arrays)[rng.integers(len(arrays))]
    array = arrays[name]
    action = rng.integers(8)
    if action == 0:
        kinds = ["U8", "O", "S8"] + ["f2", "c16", "i1", "u8", "?", ">f4"] * (
            array.dtype.kind != "U"
        )
        with np.errstate(all="ignore"):
            arrays[name] = array.astype(kinds[rng.integers(len(kinds))])
    elif action == 1:
        arrays[name] = array[..., :-1] if rng.integers(2) else array[None]
    elif action == 2:
        arrays[name] = array[: len(array) // 2]
    elif action == 3 and array.dtype.kind in "fiu":
        changed = array.astype(np.float64)
        wrong = rng.choice([np.nan, np.inf, -np.inf, -1, 0.5, 1e30, 1e300, 2.0**32, 1e5])
        changed.flat[rng.integers(changed.size)] = wrong
        arrays[name] = changed
    elif action == 4 and array.dtype.kind in "fiu":
        arrays[name] = array.astype(np.float64) * rng.choice([0, -1, 1e-9, 1e9, 1e300])
    elif action == 5:
        del arrays[name]
    elif action == 6:
        arrays[f"{name}x"] = arrays.pop(name)
    else:
        return _claiming(arrays, name, rng)
    stream = io.BytesIO()
    with np.errstate(all="ignore"):
        np.savez(stream, **arrays)
    return stream.getvalue()


def _claiming(arrays: dict[str, Any], name: str, rng: Rng) -> bytes:
    """A header that says another length than there is."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for key, array in arrays.items():
            member = io.BytesIO()
            shape = array.shape
            if key == name:
                shape = (int(rng.choice([0, 1, 10**6, 10**12])), *shape[1:])
            header = {"descr": array.dtype.str, "fortran_order": False, "shape": shape}
            np.lib.format.write_array_header_1_0(member, header)
            archive.writestr(f"{key}.npy", member.getvalue() + array.tobytes())
    return stream.getvalue()


def mutate_file(path: Path, others: list[bytes], rng: Rng) -> str:
    """Change a file in place, in a way that fits its kind.

    Args:
        others: contents of files of other kinds, to be swapped with.

    Returns:
        what was done.
    """
    data = path.read_bytes()
    kind = rng.integers(12)
    if kind == 0:
        path.write_bytes(others[rng.integers(len(others))])
        return "another file"
    if kind == 1:
        path.write_bytes(b"")
        return "emptied"
    if kind == 2:
        path.unlink()
        return "removed"
    change = mutated_bytes
    if kind % 2 == 0 and path.suffix == ".json":
        change = mutated_json
    elif kind % 2 == 0 and path.suffix == ".npz":
        change = mutated_npz
    path.write_bytes(change(data, rng))
    return change.__name__
