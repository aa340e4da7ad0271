# SPDX-License-Identifier: BSD-2-Clause
"""Sets of contact forces: their support functions and inequalities, against points of theirs."""

import copy
import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from dynacom import ContactSet, Section
from helpers import array_kinds
from set_problems import KINDS, Shape, box, random_contact, random_polygon

TRIANGLE = [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]]


def random_shape(rng: np.random.Generator) -> Shape:
    if rng.integers(3) == 0:
        return Shape(radius=rng.uniform(0.1, 1.0))
    if rng.integers(2) == 0:
        return box(*rng.uniform(0.1, 1.0, 2))
    return random_polygon(rng, 1.0, int(rng.integers(1, 9)), 2.0)


def test_rectangles():
    rectangle = Section.rectangle(lower=[-1, -0.5], upper=(2, 0.5))
    assert rectangle.shape() == Section.Shape.Rectangle
    assert_array_equal(rectangle.lower(), [-1.0, -0.5])
    assert_array_equal(rectangle.upper(), [2.0, 0.5])
    assert rectangle.radius() == 0.0
    assert rectangle.vertices().shape == (0, 2)
    assert rectangle == Section.polygon([[2, -0.5], [-1, -0.5], [2, 0.5], [-1, 0.5]])
    assert rectangle != Section.rectangle([-1, -0.5], [2, 0.6])
    assert Section() == Section.polygon([[0, 0]])


def test_discs():
    disc = Section.disc(radius=0.5)
    assert disc.shape() == Section.Shape.Disc
    assert disc.radius() == 0.5
    assert_array_equal(disc.lower(), [-0.5, -0.5])
    assert disc.support([3, 4]) == 2.5
    assert disc.excess([3, 4], normal_force=8.0) == 1.0
    assert Section.disc(0.0) == Section()


@pytest.mark.parametrize("points", [TRIANGLE, tuple(map(tuple, TRIANGLE)), np.array(TRIANGLE)])
def test_polygons_have_their_points_in_rows(points):
    polygon = Section.polygon(points=points)
    assert polygon.shape() == Section.Shape.Polygon
    vertices = polygon.vertices()
    assert sorted(map(tuple, vertices)) == sorted(map(tuple, TRIANGLE))
    (ax, ay), (bx, by) = vertices[1] - vertices[0], vertices[2] - vertices[0]
    assert ax * by - ay * bx == 1.0  # counter-clockwise
    assert_array_equal(polygon.upper(), [1.0, 1.0])


def test_points_within_their_hull_are_no_vertices():
    assert Section.polygon([*TRIANGLE, [0.2, 0.2], [0.5, 0.5]]) == Section.polygon(TRIANGLE)
    edge = Section.polygon([[0, 0], [0.5, 0.5], [1, 1]])
    assert_array_equal(edge.vertices(), [[0.0, 0.0], [1.0, 1.0]])


@pytest.mark.parametrize("facets", range(4, 65))
def test_facets_touch_the_disc(facets):
    angle = 0.3
    polygon = Section.facets(radius=0.5, facets=facets, angle=angle)
    vertices = polygon.vertices()
    assert len(vertices) == facets
    assert_allclose(np.linalg.norm(vertices, axis=1), 0.5 / np.cos(np.pi / facets))
    for k in range(facets):
        normal = angle + 2.0 * np.pi * k / facets
        assert_allclose(polygon.support([np.cos(normal), np.sin(normal)]), 0.5)


def test_four_facets_are_the_rectangle():
    assert Section.facets(0.5, 4) == Section.rectangle([-0.5, -0.5], [0.5, 0.5])


def test_support_and_excess_of_sections():
    """Nothing is farther than the vertices; sums of them are inside, what is beyond is not."""
    rng = np.random.default_rng(1)
    for _ in range(300):
        shape, direction, normal = random_shape(rng), rng.normal(size=2), rng.uniform(0.0, 10.0)
        section = shape.section()
        assert_allclose(section.support(direction), shape.support(direction), atol=1e-12)
        assert section.excess(normal * shape.random_point(rng), normal) <= 1e-12
        # The support function's point is on the boundary, and beyond it is outside by as much.
        unit = direction / np.linalg.norm(direction)
        (farthest,) = shape.exposed(unit, 1e-12).vertices
        assert_allclose(section.excess(normal * farthest, normal), 0.0, atol=1e-12)
        assert section.excess(normal * farthest + 0.1 * unit, normal) > 0.01
        if shape.radius > 0.0:
            beyond = normal * farthest + 0.1 * unit
            assert_allclose(section.excess(beyond, normal), 0.1)


@pytest.mark.parametrize("kind", KINDS)
def test_support_and_excess_of_sets(kind):
    """Of random forces none is farther than the support function, and the exposed face is."""
    rng = np.random.default_rng(2)
    for _ in range(100):
        contact = random_contact(rng, kind)
        contact_set = contact.make().set
        assert contact_set.size() == contact.size
        direction = rng.normal(size=contact.size)
        support = contact_set.support(direction)
        size = 10.0 ** rng.uniform(0.0, 3.0)
        for _ in range(20):
            force = contact.random_force(rng, size)
            assert contact_set.excess(force) <= 1e-12 * size
            assert force @ direction <= support + 1e-12 * size
        if np.isfinite(support):
            farthest = contact.exposed(direction).random_force(rng, size)
            assert_allclose(farthest @ direction, support, rtol=1e-9, atol=1e-9)
            assert contact_set.excess(farthest) <= 1e-9 * max(1.0, np.abs(farthest).max())
            assert contact_set.excess(farthest + direction) > 0.0


def test_moments_are_those_of_a_force_at_a_place():
    places = [[0.1, 0.0], [0.0, 0.05], [-0.1, -0.05]]
    contact_set = ContactSet.surface(Section.disc(0.7), places=Section.polygon(places), gamma=0.02)
    force = np.array([0.3, 0.0, 10.0])
    for x, y in places:
        moment = np.cross([x, y, 0.0], force)
        moment[2] = 0.0
        assert_allclose(contact_set.excess([*force, *moment]), 0.0, atol=1e-12)
        assert contact_set.excess([*force, *(1.01 * moment)]) > 0.0
    assert_allclose(contact_set.excess([*force, 0.0, 0.0, 0.3]), 0.1)


def test_what_a_set_tells():
    point = ContactSet.point(friction=Section.disc(0.5))
    assert point.kind() == ContactSet.Kind.Point
    assert point.friction() == Section.disc(0.5)
    assert point.isCone()
    point.boundNormalForce(least=10, greatest=100)
    assert not point.isCone()
    assert point.lower()[2] == 10.0
    assert point.upper()[2] == 100.0
    assert point.support([0, 0, 1]) == 100.0
    assert point.support([0, 0, -1]) == -10.0
    assert ContactSet.point(Section()).support([0, 0, 1]) == np.inf
    sole = ContactSet.surface(Section(), Section.rectangle([-0.1, -0.05], [0.2, 0.05]), 0.03)
    assert sole.kind() == ContactSet.Kind.Surface
    assert sole.moments() == Section.rectangle([-0.05, -0.2], [0.05, 0.1])
    assert sole.gamma() == 0.03
    grasp = ContactSet.grasp(lower=[-1] * 6, upper=[2, np.inf, 2, 2, 2, 2])
    assert grasp.kind() == ContactSet.Kind.Grasp
    assert not grasp.isCone()
    assert grasp.support([-1, 0, 0, 0, 0, 1]) == 3.0
    assert ContactSet() == ContactSet.point(Section())


def test_sets_are_values():
    point = ContactSet.point(Section.disc(0.5))
    for other in (point.copy(), copy.copy(point), copy.deepcopy(point)):
        assert other == point
        other.boundNormalForce(0.0, 1.0)
        assert other != point
    assert point.isCone()
    for value in (Section.Shape.Disc, ContactSet.Kind.Grasp):
        assert pickle.loads(pickle.dumps(value)) is value


def test_sets_print():
    disc = "Section(shape=Disc, radius=0.5)"
    assert (
        repr(Section.disc(0.5)) == str(Section.disc(0.5)) == Section.disc(0.5).to_string() == disc
    )
    polygon = "Section(shape=Polygon, vertices=3, lower=[0 0], upper=[1 1])"
    assert repr(Section.polygon(TRIANGLE)) == polygon
    point = "Section(shape=Rectangle, lower=[0 0], upper=[0 0])"
    assert repr(Section()) == point
    assert (
        repr(ContactSet.point(Section.disc(0.5)))
        == f"ContactSet(kind=Point, friction={disc}, normal_force=[0 inf])"
    )
    sole = ContactSet.surface(
        Section.disc(0.5), Section.rectangle([-0.1, -0.05], [0.2, 0.05]), gamma=0.02
    )
    sole.boundNormalForce(10.0, 20.0)
    assert repr(sole) == (
        f"ContactSet(kind=Surface, friction={disc}, moments=Section(shape=Rectangle, "
        "lower=[-0.05 -0.2], upper=[0.05 0.1]), gamma=0.02, normal_force=[10 20])"
    )
    grasp = ContactSet.grasp([-1.0] * 6, [np.inf] * 6)
    assert repr(grasp) == (
        "ContactSet(kind=Grasp, lower=[-1 -1 -1 -1 -1 -1], upper=[inf inf inf inf inf inf])"
    )


def test_arrays_of_every_kind():
    for _, lower in array_kinds([-1.0, -2.0]):
        assert Section.rectangle(lower, [3, 4]) == Section.rectangle([-1, -2], [3, 4])
    rows = np.array(TRIANGLE)
    for points in (rows.astype(int), rows.astype(np.float32), np.asfortranarray(rows), rows[::-1]):
        assert Section.polygon(points) == Section.polygon(TRIANGLE)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: Section.rectangle([1, 0], [0, 0]), ValueError, "^a rectangle must go from"),
        (lambda: Section.rectangle([1, 0, 2], [0, 0]), ValueError, "^lower must have 2 comp.* 3$"),
        (
            lambda: Section.rectangle([0, 0], None),
            TypeError,
            "^upper must be an array, .* NoneType",
        ),
        (lambda: Section.disc(-1.0), ValueError, "^a disc's radius must be finite and >= 0"),
        (lambda: Section.disc(np.nan), ValueError, "^a disc's radius must be finite and >= 0"),
        (lambda: Section.polygon([]), ValueError, "^a polygon must have a point at least"),
        (lambda: Section.polygon([[0, np.inf]]), ValueError, "^a polygon's points must be finite"),
        (lambda: Section.polygon([[0, 1, 2]]), ValueError, r"^points\[0\] must have 2 comp.* 3$"),
        (lambda: Section.polygon([[0, 1], 2]), TypeError, r"^points\[1\] must be an .* got int$"),
        (lambda: Section.polygon(None), TypeError, "^points must be an array, .* rows, got NoneT"),
        (lambda: Section.polygon(np.float64(1)), TypeError, "^points must be .* numpy.float64$"),
        (lambda: Section.polygon(np.array(1.0)), TypeError, "^points must be .* numpy.ndarray$"),
        (lambda: Section.polygon([["a", "b"]]), TypeError, r"^points\[0\] must .* str as number 0"),
        (lambda: Section.facets(0.5, 3), ValueError, "^facets must be from 4 to 64, got 3$"),
        (lambda: Section.facets(0.5, 65), ValueError, "^facets must be from 4 to 64, got 65$"),
        (lambda: Section.facets(0.5, 8, np.nan), ValueError, "^angle must be finite"),
        (lambda: Section.facets(-0.5, 8), ValueError, "^a polygon's inner radius must be finite"),
        (lambda: Section.disc(1).support([1]), ValueError, "^direction must have 2 components"),
        (lambda: Section.disc(1).excess([1], 2.0), ValueError, "^point must have 2 components"),
        (
            lambda: ContactSet.surface(Section(), Section(), -1.0),
            ValueError,
            "^gamma must be finite and >= 0, got -1$",
        ),
        (lambda: ContactSet.grasp([1] * 6, [0] * 6), ValueError, "^lower bounds must be at most"),
        (lambda: ContactSet.grasp([1] * 5, [0] * 6), ValueError, "^lower must have 6 components"),
        (
            lambda: ContactSet.grasp([0] * 6, "123456"),
            TypeError,
            "^upper must be an array, .* str$",
        ),
        (lambda: ContactSet().boundNormalForce(2, 1), ValueError, "^the normal force must have b"),
        (lambda: ContactSet().boundNormalForce(-1, 1), ValueError, "^the normal force must have b"),
        (
            lambda: ContactSet.grasp([0] * 6, [1] * 6).boundNormalForce(0, 1),
            ValueError,
            "^a grasp has bounds of its own$",
        ),
        (lambda: ContactSet().support([1] * 6), ValueError, "^direction must have 3 components"),
        (lambda: ContactSet().excess([1, 2]), ValueError, "^force must have 3 components, got 2$"),
    ],
)
def test_what_is_refused(call, error, message):
    with pytest.raises(error, match=message):
        call()
