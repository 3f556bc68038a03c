#!/usr/bin/env bash
# Makes the shipped model again, from nothing: data, training, test set, figures. Some 15 minutes of data and 45 minutes of training
# on two quiet cores. The data can be interrupted and gone on with by the same call.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-out/default_model}
python=.venv/bin/python

OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames" --count 2352 --seed 1000000 --workers 2
# Passive waiting: two threads that spin for each other lose half their time as soon as anything else runs.
export OMP_WAIT_POLICY=passive
$python main.py train --data "$out/frames" --steps 4000 --stop-after 2000 --out "$out/stage1"
$python main.py train --data "$out/frames" --init "$out/stage1" --steps 3600 --look-share 0.35 --seed 1 --out "$out/default"

OMP_NUM_THREADS=1 $python main.py synth --out "$out/test" --count 320 --seed 900000 --workers 2
$python main.py benchmark --accuracy "$out/test" --model "$out/default" --store
