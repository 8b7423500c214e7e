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
    ask(1, 0)  # now two of each have room
    for key in (0, 4, 4):
        ask(0, key)
    assert made == [(0, 0), (0, 1), (0, 2), (0, 3), (1, 0), (0, 4)]
    ask(0, 1)
    ask(0, 0)
    assert made[6:] == [(0, 1), (0, 0)]
