"""Each element's record held to itself: shape functions, quadrature, faces, and the orders of VTK and of decks."""

from itertools import product

import numpy as np
import pytest
from meshio._vtk_common import meshio_to_vtk_type
from vtkmodules.vtkCommonDataModel import vtkGenericCell

from softtact.fem import elements
from softtact.fem.elements import HEX20, HEX27, LINE3, QUAD8, QUAD9, TET4, TET10, TRI3, TRI6, WEDGE18, Element, reference_gradients
from softtact.fem.quadrature import densest_rule, gauss, lobatto_gauss_rule, lobatto_rule
from softtact.fem.solid_block import HexBlock
from softtact.materials.laws.registry import make_law

ELEMENTS = {name: value for name, value in vars(elements).items() if isinstance(value, Element)}
EVERY_ELEMENT = pytest.mark.parametrize("element", ELEMENTS.values(), ids=list(ELEMENTS))
EVERY_SOLID = pytest.mark.parametrize("element", [HEX20, HEX27, WEDGE18, TET4, TET10], ids=["HEX20", "HEX27", "WEDGE18", "TET4",
"TET10"])
SIMPLICES, WEDGES = (TRI3, TRI6, TET4, TET10), (WEDGE18,)
LAW = make_law("mooney_rivlin", {"c10": 0.1706, "c01": 0.0040})


def inner_points(element, count=7):
    """Points (n, d) inside of the element."""
    weights = np.random.default_rng(1).dirichlet(np.ones(len(element.nodes)), count)
    return weights @ element.nodes


def integral(element, powers):
    """Of the product of the coordinates' powers over the parent element, by formula."""
    def line(power):
        return (1 - (-1) ** (power + 1)) / (power + 1)

    def simplex(some):     # prod(p!) / (d + sum(p))!
        factorial = np.cumprod([1, *range(1, 20)])
        return np.prod(factorial[list(some)]) / factorial[len(some) + sum(some)]

    if element in SIMPLICES:
        return simplex(powers)
    if element in WEDGES:
        return simplex(powers[:2]) * line(powers[2])
    return np.prod([line(power) for power in powers])


def test_all_records_are_here():
    assert set(ELEMENTS) == {"LINE3", "QUAD8", "QUAD9", "TRI3", "TRI6", "HEX20", "HEX27", "WEDGE18", "TET4", "TET10"}
    assert ELEMENTS["LINE3"] is LINE3


@EVERY_ELEMENT
def test_shape_functions_are_one_at_their_node_and_zero_at_the_others(element):
    assert element.shape(element.nodes)[0] == pytest.approx(np.eye(len(element.nodes)), abs=1e-14)


@EVERY_ELEMENT
def test_shape_functions_sum_to_one_and_give_back_the_coordinates(element):
    points = inner_points(element)
    values, slopes = element.shape(points)
    assert values.sum(axis=1) == pytest.approx(np.ones(len(points)), abs=1e-13)
    assert values @ element.nodes == pytest.approx(points, abs=1e-13)
    identity = np.tile(np.eye(points.shape[1]), (len(points), 1, 1))
    assert np.einsum("nmi,mj->nji", slopes, element.nodes) == pytest.approx(identity, abs=1e-12)


@EVERY_ELEMENT
def test_derivatives_agree_with_finite_differences(element):
    """Central differences, exact for quadratic functions but for rounding over the step and the third power in HEX20."""
    points, step = inner_points(element), 1e-6
    for axis in range(points.shape[1]):
        shift = step * np.eye(points.shape[1])[axis]
        slope = (element.shape(points + shift)[0] - element.shape(points - shift)[0]) / (2 * step)
        assert element.shape(points)[1][..., axis] == pytest.approx(slope, abs=1e-9)


@EVERY_ELEMENT
def test_quadrature_integrates_all_polynomials_of_its_degree(element):
    for reduced in [False, True]:
        rule = element.reduced if reduced else element.quadrature
        if rule is None:
            return
        dimension = element.nodes.shape[1]
        for powers in product(range(rule.degree + 1), repeat=dimension):
            if sum(powers) <= rule.degree:
                assert rule.weights @ np.prod(rule.points**powers, axis=1) == pytest.approx(integral(element, powers), abs=1e-14)
        over = (2 * ((rule.degree + 2) // 2), *[0] * (dimension - 1))     # even: odd powers vanish on [-1, 1] for every rule
        assert rule.weights @ np.prod(rule.points**over, axis=1) != pytest.approx(integral(element, over), abs=1e-6), reduced


def test_lobattos_rule_has_the_corners_and_integrates_polynomials_of_the_third_degree_alone():
    rule = lobatto_rule(3)
    assert {tuple(node) for node in HEX20.nodes} <= {tuple(point) for point in rule.points} and len(rule.points) == 27
    for powers in product(range(4), repeat=3):
        assert rule.weights @ np.prod(rule.points**powers, axis=1) == pytest.approx(integral(HEX20, powers), abs=1e-14)
    assert rule.weights @ rule.points[:, 0]**4 != pytest.approx(integral(HEX20, (4, 0, 0)), abs=1e-6)


@pytest.mark.parametrize("rule, points", [(lobatto_gauss_rule(3), 27 + 8), (densest_rule(3), 27 + 8 + 27)])
def test_simpsons_and_gausss_rules_together_integrate_two_degrees_more_than_simpsons(rule, points):
    assert len(rule.points) == points and (rule.weights > 0).all() and (np.abs(rule.points) == 1.0).all(axis=1).sum() == 8
    for powers in product(range(6), repeat=3):
        if sum(powers) <= rule.degree == 5:
            assert rule.weights @ np.prod(rule.points**powers, axis=1) == pytest.approx(integral(HEX20, powers), abs=1e-14)
    assert rule.weights @ rule.points[:, 0]**6 != pytest.approx(integral(HEX20, (6, 0, 0)), abs=1e-6)


def test_the_wedges_quadrature_integrates_the_square_of_its_quadratic_functions():
    points, weights, _ = WEDGE18.quadrature
    r, s, t = points.T
    # integral of r^2 s^2 over the triangle is 4/6! = 1/180, of t^4 over [-1, 1] 2/5
    assert weights @ (r**2 * s**2 * t**4) == pytest.approx(2 / 5 / 180, rel=1e-10)


@EVERY_ELEMENT
def test_a_faces_nodes_lie_on_it_in_the_order_of_the_faces_own_element(element):
    """A face is where one function that is linear on the parent element vanishes; its nodes are its element's, mapped linearly."""
    for face in element.faces:
        own, parent = element.nodes[face.nodes], face.element.nodes
        plane = np.column_stack([parent, np.ones(len(parent))])
        mapped = plane @ np.linalg.lstsq(plane, own, rcond=None)[0]
        assert mapped == pytest.approx(own, abs=1e-14)
        across = np.linalg.svd(own - own.mean(axis=0))[2][-1]
        height = (element.nodes - own.mean(axis=0)) @ across
        assert height[face.nodes] == pytest.approx(0, abs=1e-14)
        others = np.delete(height, face.nodes)
        assert (others > 0.1).all() or (others < -0.1).all()     # all nodes that lie on the face are listed
    if element.faces:
        assert set(np.concatenate([face.nodes for face in element.faces])) == set(np.flatnonzero(on_boundary(element)))


def on_boundary(element):
    """Which nodes (m,) are not inside."""
    inside = (element.shape(np.array([element.nodes.mean(axis=0)]))[0][0] > 1 - 1e-12)
    return ~inside


@EVERY_SOLID
def test_faces_are_counter_clockwise_from_inside_at_the_bottom_and_from_outside_elsewhere(element):
    """So their normals add up to twice the bottom's: the flux of a constant field through a closed surface is zero."""
    flux, middle = [], element.nodes.mean(axis=0)
    for number, face in enumerate(element.faces):
        points, weights, _ = face.element.quadrature
        values, slopes = face.element.shape(points)
        own = element.nodes[face.nodes]
        normals = np.cross(*(np.einsum("gm,mi->gi", slopes[..., axis], own) for axis in (0, 1)))
        outward = np.einsum("gi,gi->g", normals, values @ own - middle)
        assert (outward < 0).all() if number == 0 else (outward > 0).all()
        flux.append(weights @ normals)
    assert sum(flux[1:]) - flux[0] == pytest.approx(np.zeros(3), abs=1e-12)


def test_bottom_top_and_sides_lie_where_their_names_say():
    for element in [HEX20, HEX27, WEDGE18]:
        height = element.nodes[:, 2]
        assert (height[element.bottom] == -1).all() and (height[element.top] == 1).all(), element
        base = element.faces[0].element
        ends = np.array([element.nodes[side, :2].mean(axis=0) for side in element.sides])
        assert ends == pytest.approx(np.array([base.nodes[side].mean(axis=0) for side in base.sides])), element
        if base.nodes.shape[0] > 6:
            # eta = -1, xi = 1, eta = 1, xi = -1
            assert np.sign(np.round(ends, 9)).tolist() == [[0, -1], [1, 0], [0, 1], [-1, 0]]


@EVERY_ELEMENT
def test_in_vtks_order_an_element_is_vtks_own_cell_with_vtks_own_shape_functions(element):
    """VTK counts parent coordinates from 0 to 1 where ours go from -1 to 1."""
    cell = vtkGenericCell()
    cell.SetCellType(meshio_to_vtk_type[element.meshio_name])
    assert cell.GetNumberOfPoints() == len(element.nodes)

    def vtk_coordinates(points):
        out = np.zeros((len(points), 3))
        out[:, :points.shape[1]] = points if element in SIMPLICES else 0.5 * (points + 1)
        if element in WEDGES:
            out[:, :2] = points[:, :2]
        return out

    nodes = np.reshape([cell.GetParametricCoords()[k] for k in range(3 * len(element.nodes))], (-1, 3))
    assert nodes == pytest.approx(vtk_coordinates(element.nodes[element.vtk_order]))
    points, weights = inner_points(element), np.zeros(len(element.nodes))
    for point, values in zip(vtk_coordinates(points), element.shape(points)[0], strict=True):
        cell.InterpolateFunctions(point.tolist(), weights)
        assert weights == pytest.approx(values[element.vtk_order], abs=1e-12)


@EVERY_SOLID
def test_in_a_decks_order_an_element_is_the_one_of_that_name(element):
    kept = element.nodes[element.abaqus_nodes]
    assert len(kept) == int(element.abaqus_name.removeprefix("C3D"))
    if element in (HEX20, HEX27):
        assert (kept == HEX20.nodes).all()
    if element is WEDGE18:     # corners of both triangles, then the mid-sides of bottom, top and uprights, as in C3D20
        bottom, top = kept[:3], kept[3:6]
        around = [1, 2, 0]
        mids = [0.5 * (bottom + bottom[around]), 0.5 * (top + top[around]), 0.5 * (bottom + top)]
        assert kept[6:] == pytest.approx(np.vstack(mids))


@EVERY_SOLID
def test_the_volume_of_a_sheared_element_is_that_of_the_parent_times_the_determinant(element):
    shear = np.array([[1.0, 0.3, 0.0], [0.0, 2.0, 0.4], [0.1, 0.0, 0.5]])
    points, weights, _ = element.quadrature
    gradients, volumes = reference_gradients((element.nodes @ shear.T)[None], element.shape(points)[1], weights)
    assert volumes.sum() == pytest.approx(np.linalg.det(shear) * integral(element, (0, 0, 0)))
    field = element.nodes @ shear.T @ np.array([1.0, -2.0, 3.0])
    assert np.einsum("egmi,m->egi", gradients, field) == pytest.approx(np.tile([1.0, -2.0, 3.0], (*volumes.shape, 1)))


def test_an_inverted_element_is_refused():
    points, weights, _ = HEX20.quadrature
    with pytest.raises(ValueError, match="element 1 is inverted"):
        reference_gradients(np.stack([HEX20.nodes, HEX20.nodes * [1, 1, -1]]), HEX20.shape(points)[1], weights)


def test_full_elements_contain_the_serendipity_ones_in_the_plane_too():
    assert (QUAD9.nodes[:8] == QUAD8.nodes).all()
    points = gauss(4, 2)[0]
    along_a_side = np.column_stack([points[:, 0], -np.ones(len(points))])
    assert QUAD9.shape(along_a_side)[0][:, :8] == pytest.approx(QUAD8.shape(along_a_side)[0], abs=1e-14)


def test_an_element_turned_inside_out_is_reported():
    block = HexBlock(HEX20.nodes[None].copy(), LAW)
    assert block.evaluate((-2.0 * HEX20.nodes * np.array([1, 0, 0]))[None]) is None


@EVERY_ELEMENT
def test_at_no_points_there_are_no_values(element):
    values, slopes = element.shape(np.zeros((0, element.nodes.shape[1])))
    assert values.shape == (0, len(element.nodes)) and slopes.shape == (0, *element.nodes.shape)
