"""A few values are kept for each object, and go with it."""

import gc
import weakref

from sensors.view.view_cache import ViewCache


class Thing:
    pass


def test_the_last_few_are_kept_and_the_least_asked_for_goes() -> None:
    made: list[str] = []
    kept: ViewCache[str] = ViewCache(2)
    thing = Thing()

    def ask(key: str, *, keep: bool = True) -> str:
        return kept.get(thing, key, lambda: made.append(key) or key, keep=keep)

    for key in ("a", "b", "a", "c", "a", "b"):
        assert ask(key) == key
    # c replaced b, not a, which was used since
    assert made == ["a", "b", "c", "b"]
    ask("d", keep=False)
    ask("b")
    ask("d")
    assert made == ["a", "b", "c", "b", "d", "d"]


def test_values_are_each_object_s_own_and_go_with_it() -> None:
    kept: ViewCache[Thing] = ViewCache(1)
    one, two = Thing(), Thing()
    value = kept.get(one, None, Thing)
    assert kept.get(two, None, Thing) is not value
    gone = weakref.ref(value)
    del one, value
    gc.collect()
    assert gone() is None


def test_objects_share_the_room() -> None:
    made: list[tuple[int, int]] = []
    kept: ViewCache[object] = ViewCache(4, room=8)
    things = [Thing(), Thing()]

    def ask(which: int, key: int) -> None:
        kept.get(things[which], key, lambda: made.append((which, key)), size=2)

    for key in range(4):
        ask(0, key)
    ask(1, 0)  # the first value of the other object makes room
    assert made == [(0, 0), (0, 1), (0, 2), (0, 3), (1, 0)]
    ask(0, 3)
    ask(0, 0)  # and that object, since the first was asked again
    assert made[5:] == [(0, 0)]
    ask(0, 1)
    ask(0, 2)
    assert made[6:] == []
    ask(1, 0)
    assert made[6:] == [(1, 0)]


def test_a_value_that_is_larger_than_the_room_is_kept_alone() -> None:
    made: list[int] = []
    kept: ViewCache[object] = ViewCache(4, room=8)
    thing = Thing()
    for key in (0, 0, 1, 1, 0):
        kept.get(thing, key, lambda key=key: made.append(key), size=9)
    assert made == [0, 1, 0]
