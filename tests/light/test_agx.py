"""AgX against OpenColorIO's own output, its inverse, its hard cases, and its GLSL form."""

import csv
from pathlib import Path

import numpy as np
import pytest
import torch

from luxcore.light import agx_constants as k
from luxcore.light import agx_glsl
from luxcore.light.agx import agx, agx_inverse


@pytest.fixture(scope="module")
def golden(shared_data: Path) -> tuple[np.ndarray, np.ndarray]:
    with open(shared_data / "agx-golden" / "agx_base_srgb_golden.csv", encoding="utf-8") as stream:
        rows = [[float(v) for v in row[1:]] for row in list(csv.reader(stream))[1:]]
    table = np.array(rows)
    return table[:, :3], table[:, 3:]


def room_colours(count: int, seed: int = 0) -> np.ndarray:
    """Colours as rooms have them: over 13 stops, saturation up to a strong lamp's."""
    rng = np.random.default_rng(seed)
    return 2.0 ** rng.uniform(-7, 5, (count, 1)) * rng.uniform(0.25, 1.0, (count, 3))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_agrees_with_opencolorio(golden, dtype):
    linear, display = golden
    # 1/255 is the demand; a tenth of it leaves room for OpenColorIO's own float32 only.
    assert np.abs(agx(linear.astype(dtype)) - display).max() < 0.1 / 255


def test_numpy_and_torch_are_one():
    linear = room_colours(500)
    assert np.allclose(agx(torch.tensor(linear)).numpy(), agx(linear), atol=1e-12)
    display = agx(linear)
    display = display[(display > 0).all(1) & (display < 1 - 1e-5).all(1)]
    assert np.allclose(agx_inverse(torch.tensor(display)).numpy(), agx_inverse(display), rtol=1e-9)


@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 2e-8), (np.float32, 2e-3)])
def test_inverse_returns_the_radiance(dtype, tolerance):
    linear = room_colours(4000).astype(dtype)
    display = agx(linear)
    inside = (display < 1 - 1e-5).all(1) & (display > 0).all(1)
    assert inside.mean() > 0.9
    error = np.abs(agx_inverse(display) / linear - 1)[inside]
    assert error.max() < tolerance


def test_eight_bit_pictures_come_back_as_they_were():
    shown = np.round(agx(room_colours(4000, seed=1)) * 255) / 255
    again = agx(agx_inverse(shown))
    error = np.abs(again - shown).max(1)
    assert np.quantile(error, 0.99) < 1e-6


def test_ends_of_the_curve():
    black, white = agx_inverse(np.array([[0.0, 0, 0], [1.0, 1, 1]]))
    assert np.allclose(black, k.LINEAR_FLOOR, rtol=1e-3)
    assert np.allclose(white, k.LINEAR_CEILING, rtol=0.02)


@pytest.mark.parametrize("make", [np.array, torch.tensor])
def test_hard_values(make):
    rows = [[0, 0, 0], [1e-10] * 3, [1e6] * 3, [-1, -1, -1], [-0.1, 0.5, 0.2], [0, 0, 1e6]]
    shown = np.asarray(agx(make(np.array(rows, float))))
    assert np.isfinite(shown).all()
    assert (shown >= 0).all()
    assert (shown <= 1).all()
    assert np.allclose(shown[[0, 1, 3]], 0, atol=1e-9)
    assert np.allclose(shown[2], 1, atol=1e-9)
    # Out-of-gamut green stays green instead of losing the sign of a channel.
    assert shown[4].argmax() == 1


def test_infinite_is_white_and_nan_is_not_hidden():
    shown = agx(np.array([[np.inf, np.inf, np.inf], [np.nan, 1, 1]]))
    assert np.allclose(shown[0], 1)
    assert np.isnan(shown[1]).all()
    assert np.isnan(agx_inverse(np.array([[np.nan, 0.5, 0.5]]))).all()


def test_grey_rises_and_stays_grey():
    grey = np.repeat(2.0 ** np.linspace(-12, 6, 400)[:, None], 3, axis=1)
    shown = agx(grey)
    assert (np.diff(shown[:, 1]) >= 0).all()
    assert np.ptp(shown, axis=1).max() < 1e-4


def test_gradient_matches_finite_differences():
    linear = torch.tensor(room_colours(6, seed=2), requires_grad=True)
    assert torch.autograd.gradcheck(agx, (linear,), eps=1e-7, atol=1e-5)


@pytest.mark.parametrize("row", [[0.5, 0.5, 0.5], [0, 0, 0], [1e6, 1e6, 1e6], [-1, 0, 0.2]])
def test_gradient_is_finite_where_the_naive_formula_is_not(row):
    linear = torch.tensor([row], dtype=torch.float32, requires_grad=True)
    agx(linear).sum().backward()
    assert torch.isfinite(linear.grad).all()


def test_glsl_agrees_with_python():
    """Run as OpenCL C, which has the same built-in functions: no browser is needed."""
    cl = pytest.importorskip("pyopencl")
    try:
        context = cl.create_some_context(interactive=False)
    except cl.Error as error:
        pytest.skip(f"no OpenCL platform: {error}")
    body = agx_glsl.source().replace("vec3(", "(float3)(").replace("vec3", "float3")
    assert "@" not in body
    program = cl.Program(
        context,
        body
        + "__kernel void shown(__global const float *a, __global float *b) {"
        + " int i = get_global_id(0); vstore3(agx(vload3(i, a)), i, b); }",
    ).build(["-cl-single-precision-constant"])
    extreme = [[0, 0, 0], [1e6, 1e6, 1e6], [-1, 2, 0.1], [0, 0, 5], [1e-10, 0, 0]]
    linear = np.concatenate([room_colours(3000), extreme]).astype(np.float32)
    queue = cl.CommandQueue(context)
    flags = cl.mem_flags
    source = cl.Buffer(context, flags.READ_ONLY | flags.COPY_HOST_PTR, hostbuf=linear)
    target = cl.Buffer(context, flags.WRITE_ONLY, linear.nbytes)
    program.shown(queue, (len(linear),), None, source, target)
    shown = np.empty_like(linear)
    cl.enqueue_copy(queue, shown, target)
    assert np.abs(shown - agx(linear.astype(np.float64))).max() < 1e-4


def test_large_pictures_are_taken_in_blocks_to_the_same_bits(monkeypatch):
    rng = np.random.Generator(np.random.PCG64(5))
    linear = np.exp(rng.normal(-1, 2, (20, 30, 3))).astype(np.float32)
    linear[3, 4] = np.nan
    whole = agx(linear), agx_inverse(agx(linear))
    monkeypatch.setattr("luxcore.light.agx.BLOCK", 70)
    for first, second in zip(whole, (agx(linear), agx_inverse(agx(linear))), strict=True):
        np.testing.assert_array_equal(first, second)
        assert first.dtype == second.dtype == np.float32
