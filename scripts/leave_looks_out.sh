#!/usr/bin/env bash
# How well does a network do on looks that it has never seen? Trains one from nothing without three of the ten families of looks, one
# of each kind of rig (tubes on a board, channels, X-ray), and measures it on all ten: seven that it knows, three that it does not.
# Some ten minutes of data and three quarters of an hour of training on two cores.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-out/leave_looks_out}
python=.venv/bin/python
without=(silicone_red opaque_channel fluoroscopy)
known=(silicone_white silicone_dark silicone_colour tinted_liquid clear_block backlit subtraction)

OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames" --count 3200 --seed 1116000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/calib" --count 240 --seed 960000 --workers 2 "${known[@]/#/--family=}"
OMP_NUM_THREADS=1 $python main.py synth --out "$out/test" --count 512 --seed 900000 --workers 2
export OMP_WAIT_POLICY=passive
$python main.py train --data "$out/frames" "${without[@]/#/--without=}" --look-share 0.35 --shallow --steps 5000 --seed 30 --out "$out/model"
$python main.py calibrate "$out/calib" --model "$out/model"
# As if it knew all kinds of pictures; then as it ships, where a look that it has not seen may be refused.
printf '[perception.quality]\nmax_novelty = 1000.0\n' > "$out/any_kind.toml"
$python main.py benchmark --accuracy "$out/test" --model "$out/model" --config "$out/any_kind.toml"
$python main.py benchmark --accuracy "$out/test" --model "$out/model"
