#!/usr/bin/env bash
# numba 0.68.1 reads the index of what it keeps of a function (cache=True) before it asks whether the source has changed. The
# index holds the types that the function was called with, so after a class (here a NamedTuple) has moved to another module,
# the edited file does not compile anew: the call ends in ModuleNotFoundError until the folder __pycache__ is deleted.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3.11 -m venv env && env/bin/pip install --quiet numba==0.68.1 numpy==2.4.6

cat > kinds.py <<'PY'
from typing import NamedTuple


class Pair(NamedTuple):
    one: float
    other: float
PY
write() {
    cat > work.py <<PY
import numba

from $1 import Pair


@numba.njit(cache=True)
def added(pair):
    return pair.one + pair.other


print(added(Pair(1.0, 2.0)), len(added.stats.cache_hits))
PY
}

write kinds
echo "first:  $(env/bin/python work.py)"
echo "again:  $(env/bin/python work.py)"
mv kinds.py sorts.py
write sorts
touch -d '+1 hour' work.py
moved=$(env/bin/python work.py 2>&1 | tail -1 || true)
echo "moved:  $moved"
rm -rf __pycache__
cleared=$(env/bin/python work.py)
echo "cleared: $cleared"

[[ $moved == "ModuleNotFoundError: No module named 'kinds'" ]]
[[ $cleared == "3.0 0" ]]
# Seen: first: 3.0 0, again: 3.0 1, moved: ModuleNotFoundError: No module named 'kinds', cleared: 3.0 0.
