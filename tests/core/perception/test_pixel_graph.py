import numpy as np

from core.perception.skeleton import trace
from tests.core.drawing import art


def test_a_line_is_one_chain_between_two_ends() -> None:
    graph = trace(
        art("""
......
.#....
..##..
....#.
......
""")
    )
    assert graph.degrees().tolist() == [1, 1]
    assert [chain.points.tolist() for chain in graph.chains] == [[[1, 1], [2, 2], [3, 2], [4, 3]]]


def test_a_fork_has_one_junction_and_three_ends() -> None:
    graph = trace(
        art("""
#.......#
.#.....#.
..#...#..
...#.#...
....#....
....#....
....#....
""")
    )
    assert sorted(graph.degrees().tolist()) == [1, 1, 1, 3]
    junction = int(np.argmax(graph.degrees()))
    assert graph.nodes[junction].tolist() == [4, 4]
    assert sorted(len(chain.points) for chain in graph.chains) == [3, 5, 5]


def test_a_staircase_is_no_row_of_junctions() -> None:
    graph = trace(
        art("""
##....
.##...
..##..
...##.
....##
""")
    )
    assert graph.degrees().tolist() == [1, 1]
    assert len(graph.chains[0].points) == 10


def test_touching_junction_pixels_are_one_node_at_their_mean() -> None:
    graph = trace(
        art("""
.#..#.
.#..#.
..##..
.#..#.
.#..#.
""")
    )
    assert sorted(graph.degrees().tolist()) == [1, 1, 1, 1, 4]
    assert graph.nodes[int(np.argmax(graph.degrees()))].tolist() == [2.5, 2]


def test_a_ring_and_a_ring_on_a_stick() -> None:
    ring = trace(
        art("""
..###..
.#...#.
.#...#.
..###..
""")
    )
    assert ring.degrees().tolist() == [2]
    assert ring.chains[0].points[0].tolist() == ring.chains[0].points[-1].tolist()
    assert len(ring.chains[0].points) == 11
    stick = trace(
        art("""
..###......
.#...#.....
.#....#####
.#...#.....
..###......
""")
    )
    assert sorted(stick.degrees().tolist()) == [1, 3]
    assert sorted(len(chain.points) for chain in stick.chains) == [5, 13]


def test_a_lone_pixel_is_a_node_without_chains() -> None:
    graph = trace(
        art("""
...
.#.
...
""")
    )
    assert graph.nodes.tolist() == [[1, 1]]
    assert graph.chains == ()
    assert graph.degrees().tolist() == [0]


def test_nothing() -> None:
    graph = trace(np.zeros((5, 7), bool))
    assert graph.nodes.shape == (0, 2)
    assert graph.degrees().tolist() == []


def test_a_path_longer_than_any_recursion_limit() -> None:
    snake = np.zeros((200, 400), bool)
    snake[1::2, 1:-1] = True
    snake[2::4, -2] = snake[4::4, 1] = True
    snake[199] = False
    graph = trace(snake)
    assert graph.degrees().tolist() == [1, 1]
    assert len(graph.chains[0].points) == snake.sum() > 30_000
