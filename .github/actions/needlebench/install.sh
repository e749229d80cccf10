#!/bin/sh
# Installs a release of needlebench on Linux, x86-64 or ARM: one static program.
#
#   install.sh [--version 0.1.0] [--to ~/.local/bin]
#
# NEEDLEBENCH_RELEASES is where releases are, up to the folder of a version; a release's own copy of this file
# knows it, and its version.
set -eu

releases=${NEEDLEBENCH_RELEASES:-@RELEASES@}
version=@VERSION@
to=$HOME/.local/bin

fail() { printf 'error: %s\n' "$*" >&2; exit 1; }

while [ $# -gt 0 ]; do
    [ $# -ge 2 ] || fail "$1 needs a value"
    case $1 in
        --version) version=${2#v} ;;
        --to) to=$2 ;;
        *) fail "unknown option $1; there are --version and --to" ;;
    esac
    shift 2
done
# Not filled in, these are placeholders.
case $releases in @*) fail "set NEEDLEBENCH_RELEASES to the base URL of the releases" ;; esac
case $version in @*) fail "give --version" ;; esac
case $version in *[!0-9A-Za-z.+-]*|'') fail "'$version' is not a valid version" ;; esac

case "$(uname -s) $(uname -m)" in
    'Linux x86_64') target=x86_64-unknown-linux-musl ;;
    'Linux aarch64'|'Linux arm64') target=aarch64-unknown-linux-musl ;;
    *) fail "there is no release for $(uname -s) $(uname -m); cargo install builds one" ;;
esac
name=needlebench-$version-$target

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fetch() {
    curl --silent --show-error --fail --location --retry 3 --output "$work/$1" "$releases/v$version/$1" ||
        fail "cannot fetch $releases/v$version/$1"
}
fetch "$name.tar.xz"
fetch SHA256SUMS
# Of the file that was fetched, and of nothing else.
grep "  $name.tar.xz\$" "$work/SHA256SUMS" > "$work/sum" || fail "SHA256SUMS does not name $name.tar.xz"
(cd "$work" && sha256sum --check --status sum) || fail "$name.tar.xz is not what was released: its SHA-256 differs"

tar --extract --xz --file "$work/$name.tar.xz" --directory "$work"
mkdir -p "$to"
# Renamed into place: a program that runs is not written to.
cp "$work/$name/needlebench" "$to/.needlebench.new"
chmod 755 "$to/.needlebench.new"
mv "$to/.needlebench.new" "$to/needlebench"
printf 'installed %s\n' "$("$to/needlebench" --version)"
