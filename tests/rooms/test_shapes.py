"""Solids: closed, wound outward, of the size they say; rotations as Blender reads them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from luxcore.rooms.piece import part, placed
from luxcore.rooms.shapes import (
    Box,
    Drape,
    Ellipsoid,
    Lathe,
    Mesh,
    Prism,
    cylinder,
    disc,
    rotation_matrix,
)


def signed_volume(mesh: Mesh) -> float:
    """Divergence theorem over fans of triangles: positive when faces wind outward."""
    total = 0.0
    for face in mesh.faces:
        corners = mesh.vertices[list(face)]
        for k in range(1, len(face) - 1):
            total += float(corners[0] @ np.cross(corners[k], corners[k + 1])) / 6
    return total


@pytest.mark.parametrize(
    ("shape", "volume"),
    [
        (Box((1.0, 2.0, 3.0), (5.0, -1.0, 0.5)), 6.0),
        (Prism(((0.0, 0.0), (2.0, 0.0), (2.0, 1.0)), 3.0), 3.0),
        # An n-gon instead of a circle, exactly.
        (cylinder(0.5, 2.0, segments=24), 2.0 * 0.5 * 24 * 0.25 * math.sin(2 * math.pi / 24)),
    ],
)
def test_solids_enclose_their_volume(shape: Box | Prism | Lathe, volume: float) -> None:
    assert signed_volume(shape.mesh()) == pytest.approx(volume, rel=1e-9)


def test_bevel_cuts_corners_and_keeps_the_faces_outward() -> None:
    plain, cut = Box((1.0, 2.0, 3.0)), Box((1.0, 2.0, 3.0), bevel=0.1)
    # The twelve edges lose prisms of 0.1²/2 a metre, less what the eight corners share.
    lost = signed_volume(plain.mesh()) - signed_volume(cut.mesh())
    edges = 4 * (1 + 2 + 3)
    assert 0.8 * edges * 0.005 < lost < edges * 0.005
    assert cut.mesh().vertices.max(axis=0) == pytest.approx([0.5, 1.0, 1.5])


def test_ellipsoid_approaches_the_sphere() -> None:
    coarse, fine = (signed_volume(Ellipsoid((1.0, 1.0, 1.0), n).mesh()) for n in (12, 64))
    assert coarse < fine < 4 / 3 * math.pi
    assert fine == pytest.approx(4 / 3 * math.pi, rel=0.01)


def test_square_ellipsoid_fills_more_of_its_box() -> None:
    round_one = signed_volume(Ellipsoid((1.0, 1.0, 1.0), 32).mesh())
    cushion = signed_volume(Ellipsoid((1.0, 1.0, 1.0), 32, squareness=0.3).mesh())
    assert round_one < cushion < 8.0


@pytest.mark.parametrize("up", [True, False])
def test_disc_looks_where_it_should(up: bool) -> None:
    mesh = disc(0.3, 1.0, up=up).mesh()
    corners = mesh.vertices[list(mesh.faces[0])]
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    assert bool(normal[2] > 0) is up
    assert mesh.area_m2 == pytest.approx(math.pi * 0.09, rel=0.02)


def test_drape_hangs_in_its_rectangle() -> None:
    vertices = Drape(1.2, 2.0, 5, 0.08, gather=0.4).mesh().vertices
    assert vertices.min(axis=0) == pytest.approx([0, -0.04, 0], abs=0.005)
    assert vertices[:, 2].max() == 2.0
    assert vertices[:, 0].max() <= 1.2 + 1e-9


def test_rotation_is_about_x_then_y_then_z() -> None:
    turned = rotation_matrix((90.0, 0.0, 90.0)) @ np.array([0.0, 1.0, 0.0])
    # y goes to z about x; z then stays under the turn about z.
    assert turned == pytest.approx([0, 0, 1], abs=1e-12)
    matrix = rotation_matrix((10.0, -40.0, 200.0))
    assert matrix @ matrix.T == pytest.approx(np.eye(3), abs=1e-12)


def test_placing_turns_like_the_matrix() -> None:
    piece = part("p", Box((1.0, 1.0, 1.0)), "wood", (0.3, -0.2, 0.5), (20.0, 30.0, 40.0))
    (moved,) = placed((piece,), (1.0, 2.0, 0.0), 75.0)
    turn = rotation_matrix((0.0, 0.0, 75.0))
    assert moved.position == pytest.approx(turn @ piece.position + [1, 2, 0], abs=1e-4)
    assert rotation_matrix(moved.rotation_deg) == pytest.approx(
        turn @ rotation_matrix(piece.rotation_deg), abs=1e-6
    )
