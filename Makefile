# make help lists the targets. make demo and make test set up everything that they need.

VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.set-up
N ?= 100
# Of all packages that pyproject.toml names, something that they are needed for, but for mypy, which is slow.
LOWEST_TESTS := tests/benchmark/test_adapters.py tests/benchmark/test_burg_planner.py tests/core/test_hdf5.py tests/core/test_lazy.py tests/core/test_progress.py \
	tests/dataset/test_coco.py tests/dataset/test_shards.py tests/dataset/test_webdataset.py \
	tests/evaluation/test_cluster.py::test_jobs_are_judged_as_they_are_here \
	tests/evaluation/test_jobs.py tests/evaluation/test_table.py \
	tests/experiment/test_agreement.py::test_selected_trials_as_scikit_learn_has_them \
	tests/experiment/test_agreement.py::test_mcnemar_as_statsmodels_has_it \
	tests/export/test_mjcf.py tests/export/test_usd.py tests/formats/test_acronym.py tests/geometry/test_rays.py \
	tests/objects/test_decompose.py::test_a_corner_is_two_bars tests/objects/test_solids.py \
	tests/objects/test_stable_poses.py::test_probabilities_are_those_of_trimesh \
	tests/printout/test_board_printout.py::test_words_on_every_page \
	tests/cameras/test_detection.py tests/simulation/test_drake_quirks.py tests/station/test_hand.py \
	tests/test_documents.py::test_names_in_the_text_exist tests/test_documents.py::test_yaml_fits_its_schema \
	tests/test_packaging.py::test_every_module_can_be_imported tests/ui/test_incoming.py tests/ui/test_panels.py \
	"tests/test_typed_use.py::test_what_is_right_is_accepted_and_what_is_wrong_reported[pyright]"
EXAMPLES := $(sort $(wildcard examples/[0-9][0-9]_*.py))

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-all test-fast test-lowest lint rules format types spelling dockerfile examples docs docs-serve clean distclean
.DELETE_ON_ERROR:

help:  ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "  make %-10s %s\n", $$1, $$2}' Makefile
	@echo "  variables: PYTHON=python3.12 (interpreter of the set-up), N=100 (grasps per object of the demo)"

setup: $(STAMP)  ## create .venv with everything in it; system libraries too, where allowed

$(STAMP): pyproject.toml tools/setup/set_up.sh
	@LOWEST=$(LOWEST) tools/setup/set_up.sh $(VENV)
	@touch $@

demo: $(STAMP)  ## evaluate grasps on the built-in scene, replay the best one
	$(BIN)/burg-drake demo -n $(N)

test: $(STAMP)  ## build the wheel, install it, test the installed wheel (ARGS=... go to pytest)
	@tools/setup/test_wheel.sh $(VENV) -m "not thorough" $(ARGS)

test-all: $(STAMP)  ## as test, with what shows again what other tests show, for a release
	@tools/setup/test_wheel.sh $(VENV) $(ARGS)

test-fast: $(STAMP)  ## test the checkout, without physics, in a minute (ARGS=... go to pytest)
	$(BIN)/python -m pytest -m "not physics and not thorough" $(ARGS)

test-lowest:  ## a part of the tests with the oldest versions that pyproject.toml allows
	@$(MAKE) --no-print-directory setup VENV=$(VENV)-lowest LOWEST=1
	$(VENV)-lowest/bin/python -m pytest -m "not thorough" $(LOWEST_TESTS)

lint: rules format types spelling dockerfile  ## ruff, mypy, codespell and hadolint

rules: $(STAMP)
	$(BIN)/ruff check

format: $(STAMP)
	$(BIN)/ruff format --check

types: $(STAMP)
	$(BIN)/mypy

spelling: $(STAMP)
	$(BIN)/codespell burg_drake docs examples tools .github *.md *.cff Makefile Dockerfile

dockerfile: $(STAMP)
	$(BIN)/hadolint Dockerfile

docs: $(STAMP)  ## build the documentation into build/docs
	$(BIN)/python -m tools.site

docs-serve: docs  ## build the documentation and show it on http://127.0.0.1:8000
	$(BIN)/python -m http.server --directory build/docs --bind 127.0.0.1 8000

examples: $(STAMP)  ## run every example without a window
	@tools/setup/run_examples.sh $(BIN)/python $(EXAMPLES)

clean:  ## remove what builds and tests leave behind (not .venv, not runs)
	rm -rf build dist $(VENV)-wheel .pytest_cache .mypy_cache .ruff_cache
	find . -path './.venv*' -prune -o -name __pycache__ -type d -prune -exec rm -rf {} +

distclean: clean  ## remove the virtual environments as well
	rm -rf .venv*
