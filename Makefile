# All targets that a user needs. `make` builds all figures of the papers; `make help` lists the rest.

VENV    := .venv
BIN     := $(VENV)/bin
STAMP   := $(VENV)/.installed
DOCS    := $(VENV)/.docs
TOOLS   := $(VENV)/.package
CORES   ?= 2
LOCKS   := requirements-uv.lock requirements-build.lock requirements.lock

# The first Python on the PATH for which the lock has wheels; `make PYTHON=...` overrides it.
PYTHON  ?= $(shell for p in python3 python3.14 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 15))' 2>/dev/null \
	&& echo $$p && break; done)

export PATH := $(CURDIR)/$(BIN):$(PATH)
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# Into .venv, whatever pip's configuration says.
export PIP_USER := 0
unexport PIP_TARGET PIP_PREFIX PIP_ROOT
# Hundreds of processes import the same files: let them be compiled once, whatever a shell or an
# image says.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: figures bench unlock report archive quick test nightly check elsewhere mixed benchmarks figdiff unlocked accept samples mutations pages docs lock \
	package tag env cluster clean distclean help
.DEFAULT_GOAL := figures

# Of a folder that was copied or moved, .venv runs the code of the other one.
ifneq ($(shell cat $(STAMP) 2>/dev/null),$(shell pwd -P))
.PHONY: $(STAMP)
endif

figures: $(STAMP)  ## every figure of the papers, claim and results/report.html (the default); CORES=4 for more cores
	@snakemake --cores $(CORES) || { [ -z "$$(ls .snakemake/locks 2>/dev/null)" ] || \
		echo "make: if no other build runs in this folder, one was killed: make unlock" >&2; exit 1; }

bench: $(STAMP)  ## tuned observers and filters on the same tasks, results/bench; then `make` shows them in the report
	snakemake --cores $(CORES) bench

unlock: $(STAMP)  ## after a build was killed: unlock the folder, so that the next one resumes
	snakemake --unlock

archive: $(STAMP)  ## the build, and the bench if built, with provenance as an RO-Crate, results/archive.zip, to deposit and cite
	snakemake --cores $(CORES) results/archive.zip

report: figures  ## Snakemake's own report of the same build, results/report.snakemake.html
	snakemake --report results/report.snakemake.html

quick: $(STAMP)  ## style, types and the tests of the changed modules; SINCE=main for a whole branch
	ruff check .
	ruff format --check .
	mypy
	pytest --exitfirst -m "not nightly" tests/test_project.py $$({ git diff --name-only \
		--diff-filter=d $(or $(SINCE),HEAD) --; git ls-files --others --exclude-standard; } | \
		sh tests/affected.sh $(if $(SINCE),golden))

# As many processes as cores: while one waits for the build, that takes its place. Each imports
# all tests first, which takes a quarter of a minute.
TESTS := pytest --numprocesses $(CORES) $(if $(CPU_LIMIT),--cpu-limit=$(CPU_LIMIT))

# With NIGHTLY=yes also the tests of `nightly`, in the same run. CPU_LIMIT, see tests/cpu_budget.py.
test: check  ## `check`, unit tests, golden numbers of the results, which are brought up to date; seven minutes after `make`
	$(TESTS) $(if $(NIGHTLY),-m "" --hypothesis-profile=nightly)

nightly: $(STAMP)  ## all other tests: the bench, second builds, kills, other processors, a browser, Slurm; half an hour
	$(TESTS) -m "nightly or hypothesis" --hypothesis-profile=nightly
	$(MAKE) elsewhere

check: $(STAMP)  ## style, types, workflow lint, functions behind four calls
	ruff check .
	ruff format --check .
	mypy
	snakefmt --check Snakefile workflow
	check-jsonschema --builtin-schema vendor.citation-file-format CITATION.cff
	check-jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml examples/*/.github/workflows/*.yml
	snakemake --lint
	python -m tests.walks

# A newer and an older processor: what numpy, its BLAS, numba and the C library are made to use.
# And one whose compiled loops are those of the older one, as numpy and the C library are not.
NEWER := OPENBLAS_CORETYPE=Haswell NPY_ENABLE_CPU_FEATURES=
OLDER := OPENBLAS_CORETYPE=Prescott NUMBA_CPU_NAME=generic NUMBA_CPU_FEATURES= \
	GLIBC_TUNABLES=glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2
MIXED := OPENBLAS_CORETYPE=Prescott NUMBA_CPU_NAME=generic NUMBA_CPU_FEATURES=
BENCH := tests/reobserve_papers/bench/test_tuned.py::test_numbers_and_figures_agree_with_the_accepted_ones

# Each with a build of its own: `results` are of this processor.
APART := pytest --build-apart tests/reobserve_papers/golden/test_golden.py

elsewhere: $(STAMP)  ## compare the golden numbers with builds with the settings of a newer and an older processor
	$(NEWER) $(APART)
	$(OLDER) $(APART)

mixed: $(STAMP)  ## the same, and the bench, with compiled loops of the older processor and other libraries of this one
	$(MIXED) $(APART) -m "" $(BENCH)

benchmarks: $(STAMP)  ## speed: ratios against C, numpy and scipy, and the cold build
	python -m benchmarks

figdiff: $(STAMP)  ## build papers and bench, compare with the accepted figures and numbers, write figdiff/; PAPER=ilo or ilo/fig2 for one
	reobserve-papers figdiff $(PAPER) --cores $(CORES)

# In an environment of its own, without the lock.
RESOLUTION := highest
UNLOCKED := build/$(RESOLUTION)
unlocked:  ## build with the newest packages, compare as figdiff; RESOLUTION=lowest-direct for the lowest that pyproject.toml admits
	$(PYTHON) -m venv --clear $(UNLOCKED)
	$(UNLOCKED)/bin/python -m pip install --quiet uv
	$(UNLOCKED)/bin/uv pip install --quiet --python $(UNLOCKED)/bin/python --resolution $(RESOLUTION) --editable '.[papers]'
	PATH="$(CURDIR)/$(UNLOCKED)/bin:$$PATH"; snakemake --cores $(CORES) --keep-going; reobserve-papers figdiff

accept: $(STAMP)  ## build papers and bench, accept new figures and golden numbers: make accept REASON="why they moved" [PAPER=ilo/fig2]
	reobserve-papers accept $(PAPER) --reason "$(REASON)" --cores $(CORES)

samples: $(STAMP)  ## add samples where claims are undecided, and cache them in config/samples: make samples [MAX=400] [PAPER=ilo] [CLAIM=any_fault]
	reobserve-papers samples $(PAPER) $(if $(MAX),--max-samples $(MAX)) $(if $(CLAIM),--claim $(CLAIM))

mutations: $(STAMP)  ## change drawn lines of src one at a time, name the test that notices each: make mutations [CHANGES=60] [SEED=1] [MODULE=src/…]
	rm -rf build/mutations && git clone --quiet --shared . build/mutations
	cd build/mutations && PYTHONPATH="$$PWD/src" python -m tests.mutations $(or $(CHANGES),60) $(or $(SEED),1) $(MODULE)

pages: $(STAMP)  ## run the code of the pages and update its output in them; PAGE=docs/pages/index.md for one page
	python -m docs.outputs $(PAGE)

docs: $(DOCS) figures  ## the documentation and the report of the papers as a site that any static host serves, build/site
	python -m docs.generate
	NO_MKDOCS_2_WARNING=1 python -m mkdocs build --strict --config-file build/mkdocs.yml
	@echo "python -m http.server --directory build/site 8000 serves it: http://localhost:8000"

package: tag $(TOOLS)  ## what a release has: wheel, source archive, report and archive of a build in dist, checked; TAG=v1.2.3 must be the version
	rm -rf dist
	python -m hatchling build --directory dist
	twine check --strict dist/*
	check-wheel-contents dist/*.whl
	hadolint Containerfile
	snakemake --cores $(CORES) results/report.html results/archive.zip
	cp results/report.html results/archive.zip dist

VERSION := v$(shell sed -n 's/^version = "\(.*\)"/\1/p' pyproject.toml)
tag:
	@test -z "$(TAG)" -o "$(TAG)" = "$(VERSION)" || \
		{ echo "make: the tag $(TAG) must be $(VERSION), the version in pyproject.toml" >&2; exit 1; }

env: $(STAMP)  ## set up .venv and nothing else

cluster: $(STAMP)  ## add the Snakemake executor for Slurm to .venv, see profiles/slurm
	python -m pip install --quiet --no-deps --require-hashes -r requirements-cluster.lock

$(DOCS): $(STAMP) requirements-docs.lock
	python -m pip install --quiet --require-hashes -r requirements-docs.lock
	@touch $@

$(TOOLS): $(STAMP) requirements-package.lock
	python -m pip install --quiet --require-hashes -r requirements-package.lock
	@touch $@

$(STAMP): $(LOCKS) pyproject.toml workflow/envs/install.sh
	@test -n "$(PYTHON)" || { echo "make: no Python 3.11 to 3.14 on the PATH; install one or say make PYTHON=/path/to/python" >&2; exit 1; }
	@test ! -L $(VENV) || { echo "make: $(VENV) is a link, and what it links to would be cleared; remove the link" >&2; exit 1; }
	@$(PYTHON) -m venv --clear $(VENV)
	@PYTHON=$(BIN)/python sh workflow/envs/install.sh
	@pwd -P > $@

# The locks name versions and hashes and no package index, and hold for every
# supported Python: uv resolves them together, markers keep the branches apart.
LOCK := uv pip compile --quiet --universal --python-version 3.11 --generate-hashes \
	--no-emit-index-url --no-annotate --upgrade --custom-compile-command "make lock"

lock:  ## update the lock files from pyproject.toml
	$(PYTHON) -m venv .venv-lock
	.venv-lock/bin/python -m pip install --quiet uv
	.venv-lock/bin/$(LOCK) --all-extras --group pyproject.toml:dev pyproject.toml -o requirements.lock
	.venv-lock/bin/$(LOCK) --group pyproject.toml:uv -o requirements-uv.lock
	.venv-lock/bin/$(LOCK) --group pyproject.toml:build -c requirements.lock -o requirements-build.lock
	.venv-lock/bin/$(LOCK) --group pyproject.toml:package -c requirements.lock -o requirements-package.lock
	.venv-lock/bin/$(LOCK) --group pyproject.toml:cluster --no-deps -o requirements-cluster.lock
	.venv-lock/bin/$(LOCK) --group pyproject.toml:docs -c requirements.lock -o requirements-docs.lock
	rm -rf .venv-lock

clean:  ## remove what was built, and compiled code that is older than two weeks
	find src -name "reobserve-kernels-*" -prune -mtime +14 -exec rm -r {} +
	find results/ -mindepth 1 -not -name README.md -delete
	rm -rf logs .snakemake build

distclean: clean  ## remove the environment and every cache, too
	rm -rf dist figdiff benchmarks/results $(VENV) .venv-lock .pytest_cache .mypy_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

help:  ## this list
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | sort | \
		awk -F'\t' 'BEGIN { print "make TARGET" } { printf "  %-10s %s\n", $$1, $$2 }'
