from __future__ import annotations

from marbled import GENERIC, Person, detected, photographed
from mien.reconstruction.shared_skin import ANOTHER_PERSON, find_other_people
from people import person

WHO, OTHER = Person(person(3), 1), Person(person(4), 2)
YAWS = (-8.0, 0.0, 8.0)


def views_of(who: Person) -> list:
    return [
        detected(view, camera, who.vertices, off_mm=0.0) for view, camera in photographed(who, YAWS)
    ]


def test_somebody_else_among_the_photos_is_named() -> None:
    cameras = [camera for _, camera in photographed(WHO, YAWS)]
    views = views_of(WHO)
    assert find_other_people(views, cameras, WHO.vertices, GENERIC) == ()
    views[2] = views_of(OTHER)[2]
    assert find_other_people(views, cameras, WHO.vertices, GENERIC) == (
        ANOTHER_PERSON.format("2.png", "1.png"),
    )


def test_photos_from_far_apart_are_not_judged() -> None:
    photos = photographed(WHO, (-30.0, 30.0))
    cameras = [camera for _, camera in photos]
    views = [photos[0][0], photographed(OTHER, (-30.0, 30.0))[1][0]]
    assert find_other_people(views, cameras, WHO.vertices, GENERIC) == ()
