#!/usr/bin/env bash
# Measures the shipped models on rigs of other kinds: on four rare looks that no training has seen, and on the three that both were shown.
# Where train_default.sh has been run, makes `wide` again first: its network near23, before it was averaged with what it began from.
# Ten minutes of calibration, and half an hour of data and measuring on two cores.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-out/default_model}
python=.venv/bin/python
wide=wide

make_set() { OMP_NUM_THREADS=1 $python main.py synth --out "$out/$1" --count 128 --seed "$2" --family "$1" --workers 2; }
# Seeds by hand: these sets were measured before the models were made.
make_set tank 930400
make_set glow 930400
make_set picture 930700
make_set resin 930500
make_set gel 930300
make_set drape 930500
make_set stage_light 931100

if [ -d "$out/near23" ]; then
    wide=$out/near23
    $python main.py calibrate "$out/calibration" --knows "$out/bench" --eight-bit --model "$wide"
    $python main.py benchmark --accuracy "$out/test" --model "$wide" --store
fi
for look in tank glow picture resin gel drape stage_light; do
    for model in default "$wide"; do
        $python main.py benchmark --accuracy "$out/$look" --model "$model"
    done
done
