"""What the renderer switches on and off, and that the reason is the room's."""

from __future__ import annotations

from dataclasses import replace

import pytest

from luxcore.render.effects import DIFFUSE_BOUNCES, LIGHT_TREE_FROM, analyse_effects
from luxcore.rooms import Material, Part, Room, generate_room
from luxcore.rooms.shapes import Box
from luxcore.settings.rooms import RoomsSettings


@pytest.fixture(scope="module")
def plain() -> Room:
    """A room with an opening in which all is matt: no glass, mirrors, panes, metal, varnish."""
    room = next(r for r in (generate_room(s, RoomsSettings()) for s in range(50)) if r.openings)
    calm = Material("paint", (0.5, 0.5, 0.5))
    return replace(room, materials=dict.fromkeys(room.materials, calm))


def _with(room: Room, material: Material) -> Room:
    part = Part("thing", Box((0.1, 0.1, 0.1)), "thing", (1.0, 1.0, 1.0))
    return replace(room, materials={**room.materials, "thing": material}, parts=(*room.parts, part))


def test_environment_and_portals_need_an_opening(plain: Room) -> None:
    assert analyse_effects(plain).environment.on
    assert analyse_effects(plain).portals.amount == len(plain.openings)
    closed = analyse_effects(replace(plain, openings=(), environment=None))
    assert not closed.environment.on
    assert not closed.portals.on
    assert "no opening" in closed.environment.reason


def test_transmission_needs_glass(plain: Room) -> None:
    assert not analyse_effects(plain).transmission.on
    glass = analyse_effects(_with(plain, Material("glass", (0.9, 0.9, 0.9))))
    assert glass.transmission.amount >= 4
    assert glass.caustics.on
    # A flat pane lets light straight through: it refracts nothing.
    pane = analyse_effects(_with(plain, Material("pane", (0.9, 0.9, 0.9))))
    assert not pane.transmission.on
    assert pane.transparent.on


def test_caustics_and_glossy_bounces_need_something_sharp(plain: Room) -> None:
    calm = analyse_effects(plain)
    mirror = analyse_effects(_with(plain, Material("mirror", (0.9, 0.9, 0.9))))
    rough = analyse_effects(_with(plain, Material("metal", (0.6, 0.6, 0.6), roughness=0.4)))
    assert not calm.caustics.on
    # Rough metal inside a hood passes 2 to 4 % of a room's light on.
    assert rough.caustics.on
    assert mirror.caustics.on
    assert rough.glossy.amount == calm.glossy.amount
    assert mirror.glossy.amount > calm.glossy.amount


def test_light_tree_only_with_many_emitters(plain: Room) -> None:
    dark = tuple(p for p in plain.parts if p.emits == 0)
    few = replace(plain, parts=dark, spots=(), openings=(), environment=None)
    assert not analyse_effects(few).light_tree.on
    bulb = Part("bulb", Box((0.1, 0.1, 0.1)), "wall", lamp=0, emits=0.01)
    many = replace(few, parts=(*few.parts, *[bulb] * LIGHT_TREE_FROM))
    assert analyse_effects(many).light_tree.on


def test_diffuse_bounces_never_fall_below_eight() -> None:
    for seed in range(5):
        effects = analyse_effects(generate_room(seed, RoomsSettings()))
        assert effects.diffuse.amount >= DIFFUSE_BOUNCES == 8


def test_every_decision_has_a_reason(plain: Room) -> None:
    for name, entry in analyse_effects(plain).to_json().items():
        assert entry["reason"], name
