#!/bin/sh
# Read names of changed files, print the tests of the same names: test_NAME.py for NAME.py, or else
# the folder of tests of the same name as the package.
while read -r file; do
    case $file in
    tests/*/test_*.py | tests/test_*.py) echo "$file" ;;
    src/reobserve/*.py)
        folder=tests/${file#src/reobserve/}
        folder=${folder%/*}
        if [ -f "$folder/test_${file##*/}" ]; then
            echo "$folder/test_${file##*/}"
        else
            until [ -d "$folder" ]; do folder=${folder%/*}; done
            [ "$folder" = tests ] || echo "$folder"
        fi
        ;;
    config/papers/*) echo tests/replication/parameters ;;
    config/claims/* | config/errata/*) echo tests/replication/claims ;;
    docs/*) echo tests/docs/test_pages.py tests/docs/test_hand_written.py tests/docs/test_outputs.py ;;
    esac
done | sort -u
