#!/usr/bin/env bash
# Trains a scene of each capture with the default command and measures it on the photographs that are held out; prints a row of
# a Markdown table for each.
#
#   tools/measure/captures.sh OUTPUT FOLDER... [-- ARGUMENT...]
#
# Arguments behind -- go to `strivec train`, those of the photographs (--downscale, --every, --layout, --test-every,
# --test-names, --skip-missing) also to `strivec eval`. OUTPUT takes a folder for each capture: scene, log, evaluations, and a
# sheet of each held-out photograph with the picture of the scene. A capture whose evaluation is there is not trained again; one whose
# training was interrupted goes on.
#
# Environment: STRIVEC names another program than target/release/strivec. STRIVEC_LPIPS is the file of weights that
# tools/lpips/convert.py writes; without it, the column has a dash. PYTHON needs NumPy and Pillow for LPIPS.
set -euo pipefail

fail() {
    printf 'captures: %s\n' "$1" >&2
    exit 2
}

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
strivec=${STRIVEC:-$here/../../target/release/strivec}
python=${PYTHON:-python3}
(($# >= 2)) || fail "give a folder for the output and at least one capture; see the top of $0"
[[ -x $strivec ]] || fail "$strivec is no program; build it by cargo build --release, or set STRIVEC"
output=$1
shift
folders=()
while (($#)) && [[ $1 != -- ]]; do
    folders+=("$1")
    shift
done
(($# == 0)) || shift
training=("$@")
of_photographs=()
while (($#)); do
    case $1 in
    --downscale | --every | --layout | --test-every | --test-names) of_photographs+=("$1" "${2:?}") && shift ;;
    --downscale=* | --every=* | --layout=* | --test-every=* | --test-names=* | --skip-missing) of_photographs+=("$1") ;;
    esac
    shift
done

echo '| capture | dB | after a color fit | SSIM | LPIPS | dB of training views | minutes | CPU minutes | MB |'
echo '|---|---|---|---|---|---|---|---|---|'
for folder in "${folders[@]}"; do
    name=$(basename "$(cd "$folder" && pwd)")
    of_capture=$output/$name
    scene=$of_capture/scene.strivec
    mkdir -p "$of_capture"
    if [[ ! -s $of_capture/training-views.json ]]; then
        run=("${training[@]}")
        [[ ! -e $scene.state ]] || run=("${of_photographs[@]}" --resume)
        # Of several parts, the times add up.
        "$python" - "$of_capture/seconds.txt" "$of_capture/log.txt" \
            "$strivec" train "$folder" -o "$scene" --force --checkpoint-every 500 "${run[@]}" <<'PYTHON' ||
import os, subprocess, sys, time

times, log, *command = sys.argv[1:]
start = time.time()
with open(log, "a") as out:
    code = subprocess.run(command, stdout=out, stderr=out).returncode
used = os.times()
with open(times, "a") as out:
    print(time.time() - start, used.children_user + used.children_system, file=out)
sys.exit(code)
PYTHON
            fail "$folder: the training failed; see $of_capture/log.txt"
        "$strivec" --json --force eval "$scene" "$folder" --split test "${of_photographs[@]}" --sheets "$of_capture/sheets" \
            >"$of_capture/held-out.json"
        "$strivec" --json eval "$scene" "$folder" --split train "${of_photographs[@]}" >"$of_capture/training-views.json"
    fi
    lpips=-
    if [[ -n ${STRIVEC_LPIPS:-} ]]; then
        "$python" "$here/../lpips/measure.py" "$of_capture/sheets" --networks vgg >"$of_capture/lpips.json"
        lpips=$of_capture/lpips.json
    fi
    "$python" - "$name" "$of_capture" "$scene" "$lpips" <<'PYTHON'
import json, os, sys

name, folder, scene, lpips = sys.argv[1:]
read = lambda file: json.load(open(os.path.join(folder, file)))
held_out, training = read("held-out.json"), read("training-views.json")
wall, cpu = (sum(column) / 60 for column in zip(*(map(float, line.split()) for line in open(os.path.join(folder, "seconds.txt")))))
distance = "-" if lpips == "-" else f"{json.load(open(lpips))['lpips_vgg']['mean']:.3f}"
row = [name, f"{held_out['psnr']:.2f}", f"{held_out['psnr_after_color_fit']:.2f}", f"{held_out['ssim']:.3f}", distance, f"{training['psnr']:.2f}"]
print("|", " | ".join([*row, f"{wall:.1f}", f"{cpu:.1f}", f"{os.path.getsize(scene) / 1e6:.2f}"]), "|")
PYTHON
done
