# `make`: the default study.  `make tiny`: the smallest study.  `make docs`: the documentation.
# `make skin`, `make grasps`, `make probe`: a robot skin, grasps by a robot, a palpation sensor.  `make studies`: the smallest of all studies.
# `make test`: the tests, in minutes.  `make test-slow`: those that take longer, CalculiX's and whole runs of the workflow among them.
# `make results`: the results page in docs/, from a finished run of the default study.
# `make numbers`: the measured numbers in docs/, from benchmarks/results/ and a count of the tests.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
BIN := .venv/bin
SNAKEMAKE = $(BIN)/snakemake --cores all

.PHONY: study tiny studies skin tiny-skin probe tiny-probe grasps tiny-grasps test test-slow lint advice bench docs numbers results clean

study: .venv/installed
	$(SNAKEMAKE)
	@echo "Open results/default/report.html"

tiny: .venv/installed
	$(SNAKEMAKE) --configfile config/tiny.yaml
	@echo "Open results/tiny/report.html"

skin: .venv/installed
	$(BIN)/softtact skin config/skin.yaml --out results/skin

tiny-skin: .venv/installed
	$(BIN)/softtact skin config/tiny_skin.yaml --out results/tiny_skin

# Grasps by a robot: hours of presses at 50 N, which go on where they were interrupted.
grasps tiny-grasps: .venv/installed
	$(BIN)/softtact grasps config/$(subst -,_,$@).yaml

# The palpation sensor of the fourth paper.
probe tiny-probe: .venv/installed
	$(BIN)/softtact palpate config/$(subst -,_,$@).yaml --out results/$(subst -,_,$@)
	@echo "Open results/$(subst -,_,$@)/report.html"

studies: tiny tiny-skin tiny-grasps tiny-probe

# Two processes with one thread each: two threads in one process take nearly as long as one.
test test-slow: export OMP_NUM_THREADS = 1
test test-slow: export MKL_NUM_THREADS = 1
test test-slow: export OPENBLAS_NUM_THREADS = 1
PYTEST = $(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder
test: .venv/tested
	$(PYTEST) -m 'not gold and not slow' --durations 25 --durations-min 5

test-slow: .venv/tested
	$(PYTEST) -m 'slow and not gold'

bench: .venv/installed
	for benchmark in fast_models press scaling mesh_error edges against_calculix discretisation unknowns materials discs glass_mesh glass_edge \
		virtual_sensor published_archive; do $(BIN)/python benchmarks/$$benchmark.py || exit 1; done

lint: .venv/tested
	$(BIN)/ruff check .
	$(BIN)/mypy

# Advice on the workflow. It always asks for a conda environment for each rule, which this project has none of, and so fails.
advice: .venv/tested
	$(BIN)/snakemake --lint

# The workflow finds its own interpreter; the environment need not be activated.
.venv/installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[workflow,learn,view,optics,mesh,excel,skin,robot,mkl]'
	touch $@

.venv/tested: .venv/installed
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[all,test,docs]'
	touch $@

# The documentation as a site, from docs/ into site/; a warning of Sphinx is an error.
docs: numbers
	$(BIN)/python scripts/write_results.py --check
	$(BIN)/python -m sphinx -W --keep-going -q -b html -d site/.doctrees docs site
	@echo "Open site/index.html"

numbers: .venv/tested
	$(BIN)/python scripts/write_numbers.py

# The page docs/results.md from a finished run of the default study.
results: .venv/installed
	$(BIN)/python scripts/write_results.py results/default

clean:
	rm -rf results/*/ .snakemake
