# `make run` and `make test` set everything up by themselves; the second time they start at once.
.PHONY: setup run test lint lock weights clean

BIN := .venv/bin
READY := .venv/.ready

setup: $(READY)

$(READY): requirements.txt requirements-nodeps.txt pyproject.toml .ci/setup
	sh .ci/setup

run: $(READY)
	. .ci/environment && $(BIN)/lux run

test: $(READY) lint
	. .ci/environment && $(BIN)/pytest -n 2 --dist loadfile -m "not slow"

# Make the shipped weights anew (hours): rooms, then each network from those before it.
WEIGHTS_DIR ?= weights-build
weights: $(READY)
	. .ci/environment && sh luxcore/models/small/recipe.sh $(WEIGHTS_DIR)

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# Resolve requirements.in to exact versions of everything.
lock: $(READY)
	. .ci/environment && $(BIN)/uv pip compile -q requirements.in -o requirements.txt --python-version 3.11 --no-header --no-annotate

clean:
	rm -rf artifacts reports .lux mlflow.db mlruns mlartifacts
