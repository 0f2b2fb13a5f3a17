#!/usr/bin/env bash
# Run a command on a machine that lacks some programs:  tests/without.sh ffmpeg chromium -- make test
#
# The command's PATH is a folder of links to everything that is on ours, except the programs named.
set -euo pipefail
missing=" "
while [ "${1:---}" != -- ]; do
    missing+="$1 "
    shift
done
shift
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
IFS=: read -ra places <<< "$PATH"
for place in "${places[@]}"; do
    for program in "$place"/*; do
        name=${program##*/}
        [[ $missing != *" $name "* && -x $program && ! -e $folder/$name ]] && ln -s "$program" "$folder/$name"
    done
done
PATH=$folder "$@"
