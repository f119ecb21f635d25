"""What a source is, by its bytes; what is there in folders that hold no photos."""

from __future__ import annotations

import shutil
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image

from filmed import grey, written
from mien.capture.folder import ignored_files, photo_files
from mien.capture.source_kind import kind_of_source, made_by_mien
from mien.errors import FileFormatError, InputError
from mien.io.examples.example_folder import EXAMPLES_FORMAT
from mien.io.head.head_json import HEAD_FORMAT

CLIPS = {
    "mp4": "libx264",
    "mov": "libx264",
    "mkv": "libx264",
    "ts": "libx264",
    "mts": "libx264",
    "flv": "libx264",
    "3gp": "mpeg4",
    "avi": "mpeg4",
    "mpg": "mpeg2video",
    "wmv": "wmv2",
    "ogv": "libtheora",
    "webm": "libvpx",
    "gif": "gif",
    "apng": "apng",
}
_FORMATS = {
    "ts": "mpegts",
    "mts": "mpegts",
    "mkv": "matroska",
    "wmv": "asf",
    "mpg": "mpeg",
    "ogv": "ogg",
}


def clip(path: Path, kind: str) -> Path:
    """A clip of a container's kind, whatever the path's ending."""
    if CLIPS[kind] not in av.codecs_available:
        pytest.skip(f"this FFmpeg writes no {CLIPS[kind]}")
    with av.open(str(path), "w", format=_FORMATS.get(kind, kind)) as out:
        stream = out.add_stream(CLIPS[kind], rate=25)
        stream.width, stream.height = 64, 48
        stream.pix_fmt = {"gif": "rgb8", "apng": "rgb24"}.get(kind, "yuv420p")
        # Noise: of a stream without an index, as .ts, it takes some kilobytes to know it.
        for pixels in np.random.default_rng(1).integers(0, 256, (10, 48, 64, 3), np.uint8):
            frame = av.VideoFrame.from_ndarray(pixels, format="rgb24")
            out.mux(stream.encode(frame))
        out.mux(stream.encode())
    return path


def photo(path: Path, kind: str = "PNG") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new("RGB", (32, 24), (90, 60, 30)).save(path, kind)
    return path


@pytest.mark.parametrize("kind", CLIPS)
@pytest.mark.parametrize("name", ["a.{}", "a", "a.mp4", "a.xyz"])
def test_a_clip_is_one_whatever_its_name(tmp_path: Path, kind: str, name: str) -> None:
    assert kind_of_source(clip(tmp_path / name.format(kind), kind)) == "video"


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "TIFF", "WEBP", "BMP", "GIF", "AVIF", "HEIF"])
@pytest.mark.parametrize("name", ["a", "a.mp4", "a.xyz"])
def test_a_photo_is_one_whatever_its_name(tmp_path: Path, kind: str, name: str) -> None:
    import pillow_heif

    pillow_heif.register_heif_opener()
    assert kind_of_source(photo(tmp_path / name, kind)) == "photo"


@pytest.mark.parametrize("name", ["clip.ts", "clip.wmv"])
def test_the_handed_clips(shared: Path, tmp_path: Path, name: str) -> None:
    handed = shared / "data/cases/clip_kinds" / name
    assert kind_of_source(handed) == "video"
    assert kind_of_source(shutil.copy(handed, tmp_path / "clip")) == "video"


def test_unrecognized_bytes_are_what_the_name_says(tmp_path: Path) -> None:
    for name, kind in (("a.mp4", "video"), ("a.MPG", "video"), ("a.jpg", "photo")):
        (tmp_path / name).write_text("no such thing")
        assert kind_of_source(tmp_path / name) == kind


@pytest.mark.parametrize(
    ("name", "content", "found"),
    [
        ("a.txt", b"text", "a text file"),
        ("a", b"%PDF-1.7", r"something else \(a PDF\)"),
        ("a.cr3", b"\0\0\0\x18ftypcrx ", r"a \.cr3 file \(camera RAW: export as JPEG or TIFF\)"),
        ("a.jxl", b"\xff\x0a" + bytes(9), r"a \.jxl file \(JPEG XL"),
        ("a.jpg", b"", "an empty file"),
    ],
)
def test_neither_photo_nor_video(tmp_path: Path, name: str, content: bytes, found: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileFormatError, match=rf"{name}: expected a photo or a video, .*{found}"):
        kind_of_source(tmp_path / name)


@pytest.mark.parametrize(
    "content",
    [
        "ffconcat version 1.0\nfile b.mp4\n",
        "#EXTM3U\n#EXTINF:1,\nb.mp4\n",
        "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=x\nc=IN IP4 127.0.0.1\nt=0 0\nm=video 5004 RTP/AVP 96\n",
    ],
)
def test_lists_of_other_files_and_addresses_are_no_videos(tmp_path: Path, content: str) -> None:
    written(tmp_path / "b.mp4", grey([1, 2]))
    (tmp_path / "a").write_text(content)
    with pytest.raises(FileFormatError, match="a: expected a photo or a video, found a text file"):
        kind_of_source(tmp_path / "a")


def test_nothing_given_is_not_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    photo(tmp_path / "a.png")
    monkeypatch.chdir(tmp_path)
    assert kind_of_source(".") == "folder"
    with pytest.raises(InputError, match=r"source: expected a photo, .*, got an empty name"):
        kind_of_source("")


@pytest.mark.parametrize(
    ("index", "format", "kind"),
    [
        ("head.json", HEAD_FORMAT.name, "a head folder"),
        ("examples.json", EXAMPLES_FORMAT.name, "an example folder"),
    ],
)
def test_what_mien_made_is_no_source(tmp_path: Path, index: str, format: str, kind: str) -> None:
    made = tmp_path / "made"
    photo(made / "a.png")
    (made / index).write_text(f'{{\n "format": "{format}",\n "version": 1}}')
    assert made_by_mien(made) == kind
    with pytest.raises(InputError, match=f"made: expected photos or a video, got {kind} that"):
        kind_of_source(made)
    # Nor is it an expression's folder, whose picture would be its sheet.
    photo(tmp_path / "neutral" / "b.png")
    assert list(photo_files(tmp_path)) == ["neutral"]
    assert ignored_files(tmp_path) == [f"{tmp_path.name}: not read: made, {kind} that mien made"]
    (made / index).write_text('{"format": "of somebody else"}')
    assert kind_of_source(made) == "folder"


def nothing_in(folder: Path) -> str:
    with pytest.raises(InputError) as caught:
        photo_files(folder)
    assert caught.value.name == str(folder)
    assert caught.value.expected.startswith("photos in this folder or in folders within (JPEG")
    return caught.value.got


@pytest.mark.parametrize("place", [".", "neutral"])
def test_a_folder_of_other_kinds_says_what_is_there(tmp_path: Path, place: str) -> None:
    folder = tmp_path / place
    folder.mkdir(exist_ok=True)
    for name in ("a.CR3", "b.cr3", "c.jxl", ".hidden.nef"):
        (folder / name).write_bytes(b"raw")
    assert nothing_in(tmp_path) == (
        "2 .cr3 files (camera RAW: export as JPEG or TIFF); "
        "1 .jxl file (JPEG XL: convert to JPEG or PNG)"
    )


def test_a_folder_of_clips(tmp_path: Path) -> None:
    (tmp_path / "a.mov").write_bytes(b"clip")
    (tmp_path / "b.ts").write_bytes(b"clip")
    expected = "2 videos, as a.mov (give a video itself as the source)"
    assert nothing_in(tmp_path) == expected


def test_photos_that_lie_deeper(tmp_path: Path) -> None:
    photo(tmp_path / "2026" / "neutral" / "a.png")
    where = Path("2026") / "neutral"
    assert nothing_in(tmp_path) == f"photos one level deeper, as in {where}: give the folder 2026"


def test_an_empty_folder_and_one_of_other_things(tmp_path: Path) -> None:
    assert nothing_in(tmp_path) == "none"
    (tmp_path / "notes.txt").write_text("x")
    assert nothing_in(tmp_path) == "1 other file, as notes.txt"


def test_beside_photos_what_is_not_read_is_noted(tmp_path: Path) -> None:
    photo(tmp_path / "a.jpg", "JPEG")
    for name in ("a.dng", "b.dng", "c.mp4", "d.txt", ".e.dng"):
        (tmp_path / name).write_bytes(b"x")
    assert photo_files(tmp_path) == {"neutral": [tmp_path / "a.jpg"]}
    assert ignored_files(tmp_path) == [
        f"{tmp_path.name}: not read: 2 .dng files (camera RAW: export as JPEG or TIFF)",
        f"{tmp_path.name}: not read: 1 video, as c.mp4 (give a video itself as the source)",
        "not used, as they are no photos or lie beside photos: d.txt",
    ]


def test_a_photo_without_an_ending_in_a_folder(tmp_path: Path) -> None:
    photo(tmp_path / "a")
    (tmp_path / "b").write_text("no photo")
    assert photo_files(tmp_path) == {"neutral": [tmp_path / "a"]}
    assert ignored_files(tmp_path) == ["not used, as they are no photos or lie beside photos: b"]


@pytest.mark.parametrize("ending", ["ppm", "pgm", "pbm", "jp2", "j2k", "jpx", "dib"])
def test_uncommon_endings_are_photos_in_a_folder(tmp_path: Path, ending: str) -> None:
    mode = {"pgm": "L", "pbm": "1"}.get(ending, "RGB")
    Image.new(mode, (8, 8)).save(tmp_path / f"a.{ending.upper()}")
    assert photo_files(tmp_path) == {"neutral": [tmp_path / f"a.{ending.upper()}"]}
    assert not ignored_files(tmp_path)
