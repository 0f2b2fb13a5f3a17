#!/usr/bin/env bash
# The README's two commands on a bare machine: a container that has Python, git and make, and no cache of packages.
#
#   tests/bare_machine.sh            as root in /myview, and then as somebody in an awkward place
#   tests/bare_machine.sh root       only the first
#   tests/bare_machine.sh awkward    only the second: not root, a path with spaces, LANG=C, another time zone,
#                                    no IPv6, and an npm that answers nothing
#
# Takes a Docker engine. Of each: the suite with its closing line, and what `make demo` took by part.
set -euo pipefail
IMAGE=${IMAGE:-python:3.11-slim-bookworm}
ROOT=$(cd "$(dirname "$0")/.." && pwd)
# shellcheck disable=SC2016  # expanded inside
COMMANDS='
    git clone --quiet file:///source "$CLONE"
    cd "$CLONE"
    failed=0
    make test || failed=$?
    .venv/bin/python -m benchmarks.startup --out /tmp/startup || failed=$?
    exit $failed'

in_container() {  # NAME CLONE "OPTIONS OF docker run" BEFORE
    echo "== $1"
    # shellcheck disable=SC2086  # the options are words
    docker run --rm --init --volume "$ROOT:/source:ro" --env CLONE="$2" --env PIP_NO_CACHE_DIR=1 --env UV_NO_CACHE=1 $3 \
        "$IMAGE" bash -ceu "
            apt-get update -qq
            DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends git make >/dev/null
            useradd --create-home somebody
            git config --system --add safe.directory '*'  # the sources are somebody else's
            $4 bash -ceu '$COMMANDS'"
}

failed=0
case "${1:-both}" in
    root | both) in_container "as root" /myview "" "" || failed=$? ;;&
    awkward | both)
        in_container "as somebody, in an awkward place" "/home/somebody/my own view" \
            "--sysctl net.ipv6.conf.all.disable_ipv6=1 --env LANG=C --env TZ=Pacific/Chatham
             --env npm_config_registry=http://127.0.0.1:9" \
            "setpriv --reuid=somebody --regid=somebody --init-groups env HOME=/home/somebody" || failed=$?
        ;;
esac
exit $failed
