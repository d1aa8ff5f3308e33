# Two commands do everything from an empty clone: `make report` and `make test`.
# Set-up is redone only when pyproject.toml or requirements.lock change.

PYTHON ?= python3
REPORT := ring_magnet_4x1.5x1
FITS = $(basename $(notdir $(wildcard fits/*.toml)))
SOURCES = $(shell find magfem geometries fits reports -type f -not -path '*/__pycache__/*' 2>/dev/null)

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help report test lint fits lock clean distclean

help: ## print this list
	@sed -n 's/^\([a-z]*\):[^#]*## /\1|/p' Makefile | while IFS='|' read -r name text; do printf '  make %-10s %s\n' "$$name" "$$text"; done

report: build/$(REPORT).html ## solve and fit a ring magnet, write build/ring_magnet_4x1.5x1.html

test: .venv/ready ## everything: ruff, mypy, pytest with the browser's and Octave's tests
	@sh tools/system_packages.sh browser
	@sh tools/mag_manip.sh .venv/bin/python
	@sh tools/system_packages.sh octave
	@$(MAKE) --no-print-directory lint
	.venv/bin/pytest

lint: .venv/ready ## ruff check, ruff format --check, mypy
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/mypy

fits: .venv/ready ## remake the committed field models in fits/
	@mkdir -p fits
	for recipe in $(FITS); do .venv/bin/magfem fit "$$recipe" -o "fits/$$recipe.json" || exit; done

lock: ## remake requirements.lock, keeping its pins where they still fit (UPGRADE=1: the newest of everything)
	@sh tools/lock.sh "$(PYTHON)" $(if $(UPGRADE),--upgrade)

clean: ## remove build/ and the caches
	rm -rf build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -path ./.venv -prune -o -name __pycache__ -prune -exec rm -rf {} +

distclean: clean ## remove .venv as well
	rm -rf .venv

build/$(REPORT).html: $(SOURCES) .venv/ready
	@mkdir -p build
	.venv/bin/magfem report $(REPORT) -o $@

.venv/ready: pyproject.toml requirements.lock tools/setup.sh tools/system_packages.sh
	@sh tools/setup.sh "$(PYTHON)"
