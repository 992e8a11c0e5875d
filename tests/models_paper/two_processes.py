"""A training of the test network, to be started by `accelerate launch`."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.models_paper.test_loop import LOOP, LineTrainee, run

run(LineTrainee("adamw"), Path(sys.argv[1]), LOOP.model_copy(update={"micro_batch": 1}))
