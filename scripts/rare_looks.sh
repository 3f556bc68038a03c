#!/usr/bin/env bash
# Measures the shipped model on rigs of other kinds: on four rare looks that no training has seen, and on the three that it was shown.
# Twenty minutes of data and measuring on two cores.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-out/rare_looks}
python=.venv/bin/python

make_set() { OMP_NUM_THREADS=1 $python main.py synth --out "$out/$1" --count 128 --seed "$2" --family "$1" --workers 2; }
# Seeds by hand: these sets were measured before the models were made.
make_set tank 930400
make_set glow 930400
make_set picture 930700
make_set resin 930500
make_set gel 930300
make_set drape 930500
make_set stage_light 931100

for look in tank glow picture resin gel drape stage_light; do
    $python main.py benchmark --accuracy "$out/$look"
done
