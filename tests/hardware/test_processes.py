"""The slot in shared memory between two processes."""

from __future__ import annotations

import mmap
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.processes import SharedSlot


@pytest.fixture
def memory() -> Iterator[mmap.mmap]:
    with mmap.mmap(-1, SharedSlot.size(16)) as memory:
        yield memory


def test_the_newest_value_wins(memory: mmap.mmap) -> None:
    writer, reader = SharedSlot(memory, 0, 16), SharedSlot(memory, 0, 16)
    assert reader.newest() is None
    for text in (b"one", b"two", b"three", b""):
        writer.put(text)
    assert reader.newest() == (4, b"")
    assert reader.newest() == (4, b"")
    writer.put(b"x" * 16)
    assert reader.newest() == (5, b"x" * 16)
    with pytest.raises(ValueError, match="17 bytes"):
        writer.put(b"x" * 17)


@given(st.integers(0, 31), st.integers(1, 255))
def test_a_half_written_value_is_none_and_the_one_before_stands(at: int, flip: int) -> None:
    """Whatever byte of the newest half is not as it should be. (16 bytes of head, 16 of data, the newest in the first half.)"""
    with mmap.mmap(-1, SharedSlot.size(16)) as memory:
        writer = SharedSlot(memory, 0, 16)
        writer.put(b"before" + bytes(10))
        writer.put(b"after" + bytes(11))
        memory[at] ^= flip
        assert SharedSlot(memory, 0, 16).newest() == (1, b"before" + bytes(10))
