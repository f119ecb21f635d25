from __future__ import annotations

from mien.capture.notes import merge_notes


def test_a_note_on_one_picture_names_it() -> None:
    notes = [("a.png", "odd"), ("b.png", "small")]
    assert merge_notes(notes) == ["a.png: odd", "b.png: small"]


def test_up_to_three_names_are_listed() -> None:
    notes = [("a.png", "odd"), ("b.png", "odd"), ("c.png", "odd")]
    assert merge_notes(notes) == ["a.png, b.png, c.png: odd"]


def test_many_are_counted_once() -> None:
    notes = [(f"{number}.png", "odd") for number in range(60)]
    assert merge_notes(notes) == ["0.png and 59 more: odd"]


def test_notes_that_differ_in_numbers_are_alike() -> None:
    notes = [("a.png", "scaled from 300x400"), ("b.png", "scaled from 30x40")]
    assert merge_notes(notes) == ["a.png, b.png: scaled from 300x400 (numbers of the first)"]


def test_a_note_keeps_the_name_of_its_photo() -> None:
    notes = [("b.png", "left out: the same as 1.png"), ("c.png", "left out: the same as 2.png")]
    assert merge_notes(notes) == [f"{name}: {note}" for name, note in notes]
