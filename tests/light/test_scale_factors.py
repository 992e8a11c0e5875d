"""Scale factors: exact on clean light, and defined where the naive solution is not."""

import numpy as np

from luxcore.light.scale_factors import solve


def lights(count: int = 3, seed: int = 0, size: int = 32) -> np.ndarray:
    """Lamps at different places: 1/r² falloff with texture. [k, h, w, 3]"""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:size, :size] / size
    texture = rng.uniform(0.3, 0.7, (size, size, 3))
    places = rng.uniform(0, 1, (count, 2))
    falloff = [1 / (0.02 + (x - a) ** 2 + (y - b) ** 2) for a, b in places]
    return np.stack([f[..., None] * texture * 0.05 for f in falloff]).astype(np.float32)


def composed(olats: np.ndarray, scale: np.ndarray, ambient: np.ndarray) -> np.ndarray:
    return (ambient + np.einsum("kc,khwc->hwc", scale, olats)).astype(np.float32)


AMBIENT = np.full((32, 32, 3), 0.05, np.float32)
SCALE = np.array([[1.0, 0.8, 0.5], [0.0, 0.0, 0.0], [2.0, 2.1, 2.2]])


def test_exact_on_clean_light():
    found = solve(composed(lights(), SCALE, AMBIENT), AMBIENT, lights())
    assert np.allclose(found, SCALE, atol=2e-3)


def test_relative_weights_withstand_errors_of_the_lights():
    rng = np.random.default_rng(1)
    olats, photo = lights(), composed(lights(), SCALE, AMBIENT)
    noisy = olats * rng.lognormal(0, 0.15, olats.shape).astype(np.float32)
    found = solve(photo, AMBIENT, noisy)
    # 6.5 % of error at 15 % of noise was measured; plain least squares makes 15 to 25 %.
    assert np.abs(found - SCALE)[[0, 2]].max() < 0.1 * 2.2


def test_clipped_and_black_pixels_do_not_count():
    photo = composed(lights(), SCALE, AMBIENT)
    photo[:4] = 16.3
    photo[4:6] = 1e-5
    assert np.allclose(solve(photo, AMBIENT, lights()), SCALE, atol=5e-3)


def test_nan_pixels_do_not_count():
    photo, olats = composed(lights(), SCALE, AMBIENT), lights()
    photo[3, 3] = np.nan
    olats[1, 5, 5] = np.inf
    assert np.allclose(solve(photo, AMBIENT, olats), SCALE, atol=5e-3)


def test_collinear_lights_share():
    olats = lights(1)
    twice = np.concatenate([olats, olats])
    photo = composed(olats, np.array([[1.0, 1.0, 1.0]]), AMBIENT)
    found = solve(photo, AMBIENT, twice)
    assert np.allclose(found.sum(0), 1, atol=2e-3)
    assert np.allclose(found[0], found[1], atol=0.05)


def test_a_light_that_adds_nothing_and_one_that_would_subtract():
    olats = lights()
    olats[1] = 0
    found = solve(composed(olats, SCALE, AMBIENT), AMBIENT, olats)
    assert (found[1] == 0).all()
    darker = composed(lights(), SCALE * 0, AMBIENT * 0.5)
    assert (solve(darker, AMBIENT, lights()) == 0).all()


def test_more_lights_than_pixels():
    olats = lights(6, size=2)
    ambient = np.zeros((2, 2, 3), np.float32)
    photo = composed(olats, np.ones((6, 3)), ambient)
    found = solve(photo, ambient, olats)
    assert np.isfinite(found).all()
    assert np.allclose(composed(olats, found, ambient), photo, rtol=2e-2)


def test_no_lights_and_no_usable_pixel():
    assert solve(AMBIENT, AMBIENT, np.zeros((0, 32, 32, 3), np.float32)).shape == (0, 3)
    photo = composed(lights(), SCALE, AMBIENT)
    nothing = np.zeros((32, 32), bool)
    assert (solve(photo, AMBIENT, lights(), usable=nothing) == 0).all()
