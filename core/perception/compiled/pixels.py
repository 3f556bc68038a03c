"""Pixels of masks and skeletons, one by one: for ``thinning`` and ``pixel_graph``."""

from __future__ import annotations

import numpy as np
from numba import int64, uint8
from numpy.typing import NDArray

from core.perception.compiled.jit import compiled


@compiled((uint8[:], int64, int64[:], uint8[:]))
def thin(framed: NDArray[np.uint8], stride: int, outer: NDArray[np.int64], table: NDArray[np.uint8]) -> None:
    """Thin a mask of 0 and 1 with a frame of 0 around it, row by row in one array, in place.

    `outer` are the pixels at its edges. The table tells of each of 256 neighbourhoods in which of both turns (1, 2, 3: in both) a
    pixel goes. Only what may have changed is looked at: after one of its neighbours went, a pixel waits for a turn of each kind.
    """
    around = (-stride - 1, -stride, -stride + 1, 1, stride + 1, stride, stride - 1, -1)  # clockwise from the upper left
    size = 0
    for i in range(len(framed)):
        size += framed[i]
    waits = np.zeros(len(framed), np.uint8)
    first, second, gone = np.empty(size, np.int32), np.empty(size, np.int32), np.empty(size, np.int32)
    in_first = in_second = len(outer)
    for k in range(len(outer)):
        first[k] = second[k] = outer[k]
        waits[outer[k]] = 3
    kind = 1
    while in_first or in_second:
        queue, count = (first, in_first) if kind == 1 else (second, in_second)
        going = 0
        for k in range(count):
            i = queue[k]
            waits[i] &= 3 - kind
            if framed[i]:
                bits = 0
                for n in range(8):
                    bits |= framed[i + around[n]] << n
                if table[bits] & kind:
                    gone[going] = i
                    going += 1
        if kind == 1:
            in_first = 0
        else:
            in_second = 0
        for k in range(going):
            framed[gone[k]] = 0
        for k in range(going):
            for n in range(8):
                i = gone[k] + around[n]
                if framed[i] and waits[i] != 3:
                    if not waits[i] & 1:
                        first[in_first] = i
                        in_first += 1
                    if not waits[i] & 2:
                        second[in_second] = i
                        in_second += 1
                    waits[i] = 3
        kind = 3 - kind


@compiled((int64[:], int64))
def trace(
    flat: NDArray[np.int64], width: int
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """The graph of a skeleton's pixels, given in order by their places in a picture of so many columns.

    Nodes (K, 2); the first and the last node of each chain (C,), (C,); the chains' points one after the other (N, 2), and where
    each one starts (C + 1,).
    """
    count = len(flat)
    left, right = width, 0
    for i in range(count):
        column = flat[i] % width
        left, right = min(left, column), max(right, column)
    top = flat[0] // width if count else 0
    stride = max(right - left, 0) + 3
    size = ((flat[count - 1] // width - top if count else 0) + 3) * stride
    # Pixels are counted from 1; 0 stands for none.
    is_set, index = np.zeros(size, np.bool_), np.empty(size, np.int32)
    place, x, y = np.empty(count + 1, np.int64), np.zeros(count + 1), np.zeros(count + 1)
    for i in range(count):
        row, column = flat[i] // width, flat[i] % width
        place[i + 1] = (row - top + 1) * stride + column - left + 1
        x[i + 1], y[i + 1] = column, row
        is_set[place[i + 1]] = True
        index[place[i + 1]] = i + 1
    # Straight neighbours first; a diagonal one is linked only where no straight one makes the link.
    step_x, step_y = (0, -1, 1, 0, -1, 1, -1, 1), (-1, 0, 0, 1, -1, -1, 1, 1)
    near = np.zeros((count + 1, 8), np.int32)
    links = np.zeros(count + 1, np.int64)
    both = np.full(count + 1, -1, np.int64)  # of a chain's pixel: each neighbour tells from it the other one
    for i in range(1, count + 1):
        pair = 0
        for k in range(8):
            there = place[i] + step_y[k] * stride + step_x[k]
            if not is_set[there]:
                continue
            if k >= 4 and (is_set[place[i] + step_y[k] * stride] or is_set[place[i] + step_x[k]]):
                continue
            near[i, links[i]] = index[there]
            pair ^= index[there]
            links[i] += 1
        if links[i] < 3:
            both[i] = pair
    # Junction pixels that touch are one node.
    nodes = np.empty((count + 1, 2))
    node_of = np.full(count + 1, -1, np.int64)
    many, pending = 0, np.empty(count + 1, np.int64)
    for i in range(1, count + 1):
        if links[i] < 3 or node_of[i] >= 0:
            continue
        members, waiting = 0, 1
        across = down = 0.0
        pending[0], node_of[i] = i, many
        while waiting:
            waiting -= 1
            pixel = pending[waiting]
            members += 1
            across, down = across + x[pixel], down + y[pixel]
            for k in range(links[pixel]):
                other = near[pixel, k]
                if links[other] >= 3 and node_of[other] < 0:
                    node_of[other] = many
                    pending[waiting] = other
                    waiting += 1
        nodes[many, 0], nodes[many, 1] = across / members, down / members
        many += 1
    # First the chains that hang on a junction, then those between two ends, then rings.
    points = np.empty((3 * count + 3, 2))
    starts, ends, marks = np.empty(count + 1, np.int64), np.empty(count + 1, np.int64), np.zeros(count + 2, np.int64)
    walked_by = np.zeros(count + 1, np.bool_)
    chains = filled = 0
    for turn in range(3):
        for i in range(1, count + 1):
            is_asked = links[i] >= 3 if turn == 0 else links[i] <= 1 if turn == 1 else links[i] == 2
            if not is_asked:
                continue
            for k in range(links[i] if turn == 0 else 1):
                first = near[i, k] if turn == 0 else i
                if node_of[first] >= 0 or walked_by[first]:
                    continue
                junction = i if turn == 0 else 0
                begin, walked = filled, 0
                if turn == 0:
                    points[filled] = nodes[node_of[i]]
                    filled += 1
                previous, pixel = junction, first
                if turn == 2:
                    previous = max(near[first, 0], near[first, 1])
                    previous = both[first] ^ previous  # so that the ring is walked towards the greater neighbour
                while both[pixel] >= 0 and not (turn == 2 and walked and pixel == first):
                    points[filled, 0], points[filled, 1] = x[pixel], y[pixel]
                    filled += 1
                    walked += 1
                    walked_by[pixel] = True
                    last = pixel
                    previous, pixel = pixel, both[pixel] ^ previous
                if turn == 0:
                    start = node_of[i]
                else:
                    nodes[many, 0], nodes[many, 1] = x[first], y[first]
                    start = many
                    many += 1
                if turn == 2:
                    end = start
                    points[filled, 0], points[filled, 1] = x[first], y[first]
                    filled += 1
                elif turn == 1 and walked == 1 and pixel == 0:  # a lone pixel
                    filled = begin
                    continue
                elif pixel:
                    end = node_of[pixel]
                    points[filled] = nodes[end]
                    filled += 1
                else:
                    nodes[many, 0], nodes[many, 1] = x[last], y[last]
                    end = many
                    many += 1
                if turn < 2 and start == end and walked <= 2:  # a bump of the junction, not a loop
                    filled = begin
                    continue
                starts[chains], ends[chains] = start, end
                chains += 1
                marks[chains] = filled
    return nodes[:many].copy(), starts[:chains].copy(), ends[:chains].copy(), points[:filled].copy(), marks[: chains + 1].copy()
