# `make`: the default study.  `make tiny`: its smallest form.  `make docs`: the documentation.
# `make skin`, `make grasps`, `make probe`: a robot skin, grasps by a robot, a palpation sensor; `make tiny-skin` and so on: their smallest forms.
# `make decide`: do the paper's claims hold? Ten hours of two cores.  `make markers`: images of a gel with a camera, within an hour.
# `make real`: gels with a camera against measured data, which docs/how-to/real_gels.md names.
# `make everything`: all default studies.  `make studies`: the smallest forms of all.  `make overview`: Snakemake's report of them.
# `make test`: the tests, in minutes.  `make test-slow`: those that take longer, CalculiX's and whole runs of the workflow among them.
# `make results`: the results pages in docs/, from the finished runs of default studies.
# `make release VERSION=0.2.0`: a release for review; it says what to type to upload it.
# `make numbers`: the measured numbers in docs/, from benchmarks/results/ and a count of the tests.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
BIN := .venv/bin
SNAKEMAKE = $(BIN)/snakemake --cores all

# Python keeps compiled modules: without them each job of a study compiles 1,600 files of its packages, 3 s of a core.
unexport PYTHONDONTWRITEBYTECODE

DEFAULT_STUDIES = config skin probe grasps decide markers real
TINY_STUDIES = tiny tiny-skin tiny-probe tiny-grasps tiny-decide tiny-markers tiny-real

.PHONY: study everything studies overview $(TINY_STUDIES) skin probe grasps decide markers real test test-slow lint advice bench docs gallery release numbers results clean

study: .venv/installed
	$(SNAKEMAKE)
	@echo "Open results/default/report.html"

# Snakemake looks for jobs every second in small studies; workflow/profiles/default says why less often in large ones.
$(TINY_STUDIES): SNAKEMAKE += --max-jobs-per-timespan 1000/1s
$(TINY_STUDIES) skin probe grasps decide markers real: .venv/installed
	$(SNAKEMAKE) --configfile config/$(subst -,_,$@).yaml
	@echo "Open results/$(subst -,_,$@)/report.html"

everything: study skin probe grasps decide markers real

studies: $(TINY_STUDIES)

# One page of Snakemake for each study that is finished: its figures and tables with the rules that made them.
overview: .venv/installed
	for name in $(DEFAULT_STUDIES) $(subst -,_,$(TINY_STUDIES)); do \
		folder=results/$$([ $$name = config ] && echo default || echo $$name); \
		[ ! -e $$folder/report.html ] || $(SNAKEMAKE) --configfile config/$$name.yaml --report $$folder/overview.zip || exit 1; done

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
	$(BIN)/snakefmt --check --compact-diff Snakefile workflow

# Advice on the workflow; what of it stays, and why, stands in workflow/README.md.
advice: .venv/tested
	-for name in tiny tiny_skin tiny_probe tiny_grasps tiny_decide tiny_markers tiny_real; do $(BIN)/snakemake --configfile config/$$name.yaml --lint; done
	@sed -n '/^## Advice/,/^## /p' workflow/README.md

# The workflow finds its own interpreter; the environment need not be activated.
.venv/installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --no-compile -c constraints.txt -e '.[workflow,learn,view,optics,mesh,excel,cad,skin,robot,mkl]'
	touch $@

.venv/tested: .venv/installed
	$(BIN)/python -m pip install --quiet --no-compile -c constraints.txt -e '.[all,test,docs]'
	touch $@

# The documentation as a site, from docs/ into site/; a warning of Sphinx is an error.
docs: numbers gallery
	$(BIN)/python scripts/write_results.py --check
	$(BIN)/python -m sphinx -W --keep-going -q -b html -d site/.doctrees docs site
	@echo "Open site/index.html"

# The pictures of docs/gallery.md, each by its own lines there.
gallery: .venv/tested
	$(BIN)/python scripts/draw_gallery.py

# A release, prepared and tested: version, changelog, citation, recipe, documentation, wheel and sdist. Nothing is uploaded.
release: docs
	$(BIN)/python scripts/release.py $(or $(VERSION),$(error say which: make release VERSION=0.2.0))

numbers: .venv/tested
	$(BIN)/python scripts/write_numbers.py

# The page docs/results.md from a finished run of the default study, and docs/results/STUDY.md from those of others.
results: .venv/installed
	[ ! -e results/default/report.html ] || $(BIN)/python scripts/write_results.py results/default
	for study in skin probe grasps decide markers real; do \
		[ ! -e results/$$study/report.html ] || $(BIN)/python scripts/write_study_results.py results/$$study || exit 1; done

clean:
	rm -rf results/*/ .snakemake
