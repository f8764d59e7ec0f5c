# The tasks of this repository; `make` lists them. They use .venv, which `make setup` makes.
BIN := .venv/bin

.PHONY: help setup quick test sweep score bench reproduce docs paper pictures suite ci

help: ## list the tasks
	@sed -n 's/^\([a-z]*\): .*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 12

setup: ## a virtual environment with this checkout in it, and the hooks that run before a commit
	python3 -m venv .venv
	$(BIN)/pip install -q -e '.[test,dev,docs]'
	if [ -d .git ]; then $(BIN)/pre-commit install; fi

quick: ## while working: lint, format, types, and the tests that take less than a minute
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -m 'not slow'

test: ## all tests
	$(BIN)/python -m pytest

sweep: ## more cases of what the tests hold, and how good the diagnosis is on a tenth of its cases
	$(BIN)/python -m pytest -m sweep
	$(BIN)/python scripts/score.py --short

score: ## how good the diagnosis is, on three hundred new cases: docs/figures.json; half an hour
	$(BIN)/python scripts/score.py --out docs/figures.json --page docs/diagnosis.md

bench: ## how fast it is, beside other ways: docs/figures.json and docs/performance.md
	$(BIN)/python -m pytest -m benchmark -n 0 -s
	$(BIN)/python scripts/bench.py --before 2a123ab2 --out docs/figures.json --page docs/performance.md

reproduce: ## all of these numbers from one commit, or SHORT=1 a tenth; fails if one has moved
	$(BIN)/python scripts/reproduce.py $(if $(SHORT),--short)

docs: ## write the pages and pictures made from the sources, and build the site: build/site/index.html
	$(BIN)/python scripts/draw_effects.py
	$(BIN)/python scripts/make_effects.py
	$(BIN)/python scripts/make_api.py
	$(BIN)/python scripts/make_commands.py
	$(BIN)/python scripts/draw_floors.py
	$(BIN)/python scripts/make_paper.py
	$(BIN)/python scripts/link_words.py
	$(BIN)/python scripts/draw_fall.py
	$(BIN)/python -m sphinx -q -W --keep-going -c docs -d build/read . build/site

paper: ## every figure and number of docs/paper.md; ten minutes
	$(BIN)/python scripts/make_paper.py
	$(BIN)/python scripts/link_words.py
	$(BIN)/python scripts/explain_figure_12.py
	$(BIN)/python scripts/paper_control.py

pictures: ## docs/pictures by the viewer and a browser; the pages, light and dark, wide and narrow, in pages/
	$(BIN)/python scripts/render_pictures.py
	$(BIN)/python scripts/shoot_pages.py

suite: ## SEECR against MuJoCo, every case; results in crosscheck-results/
	$(BIN)/crosscheck run

ci: ## all that continuous integration runs, with the wheel instead of this checkout in .venv
	.ci/run
