#!/usr/bin/env bash
# Makes .venv ready to run LumenPilot: Python, system libraries, pinned packages. Does nothing when that is done already.
# PYTHON=/path/to/python chooses the interpreter: 3.11 (tested), 3.12 or 3.13. With the argument `packages` nothing is compiled.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

venv=.venv
stamp=$venv/.ready # holds what .venv was made from; written last, so an interrupted set-up leaves none
compiled=$venv/.compiled # holds where machine code lies, and what it was made from
half=$venv/.half # there from the beginning of a .venv until its packages are in: only such a one is thrown away
unset PYTHONPATH PYTHONHOME # of a ROS set-up, say: its packages would hide those of .venv
unset PYTHONSAFEPATH # would hide the program itself
export PIP_USER=0 # a pip.conf that says user=true would end every installation into .venv

# Shared library that is missing on a bare Debian 12 -> the package that has it.
libraries="
libGL.so.1 libgl1
libEGL.so.1 libegl1
libxkbcommon.so.0 libxkbcommon0
libfontconfig.so.1 libfontconfig1
libglib-2.0.so.0 libglib2.0-0
libdbus-1.so.3 libdbus-1-3
libusb-1.0.so.0 libusb-1.0-0
libxcb-cursor.so.0 libxcb-cursor0
libxcb-icccm.so.4 libxcb-icccm4
libxcb-keysyms.so.1 libxcb-keysyms1
libxcb-shape.so.0 libxcb-shape0
libxkbcommon-x11.so.0 libxkbcommon-x11-0
"

say() { printf '%s\n' "$*" >&2; }

stop() {
    say "set-up: $*"
    exit 1
}

is_right_python() { "$1" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' </dev/null 2>/dev/null; }

# Whether a program lies in .venv, which may be activated: what is about to be deleted cannot make the next one.
is_own() {
    local folder own
    folder=$(cd "$(dirname "$1")" && pwd -P) && own=$(cd "$venv" 2>/dev/null && pwd -P) && [[ $folder/ == "$own"/* ]]
}

find_python() {
    local candidate candidates
    if [[ -n ${PYTHON:-} ]]; then
        candidates=$(type -P "$PYTHON" || true)
    else
        candidates=$(type -aP python3.11 python3.12 python3.13 python3 || true)
    fi
    while IFS= read -r candidate; do
        if [[ -n $candidate ]] && ! is_own "$candidate" && is_right_python "$candidate"; then
            echo "$candidate"
            return
        fi
    done <<<"$candidates"
    stop "Python 3.11, 3.12 or 3.13 is needed, but ${PYTHON:-python3} is not one outside $venv.
  Debian 12 and 13, Ubuntu 24.04: sudo apt-get install python3-venv
  Ubuntu 22.04: sudo apt-get install python3.11 python3.11-venv    Fedora: sudo dnf install python3.11
  Elsewhere: uv python install 3.11, then: make PYTHON=\$(uv python find 3.11) run"
}

# Debian packages that this machine lacks, one line.
missing_packages() {
    local missing=()
    "$1" -c 'import ensurepip, venv' 2>/dev/null || missing+=("python$("$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])')-venv")
    # shellcheck disable=SC2086 # the table is meant to be split into words
    mapfile -t -O "${#missing[@]}" missing < <("$1" - $libraries <<'PYTHON_CODE'
import ctypes
import sys

for library, package in zip(sys.argv[1::2], sys.argv[2::2]):
    try:
        ctypes.CDLL(library)
    except OSError:
        print(package)
PYTHON_CODE
    )
    echo "${missing[*]}"
}

install_system_packages() {
    local python=$1 missing
    missing=$(missing_packages "$python")
    [[ -n $missing ]] || return 0
    local install="apt-get install --yes --no-install-recommends $missing"
    if ! command -v apt-get >/dev/null; then
        stop "these libraries are missing (Debian's names): $missing. Install your system's packages of them, then run make again."
    fi
    if ((EUID != 0)); then
        stop "system libraries are missing. Install them with
  sudo apt-get update && sudo $install
and run make again."
    fi
    say "set-up: installing system packages: $missing"
    export DEBIAN_FRONTEND=noninteractive
    # An unreachable extra source makes `update` fail; what counts is whether the packages can be had.
    apt-get update -qq </dev/null || say "set-up: 'apt-get update' failed, trying with the package lists at hand"
    # shellcheck disable=SC2086
    $install -qq -o DPkg::Lock::Timeout=120 </dev/null || stop "system packages could not be installed: $install"
    missing=$(missing_packages "$python")
    [[ -z $missing ]] || stop "still missing after installation: $missing"
}

is_whole() { [[ ! -f $half ]] && is_right_python "$venv/bin/python"; }

# Installed packages that requirements.lock does not list, one line; nor does it list what installs them, nor the optional packages.
unlisted_packages() {
    "$venv/bin/python" - <<'PYTHON_CODE'
import re
import sysconfig
from importlib import metadata


def plain(name):
    return re.sub(r"[-_.]+", "-", name).lower()


with open("requirements.lock", encoding="utf-8") as lock:
    listed = {plain(name) for name in re.findall(r"^([\w.-]+)==", lock.read(), re.MULTILINE)}
found = {plain(package.metadata["Name"]) for package in metadata.distributions(path=[sysconfig.get_path("purelib")])}
found = {name for name in found if not name.startswith(("nvidia-", "cuda-", "triton"))}  # torch's own
print(*sorted(found - listed - {"pip", "setuptools", "wheel", "pypylon"}))
PYTHON_CODE
}

install_python_packages() {
    local python=$1 unlisted torch
    if ! is_whole; then
        say "set-up: making $venv with $python (the first time takes some minutes)"
        mkdir -p "$venv"
        find "$venv/" -mindepth 1 -delete # what is in it: it may be a link to a larger disk
        : >"$half"
        "$python" -m venv "$venv"
    fi
    rm -f "$stamp"
    # Byte code of what is used comes with its first use, in a few seconds; of all packages it takes a minute. It is made now where it
    # could not be kept then: for other users, when an administrator sets up, or where Python is forbidden to (container images do so).
    local compile=--no-compile
    [[ -z ${PYTHONDONTWRITEBYTECODE:-} && ($EUID != 0 || -n ${CI:-}) ]] || compile=--compile
    # Wheels only: nothing is compiled from sources, and a machine that has no wheel is told so at once.
    local install=(-m pip install --no-input --disable-pip-version-check $compile --only-binary :all:)
    "$venv/bin/python" "${install[@]}" --requirement <(grep -v '^torch==' requirements.lock)
    # By itself, since it has no hash: which build is taken, and what that needs, depends on the machine (see requirements.lock).
    ! torch=$(grep '^torch==' requirements.lock) || "$venv/bin/python" "${install[@]}" "$torch"
    rm -f "$half"
    # openvino brings this package and reports every import with it; without it, openvino falls back to its own silent stub.
    "$venv/bin/python" -m pip uninstall --quiet --yes --disable-pip-version-check openvino-telemetry
    # What an earlier lock listed may stand in the way of what this one does; nothing is tested with it any more.
    unlisted=$(unlisted_packages)
    if [[ -n $unlisted ]]; then
        say "set-up: taking out what requirements.lock does not list: $unlisted"
        # shellcheck disable=SC2086
        "$venv/bin/python" -m pip uninstall --quiet --yes --disable-pip-version-check $unlisted
    fi
}

# The Numba kernels, which the first start would have to wait for. A failure here does not matter: the program compiles by itself.
compile_kernels() {
    local kernels=core/perception/kernels.py wanted folder
    wanted=$(cat requirements.lock $kernels <(stat -c %Y $kernels; pwd -P) | sha256sum)
    if [[ -f $compiled ]] && { read -r folder && read -r; } <"$compiled" && [[ $REPLY == "$wanted" ]]; then
        [[ $folder != None ]] && ! compgen -G "$folder/kernels.*.nbi" >/dev/null || return 0
    fi
    say "set-up: compiling (some 15 seconds)"
    folder=$("$venv/bin/python" -c 'from core.perception import kernels; print(kernels.arc_length.stats.cache_path)') || return 0
    { printf '%s\n' "$folder" "$wanted" >"$compiled"; } 2>/dev/null || true
}

install_all() {
    local wanted
    wanted=$(cat requirements.lock scripts/set_up.sh | sha256sum)
    if [[ -f $stamp && $(<"$stamp") == "$wanted" ]] && is_right_python "$venv/bin/python"; then
        return
    fi
    exec 9<requirements.lock
    flock 9 # a second `make` waits here and then finds the work done
    if [[ -f $stamp && $(<"$stamp") == "$wanted" ]] && is_right_python "$venv/bin/python"; then
        return
    fi
    local python
    python=$venv/bin/python # to renew what works no other one is needed
    is_whole || python=$(find_python)
    install_system_packages "$python"
    install_python_packages "$python"
    echo "$wanted" >"$stamp"
    say "set-up: done"
}

install_all
[[ ${1:-} == packages ]] || compile_kernels
