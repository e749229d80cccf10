# The day's commands. `just` is optional: each recipe is one or two commands that can be typed as well.

# Show this list
[private]
default:
    @{{ just_executable() }} --list --unsorted

# Checks that compile nothing: layout, types, links, licences, schemas
quick:
    .ci/run quick

# All Rust code: clippy, documentation, tests, shipped scenarios
commit:
    .ci/run commit

# Single checks by name, such as `just check links coal`
check +names:
    .ci/run {{ names }}

# What has to pass before a change lands: quick, commit, and evidence that no longer holds
ready:
    .ci/run

# Every check, evidence that holds included
all:
    .ci/run --all

# Which checks hold at this tree, and why not
list:
    .ci/run --list

# Tests of a crate, such as `just test kinematics`, or of the whole workspace
test crate='' *args='':
    {{ if crate == '' { '.ci/tests' } else { 'cargo test -p ' + if crate == 'needlebench' { crate } else { 'needlebench-' + crate } } }} {{ args }}

# Run a command of the program, such as `just run check scenarios/table3.toml`
run +words:
    cargo run --release -- {{ words }}

# Lay out all Rust, Python and JavaScript
fmt:
    cargo fmt --all
    "$({{ checkers }})/bin/ruff" format crates/engine/harness python .ci
    .ci/javascript/check --write

# Layout, rules and types of all languages
lint:
    .ci/run format ruff pyright javascript clippy

# The guide as a book in the browser, remade at each change (needs mdBook)
guide:
    mdbook serve guide --open

# Pictures of the guide, made anew
images:
    cargo build --release
    PYTHON="$({{ checkers }})/bin/python" guide/make_images

# Figures of the evidence, written into README and guide
figures:
    .ci/run --figures

# Schemas of scenarios and studies, made anew
schemas:
    cargo run --release -- schema scenario > scenarios/scenario.schema.json
    cargo run --release -- schema study > scenarios/studies/study.schema.json

# Licences of what is inside the program, written anew (needs cargo-about)
notices:
    .ci/notices

# Lists of the public items of the crates that others use, written anew
public-api:
    .ci/public-api --write

# WebAssembly of the pages, made anew
page:
    node crates/live/build.mjs

# Prints the folder of the checks' own Python tools, which it installs if need be
checkers := "PYTHONPATH=.ci python3 -B -c 'from runner import environments; print(environments.prepared(\"checkers\"))'"
