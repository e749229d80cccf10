#!/usr/bin/env bash
# What the action does: `needlebench.sh install`, then `needlebench.sh run`. All that the caller says comes in
# variables, and never becomes part of a script.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

# Words of a text over one or several lines, into the array `words`; patterns stay what they are.
split() {
    words=()
    local line parts
    while IFS= read -r line || [ -n "$line" ]; do
        read -r -a parts <<< "$line"
        words+=("${parts[@]}")
    done <<< "$1"
}

output() { printf '%s=%s\n' "$1" "$2" >> "${GITHUB_OUTPUT:-/dev/null}"; }

install() {
    local version=${INPUT_VERSION#v} folder=${RUNNER_TEMP:?}/needlebench-bin
    if [ -z "$version" ]; then
        # `uses: .../needlebench@v0.1.0` is the release of that name.
        version=${ACTION_REF#v}
        [[ $version =~ ^[0-9]+\.[0-9]+\.[0-9]+ ]] || {
            printf '::error::set the input `version`: %s is not a release\n' "${ACTION_REF:-the action}" >&2
            return 2
        }
    fi
    NEEDLEBENCH_RELEASES=${NEEDLEBENCH_RELEASES:-$GITHUB_SERVER_URL/$ACTION_REPOSITORY/releases/download} \
        sh "$here/install.sh" --version "$version" --to "$folder"
    printf '%s\n' "$folder" >> "$GITHUB_PATH"
    output version "$version"
    output python "$(python3 --version 2>/dev/null | tr -d ' ' || true)"
}

run() {
    local status=0 out=${INPUT_OUT:-needlebench-results} words
    split "${INPUT_SCENARIOS:?}"
    shopt -s nullglob
    local scenarios=() word
    for word in "${words[@]}"; do
        # A pattern stands for its files; what matches nothing is said by the program.
        local files=()
        if [[ $word == *[*?[]* ]]; then
            local IFS=
            # shellcheck disable=SC2206 # a pattern, on purpose
            files=($word)
            unset IFS
        fi
        if [ ${#files[@]} -gt 0 ]; then scenarios+=("${files[@]}"); else scenarios+=("$word"); fi
    done
    local options=(--out "$out")
    [ -z "${INPUT_ENGINE:-}" ] || options+=(--engine "$INPUT_ENGINE")
    mkdir -p "$out"
    # It writes the summary of the step itself.
    needlebench run "${options[@]}" --junit "$out/junit.xml" -- "${scenarios[@]}" || status=$?
    if [ -n "${INPUT_BASELINE:-}" ] && [ "$status" -le 1 ]; then
        compare "$out" || { local lost=$?; [ "$status" -ne 0 ] || status=$lost; }
    fi
    output status "$status"
    output results "$out"
    return "$status"
}

# compare OUT: every scenario's results that the baseline has, too.
compare() {
    local out=$1 worst=0 found=0 status folder name words losses=()
    split "${INPUT_MAX_LOSS:-}"
    for word in "${words[@]}"; do losses+=(--max-loss "$word"); done
    for folder in "$out"/*/; do
        name=$(basename "$folder")
        [ -f "$folder/report.json" ] || continue
        if [ ! -f "$INPUT_BASELINE/$name/report.json" ]; then
            # Of a whole new baseline one line is enough.
            [ ! -d "$INPUT_BASELINE" ] || printf '::warning::%s has no baseline: not compared\n' "$name"
            continue
        fi
        found=1 status=0
        needlebench compare "${losses[@]}" --junit "$folder/compare.xml" --markdown "$folder/compare.md" -- \
            "$INPUT_BASELINE/$name" "$folder" || status=$?
        [ ! -f "$folder/compare.md" ] || cat "$folder/compare.md" >> "${GITHUB_STEP_SUMMARY:-/dev/null}"
        [ "$status" -le "$worst" ] || worst=$status
    done
    for folder in "$INPUT_BASELINE"/*/; do
        name=$(basename "$folder")
        [ ! -f "$folder/report.json" ] || [ -f "$out/$name/report.json" ] ||
            printf '::warning::%s of the baseline was not run: not compared\n' "$name"
    done
    # The first run has nothing to compare with; a baseline of other scenarios is a mistake.
    if [ "$found" = 0 ]; then
        if [ -d "$INPUT_BASELINE" ] && [ -n "$(ls -A "$INPUT_BASELINE")" ]; then
            printf '::error::the baseline %s has none of these scenarios\n' "$INPUT_BASELINE" >&2
            return 2
        fi
        printf '::notice::there is no baseline in %s yet\n' "$INPUT_BASELINE"
    fi
    return "$worst"
}

case ${1:-} in
    install) install ;;
    run) run ;;
    *) printf 'needlebench.sh install|run\n' >&2; exit 2 ;;
esac
