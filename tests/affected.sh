#!/bin/sh
# Read names of changed files, print the tests of the same names: test_NAME.py for NAME.py, or else
# the folder of tests of the same name as the package. With the word `golden`, also the golden
# numbers of the papers where the library has changed. A change in the papers prints no test of the
# library.
while read -r file; do
    case $file in
    tests/*/test_*.py | tests/test_*.py) echo "$file" ;;
    src/*/*.py)
        folder=tests/${file#src/}
        folder=${folder%/*}
        if [ -f "$folder/test_${file##*/}" ]; then
            echo "$folder/test_${file##*/}"
        else
            until [ -d "$folder" ]; do folder=${folder%/*}; done
            case $folder in
            tests/*/*) echo "$folder" ;;
            tests/reobserve) echo tests/reobserve/library ;;
            *) echo tests/reobserve_papers/steps ;;
            esac
        fi
        case "$1 $file" in
        golden\ src/reobserve/*) echo tests/reobserve_papers/golden/test_golden.py ;;
        esac
        ;;
    config/papers/*) echo tests/reobserve_papers/parameters ;;
    config/claims/* | config/errata/*) echo tests/reobserve_papers/claims ;;
    docs/*) echo tests/docs/test_pages.py tests/docs/test_hand_written.py tests/docs/test_outputs.py tests/docs/test_equations.py ;;
    esac
done | sort -u
