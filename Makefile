# The commands of the README: `make demo`, `make test` and `make quick`. All do all set-up.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
# Without a display, SDL must not look for one.
export SDL_VIDEODRIVER ?= dummy
export PYGAME_HIDE_SUPPORT_PROMPT := 1
# Python keeps what it has compiled, whatever the shell says: the tests start many processes.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test suite test-browser matrix quick docs site shown lint types compiled check setup \
	clean

demo: $(STAMP)
	$(BIN)/python scripts/demo.py

# Types are checked beside everything else: they keep one core busy for a minute.
test: $(STAMP)
	$(MAKE) --jobs 2 types suite

suite: lint
	$(MAKE) compiled
	$(MAKE) check

# What a change of the model most often breaks. Neither types, nor agents, commands and studies.
QUICK := envs evaluation io/export layout particles site test_golden.py test_simulation.py
quick: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/pytest --numprocesses auto --dist worksteal -m "not slow" $(QUICK:%=tests/%)

# The page in a real browser, headless; needs chromium and chromium-driver. Screenshots: out/app/.
test-browser: compiled
	$(BIN)/pytest tests/app/browser

# The tests of `make quick` with other Pythons, which uv gets, and with the oldest libraries that
# pyproject.toml allows; torch stays as it is, because each of its versions is gigabytes. Without
# agents: MATRIX_EXTRAS=app,cluster,report MATRIX_TESTS="tests/particles".
MATRIX := 3.11 3.12 3.13 lowest
MATRIX_EXTRAS ?= all
MATRIX_TESTS ?= $(QUICK:%=tests/%)
MATRIX_TOOLS := pytest hypothesis pytest-xdist imageio openpyxl pypdfium2
MATRIX_PYTHON = out/matrix/$*/bin/python
# The same tests, and those of what is learnt or compiled, with other roundings: vector instructions
# of torch, Numba's target without FMA, other kernels of the BLAS, glibc's functions without FMA,
# and other numbers of threads. tests/digests.py says what a digest depends on.
ROUNDING := default avx2 avx512 generic kernels no-fma one-thread four-threads
ROUNDING_TESTS ?= $(MATRIX_TESTS) $(addprefix tests/,agents design gas response studies test_gas.py)
# The doors to agents, each with the extra that it needs; they cannot be installed together. Their
# extras bound them, and not constraints.txt, whose versions OpenEnv's packages do not all take.
DOORS := mcp openenv
matrix: $(MATRIX:%=matrix-%) $(ROUNDING:%=matrix-%) $(DOORS:%=matrix-%)

matrix-default matrix-avx2 matrix-avx512: export ATEN_CPU_CAPABILITY = $(@:matrix-%=%)
matrix-generic: export NUMBA_CPU_NAME := generic
matrix-generic: export NUMBA_CPU_FEATURES :=
matrix-generic: export NUMBA_CACHE_DIR := $(abspath out/matrix/generic)
matrix-kernels: export OPENBLAS_CORETYPE := Prescott
matrix-kernels: export MKL_CBWR := COMPATIBLE
matrix-no-fma: export GLIBC_TUNABLES := glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable
matrix-one-thread: THREADS := 1
matrix-four-threads: THREADS := 4
matrix-one-thread matrix-four-threads: export OMP_NUM_THREADS = $(THREADS)
matrix-one-thread matrix-four-threads: export MKL_NUM_THREADS = $(THREADS)
matrix-one-thread matrix-four-threads: export OPENBLAS_NUM_THREADS = $(THREADS)
matrix-one-thread matrix-four-threads: export NUMBA_NUM_THREADS = $(THREADS)
$(ROUNDING:%=matrix-%): matrix-%: $(STAMP)
	$(BIN)/pytest --numprocesses auto --dist worksteal -rs $(ROUNDING_TESTS)

$(DOORS:%=matrix-%): matrix-%: $(VENV)/.uv
	mkdir -p out/matrix
	$(BIN)/uv venv --quiet --clear --python $(PYTHON) out/matrix/$*
	$(BIN)/uv pip install --quiet --python $(MATRIX_PYTHON) -e ".[$*,render]"
	$(BIN)/uv pip install --quiet --python $(MATRIX_PYTHON) $(MATRIX_TOOLS)
	$(MATRIX_PYTHON) -m pytest --numprocesses auto -rs tests/tools

# verifiers requires another mcp than the door by OpenEnv, which it plays from an environment of its
# own; uv is what it prepares its harness with.
matrix: matrix-verifiers
matrix-verifiers: export BLAST_ENV_VF_EVAL = $(abspath out/matrix/verifiers-client/bin/vf-eval)
matrix-verifiers: export PATH := $(abspath $(BIN)):$(PATH)
matrix-verifiers: $(VENV)/.uv
	mkdir -p out/matrix
	$(BIN)/uv venv --quiet --clear --python $(PYTHON) out/matrix/verifiers-client
	$(BIN)/uv pip install --quiet --python out/matrix/verifiers-client/bin/python \
		"verifiers[openenv]==0.4.0"
	$(BIN)/uv venv --quiet --clear --python $(PYTHON) out/matrix/verifiers
	$(BIN)/uv pip install --quiet --python out/matrix/verifiers/bin/python -e ".[openenv,render]"
	$(BIN)/uv pip install --quiet --python out/matrix/verifiers/bin/python $(MATRIX_TOOLS)
	out/matrix/verifiers/bin/python -m pytest -rs tests/tools/test_verifiers.py

matrix-%: $(VENV)/.uv
	mkdir -p out/matrix
	grep '^torch==' constraints.txt > out/matrix/torch.txt
	$(BIN)/uv venv --quiet --clear --python $(if $(filter lowest,$*),3.11,$*) out/matrix/$*
	$(BIN)/uv pip install --quiet --python $(MATRIX_PYTHON) -e ".[$(MATRIX_EXTRAS)]" \
		$(if $(filter lowest,$*),--resolution lowest-direct --override out/matrix/torch.txt,-c constraints.txt)
	$(BIN)/uv pip install --quiet --python $(MATRIX_PYTHON) $(MATRIX_TOOLS)
	$(MATRIX_PYTHON) -m pytest --numprocesses auto --dist worksteal -m "not slow" \
		$(if $(filter lowest,$*),-W ignore::DeprecationWarning) $(MATRIX_TESTS)

# Tests of what needs a large package that nothing else needs, in a copy of the environment.
matrix: matrix-minari
matrix-minari: $(STAMP) $(VENV)/.uv
	mkdir -p out/matrix
	$(BIN)/uv venv --quiet --clear --system-site-packages --python $(BIN)/python out/matrix/minari
	$(BIN)/uv pip install --quiet --python out/matrix/minari/bin/python -e ".[all,datasets,dev]" \
		-c constraints.txt
	out/matrix/minari/bin/python -m pytest -rs tests/studies/test_offline_data.py \
		tests/studies/test_data_card.py

$(VENV)/.uv: $(STAMP)
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt uv
	touch $@

# The site, and everything that it shows: code and commands, each page in a folder of its own.
docs: $(VENV)/.docs
	$(MAKE) --jobs 2 site shown

# out/docs/html/index.html. Warnings are errors; notebooks run when they have changed.
site: $(VENV)/.docs
	PATH="$(abspath $(BIN)):$$PATH" $(BIN)/python -m sphinx --fail-on-warning --keep-going \
		-b html -d out/docs/cache docs out/docs/html

# What does not run just as it stands is in tests/documentation/exceptions.py.
shown: $(STAMP)
	$(BIN)/python -m tests.documentation.run

$(VENV)/.docs: $(STAMP)
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[docs]"
	touch $@

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports

types: $(STAMP)
	$(BIN)/mypy

compiled: $(STAMP)
	$(BIN)/python -m tests.compile_engines

# The tests, and a table of the lines and branches that they reach of each room; too few branches
# are a failure. Which branches are reached depends a little on the processor: hence a point less
# than what was found.
LEAST_BRANCHES := 90.4
check: $(STAMP)
	$(BIN)/python -m tests.coverage --least $(LEAST_BRANCHES) --numprocesses auto --dist worksteal

setup: $(STAMP)

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[all,dev]"
	touch $(STAMP)

clean:
	rm -rf $(VENV) out dist .mypy_cache .pytest_cache .ruff_cache
