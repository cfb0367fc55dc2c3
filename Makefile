# snakegen: `make demo` shows it, `make test` proves it. Everything happens in .venv.

VENV     := .venv
BIN      := $(VENV)/bin
OUT      := out/demo
PRESETS  := $(notdir $(basename $(wildcard templates/presets/*.yaml)))
EXAMPLES ?= 300
KILLS    ?= 50
# Whole files go to two workers, in the order of tests/conftest.py: the longest first.
SPREAD   := -n 2 --dist loadfile --no-loadscope-reorder

# The first interpreter that runs and is new enough; PYTHON=/path/to/python3.12 overrides.
NEW_ENOUGH := import sys; sys.exit(sys.version_info < (3, 11))
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3; do \
	$$p -c "$(NEW_ENOUGH)" 2>/dev/null && echo $$p && break; done)

.DEFAULT_GOAL := help
.PHONY: help plans demo test quick interpreted processors check format generated docs bench studies stress robots speed fuzz wheel clean

help: ## list the targets
	@grep -E '^[a-z]+:.*##' $(firstword $(MAKEFILE_LIST)) | sed -E 's/:.*## /\t/' | expand -t 12

$(VENV)/bin/pip:
	@test -n "$(PYTHON)" || { echo "Error: no Python 3.11 or newer found; say where: make demo PYTHON=/path/to/python3.11" >&2; exit 1; }
	@"$(PYTHON)" -c "$(NEW_ENOUGH)" 2>/dev/null || { echo "Error: $(PYTHON) is not Python 3.11 or newer." >&2; exit 1; }
	@"$(PYTHON)" -m venv $(VENV) || { echo "Error: $(PYTHON) cannot make environments; install its venv module." >&2; rm -rf $(VENV); exit 1; }

# Stamps: the environment is touched again only when pyproject.toml changes.
$(VENV)/runtime.stamp: pyproject.toml | $(VENV)/bin/pip
	@echo "installing snakegen into $(VENV), once" >&2
	@$(BIN)/pip install -qq --disable-pip-version-check -e .
	@touch $@

$(VENV)/dev.stamp: pyproject.toml | $(VENV)/bin/pip
	@echo "installing snakegen and its development tools into $(VENV), once" >&2
	@$(BIN)/pip install -qq --disable-pip-version-check -e '.[dev]'
	@touch $@ $(VENV)/runtime.stamp

$(VENV)/bench.stamp: $(VENV)/dev.stamp
	@echo "installing what the benchmarks compare with, once" >&2
	@$(BIN)/pip install -qq --disable-pip-version-check -e '.[bench]'
	@touch $@

demo: $(VENV)/runtime.stamp ## build dragon4, analyse it, fly it; ends with the verdict
	$(BIN)/snakegen demo -o $(OUT)

$(VENV)/docs.stamp: $(VENV)/dev.stamp
	@echo "installing what the documentation is built with, once" >&2
	@$(BIN)/pip install -qq --disable-pip-version-check -e '.[docs]'
	@touch $@

# The kernels that most tests share are compiled first, each once, not by both workers at a time.
test: $(VENV)/dev.stamp ## run the tests
	@mkdir -p $(OUT); echo "compiling what kernels are not in the cache" >&2
	@{ $(BIN)/snakegen analyze flight dragon4 --mission push --option slow=1 -o $(OUT)/kernels.rrd & \
		$(BIN)/snakegen analyze sweep dragon4 --samples 50 -o $(OUT)/kernels.parquet; \
		for r in arm6 screw4; do $(BIN)/snakegen analyze $$r --json; done; wait; } > $(OUT)/kernels.txt 2>&1 || true
	$(BIN)/python -m pytest $(SPREAD) -m "not slow"

quick: $(VENV)/dev.stamp ## run the tests that fly no whole mission
	$(BIN)/python -m pytest $(SPREAD) -m "not slow and not flight"

# What is the same on every processor (docs/architecture.md), tried with the BLAS kernels of an old one
# and with kernels compiled for a generic one, which takes minutes the first time.
NUMERICAL := tests/test_generated.py tests/test_rounding.py tests/test_rank_table.py \
	tests/test_control_poles.py tests/test_statics_law.py tests/test_reach.py \
	tests/test_wrench_margin.py tests/test_wrench_margin_vectored.py

# Kernels as the Python that they are: an index beyond its array, which compiled code reads past.
INTERPRETED := tests/test_plain_twins.py tests/test_margin_kernels.py tests/test_wrench_map.py \
	tests/test_chain.py

interpreted: $(VENV)/dev.stamp ## run the kernels' tests without compiling
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest -q -n 2 --dist loadgroup $(INTERPRETED)

processors: interpreted ## run numerical tests as two other processors would
	OPENBLAS_CORETYPE=Nehalem NPY_DISABLE_CPU_FEATURES="$(NEWER)" \
		$(BIN)/python -m pytest -q $(SPREAD) -m "not slow" $(NUMERICAL)
	NUMBA_CPU_NAME=generic NUMBA_CPU_FEATURES= \
		$(BIN)/python -m pytest -q -n 2 --dist load -m "not slow" tests/test_generated.py

# What numpy may use of this processor that an old one has not.
NEWER = $(shell $(BIN)/python -c "from numpy._core import _multiarray_umath as m; \
	print(' '.join(n for n in m.__cpu_dispatch__ if m.__cpu_features__.get(n)))")

check: $(VENV)/dev.stamp ## formatting, lint and types
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

format: $(VENV)/dev.stamp ## let ruff format the sources
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

generated: $(PRESETS:%=generated/%) ## rebuild the committed folder of every preset

.PHONY: $(PRESETS:%=generated/%)
$(PRESETS:%=generated/%): generated/%: $(VENV)/runtime.stamp
	$(BIN)/snakegen build $* -o $@
	$(BIN)/snakegen analyze $@/$*.urdf $(addprefix --posture ,$(wildcard templates/presets/postures/$*.yaml)) \
		--report $@/report.md --json > $@/report.json.part
	mv $@/report.json.part $@/report.json

plans: $(VENV)/dev.stamp ## plan, check and fly 100 random scenes
	$(BIN)/python benchmarks/plans.py

bench: $(VENV)/bench.stamp ## run the benchmarks, each against its rival
	@for file in $(filter-out benchmarks/readme.py benchmarks/stress.py benchmarks/plans.py benchmarks/public_robots.py,$(wildcard benchmarks/*.py)); do \
		echo "== $$file"; $(BIN)/python $$file || exit 1; done

# Both design studies, with the proof of the first and flights of the chosen designs.
studies: $(VENV)/runtime.stamp ## search the design studies again, prove and fly what they choose
	$(BIN)/snakegen design templates/studies/placement.yaml -o out/studies/placement --fly
	$(BIN)/snakegen design templates/studies/failure.yaml -o out/studies/failure --fly

stress: $(VENV)/dev.stamp ## kills, full disks, damage and Ctrl-C: KILLS cases each (50)
	$(BIN)/python -m pytest -m slow tests/test_sweep_storage.py tests/test_journal.py
	$(BIN)/python benchmarks/stress.py --kills $(KILLS)

docs: $(VENV)/docs.stamp ## build the documentation into out/site and run every command it shows
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	$(BIN)/python -m pytest -n 2 -m slow tests/test_docs.py
	@echo "read it: out/site/index.html, in a browser"

# The packages hold 280 MB of models; ROBOTS keeps them, else they go to a temporary folder.
ROBOTS ?=
robots: $(VENV)/dev.stamp ## public URDFs: loaded, against RNEA, converted, compared
	$(BIN)/python benchmarks/public_robots.py $(addprefix --folder ,$(ROBOTS))

speed: $(VENV)/bench.stamp ## measure the table of speeds and put it into docs/speed.md
	$(BIN)/python benchmarks/readme.py

fuzz: $(VENV)/dev.stamp ## 2,000 broken URDFs, specs and modules; EXAMPLES cases of other properties (300)
	SNAKEGEN_EXAMPLES=2000 $(BIN)/python -m pytest -n 2 --dist load $(STRANGE)
	SNAKEGEN_EXAMPLES=$(EXAMPLES) $(BIN)/python -m pytest -n 2 -k "random or fuzz or hypothesis" --ignore $(STRANGE)

STRANGE := tests/test_fuzz_foreign.py

wheel: $(VENV)/dev.stamp ## build the wheel into dist/
	rm -rf dist
	$(BIN)/pip wheel -qq --disable-pip-version-check --no-deps -w dist .

clean: ## remove everything that can be made again, .venv too
	rm -rf $(VENV) out dist build .pytest_cache .mypy_cache .ruff_cache .hypothesis
