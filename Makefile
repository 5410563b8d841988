# Two commands do everything on a bare machine: `make compare` and `make test`. `make` alone lists all.
# PYTHON=... names the interpreter for .venv, ARGS=... is added to the command that a target runs.

BIN := .venv/$(if $(filter Windows_NT,$(OS)),Scripts,bin)
CORE := .venv/frictionid.core
TEST := .venv/frictionid.test
DEV := .venv/frictionid.dev
DOCS := .venv/frictionid.docs

# Each worker computes on one thread: two workers with two threads each are slower on two cores.
ONE_THREAD := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 NUMEXPR_NUM_THREADS=1
# Tests start commands more than a hundred times: bytecode is kept wherever the shell says otherwise,
# and loops that have changed are compiled before, not by each worker.
COMPILED := PYTHONDONTWRITEBYTECODE=

.PHONY: help compare compare-all machines test damage mutants check format bench docs clean ALWAYS
.DEFAULT_GOAL := help

help: ## this list
	@grep -E '^[a-z-]+:.*## ' Makefile | sed -E 's/:.*## /|/' | while IFS='|' read -r name text; do \
	  printf '  make %-12s %s\n' "$$name" "$$text"; done

compare: $(CORE) ## set up .venv, then compare friction models on the simulated acrobot (4 minutes on two cores)
	@$(BIN)/frictionid compare comparisons/acrobot.toml $(ARGS)

compare-all: $(CORE) ## every model and seed, and the study reproduced (hours on two cores); goes on where it stopped
	@for suite in acrobot acrobot_all acrobot_study; do \
	  $(BIN)/frictionid compare comparisons/$$suite.toml --resume $(ARGS) || exit; done

machines: $(CORE) ## every public machine by the same rules (13 minutes; FRICTIONID_DATA has the recordings); goes on where it stopped
	@$(BIN)/python comparisons/machines.py $(ARGS)

test: $(TEST) ## add the test tools to .venv, then run all tests (12 minutes on two cores)
	@$(ONE_THREAD) $(COMPILED) $(BIN)/frictionid warm --quiet
	@$(ONE_THREAD) $(COMPILED) $(BIN)/pytest -n 2 --dist worksteal $(ARGS)

damage: $(TEST) ## 10,000 damaged inputs to all commands that read (20 minutes); of readers: ARGS="--readers --count 1000"
	@$(ONE_THREAD) $(BIN)/python tests/damage.py $(ARGS)

mutants: $(TEST) ## small random changes to the code, and which of them no test notices (hours)
	@$(BIN)/python -m pip install -q -c constraints.txt cosmic-ray pytest-cov
	@$(ONE_THREAD) $(BIN)/python tests/mutants.py $(ARGS)

check: $(DEV) ## formatting, lint and types
	@$(BIN)/ruff format --check .
	@$(BIN)/ruff check .
	@$(BIN)/mypy

format: $(DEV) ## format the code and repair what lint can repair
	@$(BIN)/ruff check --fix-only --quiet .
	@$(BIN)/ruff format .

bench: $(CORE) ## speed and accuracy beside others, into report/bench (7 minutes)
	@$(ONE_THREAD) $(BIN)/python comparisons/bench $(ARGS)

docs: $(DOCS) ## the documentation as a site in site/, with the reports that are in report/
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --clean $(ARGS)
	@echo "written to $(CURDIR)/site/index.html"

clean: ## remove .venv and caches; results in report/ stay
	rm -rf .venv build dist site .mypy_cache .pytest_cache .ruff_cache .hypothesis

# The environment. It is made again from nothing when an installation was interrupted (.venv/installing is
# left) or the folder was moved (its scripts name the old place); it is brought up to date when the
# requirements change; otherwise it is left alone.
BROKEN := $(shell test -d .venv || exit 0; test ! -e .venv/installing \
  && test "$$(cat .venv/place 2>/dev/null || pwd -P)" = "$$(pwd -P)" \
  && $(BIN)/python -c 'import pip' >/dev/null 2>&1 || echo broken)
READY := $(if $(BROKEN),,$(wildcard $(BIN)/python))

# "ok:" and the path of the first interpreter that will do, else the sentence that names the way out.
# (Patterns have both parentheses because make counts them; a hash sign cannot be written in every make.)
FOUND = $(shell \
  set -- $(if $(PYTHON),"$(PYTHON)",python3 python3.13 python3.12 python3.11); \
  for name do \
    path=$$(command -v "$$name") || continue; \
    version=$$("$$path" --version 2>&1) || continue; \
    case "$$version" in \
      ("Python 3.1"[1-9]* | "Python 3."[2-9][0-9]*) ;; \
      (*) old="$${old:-$$version at $$path}"; continue ;; \
    esac; \
    if "$$path" -c 'import ensurepip, venv' >/dev/null 2>&1; then echo "ok:$$path"; exit; fi; \
    case "$$name" in (python3.1[1-9]) package=$$name-venv ;; (*) package=python3-venv ;; esac; \
    bare="$${bare:-$$package is missing for $$path: sudo apt install $$package}"; \
  done; \
  old="$${old:-no $(or $(PYTHON),python3)}"; \
  echo "$${bare:-frictionid needs Python 3.11 or newer; found $$old: install one}," \
    "or name another: make PYTHON=python3.12 $(or $(firstword $(MAKECMDGOALS)),compare)")

define create
$(eval INTERPRETER := $(FOUND))
$(if $(filter ok:%,$(firstword $(INTERPRETER))),,$(error $(INTERPRETER)))
@echo "Setting up .venv with $(subst ok:,,$(INTERPRETER)): NumPy, SciPy, pandas, scikit-learn, PySINDy, OpenCV, PyTorch ..."
@echo "0.5 GB to download, 2.0 GB on disk, one minute or a few; PyTorch with CUDA (the README says how to do without) is several GB more."
@"$(subst ok:,,$(INTERPRETER))" -m venv --clear .venv
endef

# What pip says goes to .venv/pip.log; a terminal shows its last line, a failure its last lines.
define install
@touch .venv/installing
@trap 'kill $$pid; exit 130' INT TERM; \
  $(BIN)/python -m pip install --disable-pip-version-check --no-input -c constraints.txt -e $(1) \
    >.venv/pip.log 2>&1 & pid=$$!; \
  while [ -t 1 ] && kill -0 $$pid 2>/dev/null; do \
    printf '\r\033[K%.79s' "$$(tail -n 1 .venv/pip.log)"; sleep 1; \
  done; \
  [ ! -t 1 ] || printf '\r\033[K'; \
  wait $$pid || { tail -n 20 .venv/pip.log >&2; exit 1; }
@rm .venv/installing
@touch $@
endef

$(CORE): pyproject.toml constraints.txt $(if $(BROKEN),ALWAYS)
	$(if $(READY),,$(create))
	$(call install,'.[all]')
	@pwd -P >.venv/place
	@$(ONE_THREAD) $(BIN)/frictionid warm --quiet

$(TEST): $(CORE)
	@echo "Adding pytest, MuJoCo, Pinocchio, CasADi, ONNX to .venv: 0.3 GB to download, 0.8 GB on disk, a minute."
	$(call install,'.[test]')

$(DEV): $(CORE)
	@echo "Adding ruff, mypy, pre-commit to .venv: 0.1 GB on disk, ten seconds."
	$(call install,'.[dev]')

$(DOCS): $(CORE)
	@echo "Adding MkDocs to .venv: 20 MB to download, 0.1 GB on disk, ten seconds."
	$(call install,'.[docs]')
