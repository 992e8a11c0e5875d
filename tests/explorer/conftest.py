"""The photo that the explorer's tests share."""

import pytest
from explorer_photo import Photo, make_photo


@pytest.fixture(scope="session")
def photo() -> Photo:
    return make_photo(96, 128, 2)
