#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Every link of a guide to a file, or to a heading of one, leads somewhere.
set -euo pipefail
cd "$(CDPATH='' cd -- "$(dirname "$0")/../.." && pwd)"
mapfile -t pages < <(find . -name '*.md' -not -path '*/build*' -not -path './.git/*' | sort)
n=0
wrong=0

# As GitHub makes them of headings: lower case, without punctuation, hyphens for spaces.
anchors() {
    awk '/^```/ { code = !code } !code && /^#+ / { sub(/^#+ /, ""); print }' "$1" |
        tr '[:upper:]' '[:lower:]' | sed 's/[^a-z0-9_ -]//g; s/ /-/g'
}

for page in "${pages[@]}"; do
    while IFS= read -r link; do
        case $link in *://*) continue ;; esac
        n=$((n + 1))
        file=${link%%#*} heading=
        [ "$link" = "$file" ] || heading=${link#*#}
        target=$page
        [ -z "$file" ] || target=$(dirname "$page")/$file
        if [ ! -e "$target" ]; then
            echo "$page: $link: there is no such file"
            wrong=1
        elif [ -n "$heading" ] && ! anchors "$target" | grep -qxF -- "$heading"; then
            echo "$page: $link: there is no such heading"
            wrong=1
        fi
    done < <(grep -oE '\]\([^) ]+\)' "$page" | sed 's/^](//; s/)$//')
done
if [ $n -lt 20 ]; then
    echo "only $n links were found in ${#pages[@]} pages"
    wrong=1
fi
exit $wrong
