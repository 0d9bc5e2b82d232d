"""Work that runs one step ahead: a thread fuses the next frame while the limb is followed in this one.

Decoding images and the compiled loops let other threads run meanwhile, so two processors share the work.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

_T = TypeVar("_T")
_R = TypeVar("_R")


def one_ahead(work: Callable[[_T], _R], items: Sequence[_T]) -> Generator[_R, None, None]:
    """``work`` of each item, in order; that of the next is under way while the caller looks at this one's.

    What ``work`` raises is raised when its item's turn has come. The thread ends with the iterator, which is ended by
    its last item, an error, or ``close``; at most the item under way is then still worked on.

    >>> list(one_ahead(lambda number: number**2, [1, 2, 3]))
    [1, 4, 9]
    """
    with ThreadPoolExecutor(max_workers=1, thread_name_prefix="one-ahead") as pool:
        following = [pool.submit(work, item) for item in items[:1]]
        for number in range(len(items)):
            ready = following.pop()
            current = ready.result()
            following = [pool.submit(work, item) for item in items[number + 1 : number + 2]]
            yield current
