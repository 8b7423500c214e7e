# Everything a newcomer needs: `make demo` and `make test` set the environment up themselves.
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed
DEV    := $(VENV)/.installed-dev
PEERS  := $(VENV)/.installed-bench

.PHONY: docs fuzz test-oldest audit campaign demo test test-all lint bench effects flaws datasets recipe paper pictures diagnose-bench proof proof-small payoff clean exports

demo: $(STAMP)
	$(BIN)/flawforge generate quickstart --out out/quickstart
	$(BIN)/flawforge verify out/quickstart
	$(BIN)/flawforge preview out/quickstart --out out/quickstart.png

test: $(DEV)
	$(BIN)/python -m pytest -n 2 -m "not slow"

test-all: $(DEV)
	$(BIN)/python -m pytest -n 2

# Fresh examples, FUZZ of each test (5000: about twenty minutes); what fails is kept in .hypothesis.
FUZZ ?= 5000

fuzz: $(DEV)
	FUZZ=$(FUZZ) $(BIN)/python -m pytest tests/fuzz

# The oldest versions that pyproject.toml allows, in an environment of their own.
OLDEST := $(VENV)-oldest

test-oldest: $(OLDEST)/.installed
	$(OLDEST)/bin/python -m pytest -o addopts="--import-mode=importlib -q" -o filterwarnings= \
	  -m "not slow" tests/test_arrows.py tests/sensors/test_recording.py tests/sensors/formats \
	  tests/pipeline/test_recipe.py tests/pipeline/pod tests/fuzz
	rm -rf out/oldest
	$(OLDEST)/bin/flawforge generate quickstart --set specimens=1 --set scans=1 --out out/oldest
	$(OLDEST)/bin/flawforge verify out/oldest

$(OLDEST)/.installed: pyproject.toml constraints/oldest.txt
	$(PYTHON) -m venv $(OLDEST)
	$(OLDEST)/bin/python -m pip install --quiet --disable-pip-version-check --editable . \
	  --constraint constraints/oldest.txt 'pytest>=8.0' 'hypothesis>=6.100'
	touch $@

# Known weaknesses of what is installed. Needs the network: see SECURITY.md.
audit: $(STAMP)
	test -x $(VENV)-audit/bin/pip-audit || { $(PYTHON) -m venv $(VENV)-audit && \
	  $(VENV)-audit/bin/python -m pip install --quiet 'pip-audit>=2.7'; }
	$(VENV)-audit/bin/pip-audit --strict --progress-spinner off --skip-editable \
	  --path $$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')

lint: $(DEV)
	$(BIN)/ruff check .
	$(BIN)/mypy

# Side by side with the peers, on an idle machine: half an hour. One section again:
# python -m benchmarks --only datasets (or scans, waits, casting, growth, noise). Far hosts, which
# need root and sshfs: python -m benchmarks.cluster --write docs/scaling.md.
bench: $(PEERS)
	$(BIN)/python -m benchmarks

# out/site/index.html; a broken link or any other warning stops it. The site needs no network.
docs: $(DEV)
	$(BIN)/python docs/site/build.py out/site

paper: $(DEV)
	$(BIN)/python docs/paper/make_paper.py

effects: $(STAMP)
	$(BIN)/python docs/effects/make_effects.py

flaws: $(STAMP)
	$(BIN)/python docs/flaws/make_flaws.py

exports: $(DEV)
	$(BIN)/python -W ignore docs/exports/make_exports.py

recipe: $(STAMP)
	$(BIN)/python docs/recipe/make_recipe.py

datasets: $(STAMP)
	$(BIN)/python docs/datasets/make_datasets.py

pictures: $(STAMP)
	$(BIN)/python docs/pictures/make_pictures.py
	$(BIN)/python docs/tutorial/make_pictures.py

# Continues where it was stopped. FIRST cases of each seed: all kinds in proportion; 306 are all.
BENCH ?= out/diagnose-bench
FIRST ?= 306

campaign: $(STAMP)
	$(BIN)/python -W ignore -m benchmarks.campaign --write docs/reliability.md

diagnose-bench: $(STAMP)
	for seed in 0 100 200; do \
	  $(BIN)/python -W ignore -m benchmarks.other_formulas run --seed $$seed --first $(FIRST) --out $(BENCH) || exit; done
	$(BIN)/python -W ignore -m benchmarks.other_formulas run --plan laws --seed 100 --first $(FIRST) --out $(BENCH)
	$(BIN)/python -W ignore -m benchmarks.other_formulas run --plan habits --seed 100 --first $(FIRST) --out $(BENCH)
	$(BIN)/python -W ignore -m benchmarks.other_formulas judge --out $(BENCH) --write docs/diagnosis-bench.md

# Continues where it was stopped; another PROOF folder is a fresh seed. The first family's set is
# opened afterwards, the second's never: its run is entered in docs/test-record.md with REASON.
# 60 cases of a family have 23 good instruments and take two cores about three hours for both;
# CASES=160 has 60 good instruments.
PROOF ?= out/proof
CASES ?= 60
REASON ?= make proof
MESHES ?=
PAGE   ?= docs/proof.md
RECORD ?= docs/test-record.md

proof: $(DEV)
	$(BIN)/flawforge challenge calibrate --each 3 --jobs 2 --out $(PROOF)/calibration
	for family in first second; do \
	  $(BIN)/flawforge challenge make --family $$family --cases $(CASES) --jobs 2 \
	    $(if $(MESHES),$$([ $$family = second ] && echo --meshes $(MESHES))) \
	    --out $(PROOF)/$$family || exit; \
	  $(BIN)/flawforge challenge run $(PROOF)/$$family --jobs 2 || [ $$? -eq 1 ] || exit; \
	  $(BIN)/flawforge challenge measure $(PROOF)/$$family || [ $$? -eq 1 ] || exit; \
	  for way in ranked random; do \
	    $(BIN)/flawforge challenge run $(PROOF)/$$family --measured $$way --jobs 2 \
	      || [ $$? -eq 1 ] || exit; \
	  done; \
	  $(BIN)/flawforge challenge run $(PROOF)/$$family --shuffled 12 --jobs 2 || [ $$? -eq 1 ] || exit; \
	  $(BIN)/flawforge challenge baseline $(PROOF)/$$family --train $(PROOF)/calibration || exit; \
	done
	$(BIN)/flawforge challenge judge $(PROOF)/first $(PROOF)/second --write $(PAGE) \
	  --record $(RECORD) --reason "$(REASON)"

# Both families in half an hour, into $(PROOF)-small; no result, and no line in the record.
proof-small:
	$(MAKE) proof PROOF=$(PROOF)-small CASES=12 PAGE=$(PROOF)-small/proof.md \
	  RECORD=$(PROOF)-small/test-record.md REASON="a try"

# Continues where it was stopped; another PAYOFF folder is a fresh seed.
PAYOFF ?= out/payoff

payoff: $(DEV)
	for family in first second; do \
	  $(BIN)/flawforge challenge payoff --family $$family --out $(PAYOFF)/$$family --jobs 2 \
	    --write docs/payoff.md || exit; \
	done

$(VENV)/bin/python:
	$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "flawforge needs Python 3.11 or newer; name one with make PYTHON=/path/to/python3")'
	$(PYTHON) -m venv $(VENV)

$(STAMP): pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	touch $@

$(DEV): pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $(STAMP) $@

# A peer that can't be installed here is skipped on the page, with a word.
$(PEERS): pyproject.toml | $(DEV)
	-$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev,bench]'
	touch $@

clean:
	rm -rf $(VENV) $(VENV)-oldest $(VENV)-audit out
