#!/usr/bin/env bash
# Makes the shipped model again, from nothing: data, training, calibration, test set, figures. Some five hours of data and thirty
# hours of training on two cores, the last four runs of it on a GPU. It can be interrupted: the same call goes on with the data.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-out/default_model}
python=.venv/bin/python

OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames1" --count 2502 --seed 1000000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames2" --count 2400 --seed 1001000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames3" --count 1840 --seed 1002000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames4" --count 1840 --seed 1004000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames5" --count 1280 --seed 1005000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames6" --count 2500 --seed 1100000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames7" --count 2500 --seed 1102000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames8" --count 3000 --seed 1104000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames9" --count 3000 --seed 1107000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames10" --count 960 --seed 1109000 --family bench --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames11" --count 3200 --seed 1111000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames12" --count 480 --seed 1115000 --family bench --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames13" --count 3200 --seed 1116000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames14" --count 480 --seed 1119500 --family bench --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames15" --count 3200 --seed 1120000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames16" --count 640 --seed 1124000 --family opaque_channel --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames17" --count 320 --seed 1125500 --family bench --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames18" --count 3200 --seed 1132000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames19" --count 320 --seed 1136000 --family bench --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames20" --count 960 --seed 1137000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames21" --count 3600 --seed 1138000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames22" --count 360 --seed 1142000 --family bench --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames23" --count 3400 --seed 1143000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames24" --count 400 --seed 1147000 --family bench --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames25" --count 6400 --seed 1148000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames26" --count 10400 --seed 1155000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames27" --count 800 --seed 1166000 --family bench --workers 2
# The first of these two sets once more, by themselves.
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames28" --count 3600 --seed 1155000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames29" --count 240 --seed 1166000 --family bench --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames30" --count 11000 --seed 1167000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames31" --count 800 --seed 1179000 --family bench --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames32" --count 10400 --seed 1180000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames33" --count 800 --seed 1193000 --family bench --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames34" --count 5600 --seed 1181000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames35" --count 1280 --seed 1182000 --family opaque_channel --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames36" --count 1280 --seed 1183000 --family subtraction --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames37" --count 480 --seed 1193100 --family bench --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames38" --count 2400 --seed 1184000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames39" --count 12000 --seed 1189000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames40" --count 1920 --seed 1190000 --family opaque_channel --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames41" --count 1600 --seed 1191000 --family subtraction --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames42" --count 480 --seed 1193230 --family bench --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames43" --count 12800 --seed 1199000 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames44" --count 1280 --seed 1200500 --family opaque_channel --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames45" --count 1280 --seed 1201000 --family subtraction --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames46" --count 320 --seed 1193400 --family bench --workers 2
# Three of the seven rare looks; glow, tank, picture and resin no training has seen: they are for tests alone.
wider=(--family gel --family drape --family stage_light)
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames47" --count 2400 --seed 1204100 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames48" --count 2000 --seed 1204400 "${wider[@]}" --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames49" --count 1280 --seed 1204700 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames50" --count 960 --seed 1204900 "${wider[@]}" --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames51" --count 160 --seed 1193460 --family bench --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames52" --count 1400 --seed 1205100 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames53" --count 800 --seed 1205300 "${wider[@]}" --workers 2
# Two threads that spin for each other lose half their time as soon as anything else runs, and two that sleep at once a quarter of it:
# so they spin for a moment. And memory that is given back after each step has to be cleared for the next one.
export OMP_WAIT_POLICY=passive GOMP_SPINCOUNT=20000 GLIBC_TUNABLES=glibc.malloc.hugetlb=1
export MALLOC_MMAP_THRESHOLD_=4294967296 MALLOC_TRIM_THRESHOLD_=17179869184
sets=(--data "$out/frames1" --data "$out/frames2" --look-share 0.35)
# First many small crops at a high rate, then fewer and larger ones, which show the network more of what lies around.
$python main.py train "${sets[@]}" --shallow --steps 11000 --stop-after 4114 --seed 10 --out "$out/stage1"
larger=(--crop 384 --batch 6)
$python main.py train "${sets[@]}" --init "$out/stage1" "${larger[@]}" --rate 5e-3 --steps 2800 --seed 11 --out "$out/stage2"
$python main.py train "${sets[@]}" --init "$out/stage2" "${larger[@]}" --rate 5e-3 --steps 5200 --seed 12 --out "$out/stage3"
# Five more convolutions, and at first more of the frames that the model finds hard.
$python main.py train "${sets[@]}" --init "$out/stage3" --deepen --focus 0.3 "${larger[@]}" --rate 6e-3 --steps 14000 --stop-after 4000 \
    --seed 13 --out "$out/stage4"
$python main.py train "${sets[@]}" --init "$out/stage4" "${larger[@]}" --rate 4.3e-3 --steps 2600 --seed 14 --out "$out/stage5"
# The second look: a copy of the network that learns nothing but the robot's ends.
$python main.py train "${sets[@]}" --second-look --init "$out/stage5" --batch 24 --rate 5e-3 --steps 6000 --seed 21 --out "$out/near1"
# And on frames that neither look has seen, half of the time on what both still miss or invent there.
$python main.py train --data "$out/frames3" --look-share 0.35 --second-look --init "$out/near1" --focus 0.5 --batch 24 --rate 4e-3 \
    --steps 2800 --stop-after 2000 --seed 22 --out "$out/near2"
$python main.py train --data "$out/frames4" --data "$out/frames5" --look-share 0.35 --second-look --init "$out/near2" --focus 0.5 \
    --batch 24 --rate 4e-3 --steps 4400 --seed 23 --out "$out/near3"
$python main.py train --data "$out/frames6" --look-share 0.35 --second-look --init "$out/near3" --focus 0.5 --batch 24 --rate 4e-3 \
    --steps 4000 --stop-after 1520 --seed 24 --out "$out/near4"
# The first look again, on new frames, and the second one on what is left to it then.
$python main.py train --data "$out/frames6" --data "$out/frames7" --look-share 0.35 --init "$out/near4" --focus 0.3 "${larger[@]}" \
    --rate 5e-3 --steps 9000 --seed 15 --out "$out/stage6"
$python main.py train --data "$out/frames7" --look-share 0.35 --second-look --init "$out/stage6" --focus 0.5 --batch 24 --rate 4e-3 \
    --steps 2000 --stop-after 1000 --seed 25 --out "$out/near5"
# And both once more.
$python main.py train --data "$out/frames6" --data "$out/frames7" --data "$out/frames8" --look-share 0.35 --init "$out/near5" --focus 0.3 \
    "${larger[@]}" --rate 5e-3 --steps 9500 --seed 16 --out "$out/stage7"
$python main.py train --data "$out/frames8" --look-share 0.35 --second-look --init "$out/stage7" --focus 0.5 --batch 24 --rate 4e-3 \
    --steps 1200 --seed 26 --out "$out/near6"
# And once more, with clips laid over the robot, and with frames in the twin's own look, which is in none of the random families.
$python main.py train --data "$out/frames7" --data "$out/frames8" --data "$out/frames9" --data "$out/frames10" --look-share 0.35 \
    --init "$out/near6" --focus 0.3 --strips 0.25 "${larger[@]}" --rate 4e-3 --steps 9800 --seed 17 --out "$out/stage8"
$python main.py train --data "$out/frames9" --data "$out/frames10" --look-share 0.35 --second-look --init "$out/stage8" --focus 0.5 \
    --batch 24 --rate 4e-3 --steps 1000 --seed 27 --out "$out/near7"
# The second look on frames that nobody has seen; now what lies around the robot's true ends counts five times.
$python main.py train --data "$out/frames11" --data "$out/frames12" --look-share 0.35 --second-look --init "$out/near7" --focus 0.5 \
    --end-weight 4 --batch 24 --rate 4e-3 --steps 7000 --seed 28 --out "$out/near8"
# And once more, on others that nobody has seen.
$python main.py train --data "$out/frames13" --data "$out/frames14" --look-share 0.35 --second-look --init "$out/near8" --focus 0.5 \
    --end-weight 4 --batch 24 --rate 4e-3 --steps 4800 --seed 29 --out "$out/near9"
# Made deeper on its fine levels, opaque channels more often; ended by hand, to go on with windows of which half come with what both
# looks saw in the end. (This first part was trained before there were such windows.)
sets=(--data "$out/frames15" --data "$out/frames16" --data "$out/frames17" --look-share 0.35)
$python main.py train "${sets[@]}" --second-look --deepen --init "$out/near9" --focus 0.5 --end-weight 4 --batch 24 --rate 4e-3 \
    --steps 7000 --stop-after 1130 --seed 30 --out "$out/near10"
$python main.py train "${sets[@]}" --second-look --init "$out/near10" --focus 0.5 --end-weight 4 --batch 24 --rate 4e-3 --steps 6000 \
    --seed 31 --out "$out/near11"
# Made wider on its fine levels: half of the wrong states are decided by a pixel or a few degrees.
sets=(--data "$out/frames18" --data "$out/frames19" --data "$out/frames20" --look-share 0.35)
$python main.py train "${sets[@]}" --second-look --widen --init "$out/near11" --focus 0.4 --end-weight 4 --batch 24 --rate 5e-3 \
    --steps 11000 --seed 33 --out "$out/near12"
# And once more, on others that nobody has seen.
$python main.py train --data "$out/frames21" --data "$out/frames22" --look-share 0.35 --second-look --init "$out/near12" --focus 0.4 \
    --end-weight 4 --batch 24 --rate 5e-3 --steps 12500 --seed 34 --out "$out/near13"
# And once more, on three times as many frames, two of three of which nobody has seen: it had begun to know the last ones.
sets=(--data "$out/frames21" --data "$out/frames22" --data "$out/frames23" --data "$out/frames24" --data "$out/frames25")
$python main.py train "${sets[@]}" --look-share 0.5 --second-look --init "$out/near13" --focus 0.4 --end-weight 4 --batch 24 --rate 5e-3 \
    --steps 12500 --stop-after 11704 --seed 35 --out "$out/near14"
# And once more, on others that nobody has seen; ended by hand, and its learning rate brought down on the first of them.
$python main.py train --data "$out/frames26" --data "$out/frames27" --look-share 0.5 --second-look --init "$out/near14" --focus 0.4 \
    --end-weight 4 --batch 24 --rate 5e-3 --steps 11000 --stop-after 6859 --seed 36 --out "$out/near15"
$python main.py train --data "$out/frames28" --data "$out/frames29" --look-share 0.5 --second-look --init "$out/near15" --focus 0.4 \
    --end-weight 4 --batch 24 --rate 2e-3 --steps 1200 --seed 37 --out "$out/near16"
# And once more, on others that nobody has seen; ended by hand after 1827 steps, to go on with a schedule that comes to its end.
sets=(--data "$out/frames30" --data "$out/frames31" --look-share 0.5)
$python main.py train "${sets[@]}" --second-look --init "$out/near16" --focus 0.4 --end-weight 4 --batch 24 --rate 5e-3 \
    --steps 8000 --stop-after 1827 --seed 38 --out "$out/near17"
$python main.py train "${sets[@]}" --second-look --init "$out/near17" --focus 0.4 --end-weight 4 --batch 24 --rate 4e-3 \
    --steps 2800 --seed 39 --out "$out/near18"
# And once more, on others that nobody has seen, also where a vessel's wall beside the robot's ends was wrong, and with more weight on
# the vessel: most of the wrong states were its.
$python main.py train --data "$out/frames32" --data "$out/frames33" --look-share 0.5 --second-look --init "$out/near18" --focus 0.4 \
    --end-weight 4 --robot-weight 0.75 --batch 24 --rate 4e-3 --steps 6300 --seed 40 --out "$out/near19"
# And once more, on others that nobody has seen, opaque channels and subtraction more often; ended by hand shortly before its end.
sets=(--data "$out/frames34" --data "$out/frames35" --data "$out/frames36" --data "$out/frames37" --data "$out/frames38")
$python main.py train "${sets[@]}" --look-share 0.5 --second-look --init "$out/near19" --focus 0.4 --end-weight 4 --robot-weight 0.75 \
    --batch 24 --rate 4e-3 --steps 14000 --stop-after 13101 --seed 42 --out "$out/near20"
# And once more, on others that nobody has seen.
sets=(--data "$out/frames39" --data "$out/frames40" --data "$out/frames41" --data "$out/frames42")
$python main.py train "${sets[@]}" --look-share 0.5 --second-look --init "$out/near20" --focus 0.4 --end-weight 4 --robot-weight 0.75 \
    --batch 24 --rate 4e-3 --steps 6500 --seed 44 --out "$out/near21"
# And once more, on others that nobody has seen.
sets=(--data "$out/frames43" --data "$out/frames44" --data "$out/frames45" --data "$out/frames46")
$python main.py train "${sets[@]}" --look-share 0.5 --second-look --init "$out/near21" --focus 0.4 --end-weight 4 --robot-weight 0.85 \
    --batch 32 --rate 4e-3 --steps 5200 --seed 47 --out "$out/near22"
# Both looks on new frames, nearly half of them of rigs of other kinds; the mean with what they began from forgets less of the ten families.
sets=(--data "$out/frames47" --data "$out/frames48" --look-share 0.5)
$python main.py train "${sets[@]}" --init "$out/near22" --focus 0.3 --strips 0.2 --end-weight 2 --crop 384 --batch 6 --rate 4e-3 \
    --steps 3600 --seed 50 --out "$out/stage9"
sets+=(--data "$out/frames49" --data "$out/frames50" --data "$out/frames51")
$python main.py train "${sets[@]}" --second-look --init "$out/stage9" --focus 0.4 --end-weight 4 --robot-weight 0.85 --batch 32 \
    --rate 3e-3 --steps 1800 --seed 51 --out "$out/near23"
$python main.py average "$out/near22" "$out/near23" --out "$out/mean1"
# Both once more, from that mean, and the mean again.
sets=(--data "$out/frames47" --data "$out/frames48" --data "$out/frames52" --data "$out/frames53" --look-share 0.5)
$python main.py train "${sets[@]}" --init "$out/mean1" --focus 0.3 --strips 0.2 --end-weight 2 --crop 384 --batch 6 --rate 4e-3 \
    --steps 5400 --seed 52 --out "$out/stage10"
sets+=(--data "$out/frames49" --data "$out/frames50" --data "$out/frames51")
$python main.py train "${sets[@]}" --second-look --init "$out/stage10" --focus 0.4 --end-weight 4 --robot-weight 0.85 --batch 32 \
    --rate 3e-3 --steps 1600 --seed 53 --out "$out/near24"
$python main.py average "$out/near22" "$out/near24" --out "$out/mean2"
# Both once more, on a GPU (an H200), for two and four minutes, which is where the numbers of steps come from; while the first one
# learnt, more frames were made for the second. Another GPU gives weights as good as these, not the same.
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames54" --count 2432 --seed 1206100 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames55" --count 800 --seed 1209000 "${wider[@]}" --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames56" --count 272 --seed 1193480 --family bench --workers 2
sets=(--data "$out/frames54" --data "$out/frames55" --data "$out/frames56" --look-share 0.5)
$python main.py train "${sets[@]}" --init "$out/mean2" --focus 0.3 --strips 0.2 --end-weight 2 --crop 384 --batch 192 --rate 6e-3 \
    --steps 1338 --seed 54 --out "$out/stage11"
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames54b" --count 5712 --seed 1206252 --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames55b" --count 1760 --seed 1209050 "${wider[@]}" --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames56b" --count 48 --seed 1193497 --family bench --workers 2
OMP_NUM_THREADS=1 $python main.py synth --out "$out/frames57" --count 592 --seed 1208500 --family opaque_channel --family subtraction \
    --workers 2
sets+=(--data "$out/frames54b" --data "$out/frames55b" --data "$out/frames56b" --data "$out/frames57")
$python main.py train "${sets[@]}" --second-look --init "$out/stage11" --focus 0.4 --end-weight 4 --robot-weight 0.85 --batch 384 \
    --rate 5e-3 --steps 2340 --seed 55 --out "$out/near25"
# And again on such a GPU, for four and seven minutes, every look with three poses of the robot, by a script that took the frames as
# they were made; here all are there from the start. Of so many at once as the second look had, `train` leaves the crops to the
# processor on an H200, too (it takes some 40000 there). The mean with what it began from answers right more often.
posed() { # NAME COUNT SEED [--family NAME]...
    OMP_NUM_THREADS=1 $python main.py synth --out "$out/$1" --count "$2" --seed "$3" "${@:4}" --poses 3 --workers 2
}
posed frames58 22704 1210000
posed frames59 7152 1220000 "${wider[@]}"
posed frames60 1584 1225000 --family opaque_channel --family subtraction
posed frames61 864 1193500 --family bench
sets=(--data "$out/frames58" --data "$out/frames59" --data "$out/frames60" --data "$out/frames61" --look-share 0.5)
$python main.py train "${sets[@]}" --init "$out/near25" --focus 0.3 --strips 0.2 --end-weight 2 --crop 384 --batch 192 --rate 6e-3 \
    --steps 2031 --seed 56 --out "$out/stage12"
posed frames58b 19200 1210473
posed frames59b 6384 1220149 "${wider[@]}"
posed frames60b 1440 1225033 --family opaque_channel --family subtraction
posed frames61b 672 1193518 --family bench
sets+=(--data "$out/frames58b" --data "$out/frames59b" --data "$out/frames60b" --data "$out/frames61b")
$python main.py train "${sets[@]}" --second-look --init "$out/stage12" --focus 0.4 --end-weight 4 --robot-weight 0.85 --batch 384 \
    --rate 5e-3 --steps 3309 --seed 57 --out "$out/near26"
$python main.py average "$out/near25" "$out/near26" --out "$out/default"

ten=(silicone_white silicone_red silicone_dark silicone_colour tinted_liquid opaque_channel clear_block backlit fluoroscopy subtraction)
OMP_NUM_THREADS=1 $python main.py synth --out "$out/calibration" --count 1248 --seed 950000 "${ten[@]/#/--family=}" "${wider[@]}" --workers 2
# The twin's own look is in none of the random families, and has to be known, too.
OMP_NUM_THREADS=1 $python main.py synth --out "$out/bench" --count 160 --seed 951000 --family bench --workers 2
$python main.py calibrate "$out/calibration" --knows "$out/bench" --eight-bit --model "$out/default"
OMP_NUM_THREADS=1 $python main.py synth --out "$out/test" --count 512 --seed 900000 --workers 2
$python main.py benchmark --accuracy "$out/test" --model "$out/default" --store
