#!/usr/bin/env bash
# Puts LumenPilot into the desktop's menu of this user, or takes it out again: desktop.sh install|uninstall
# Writes three files below ~/.local (XDG_DATA_HOME where it is set): a launcher, a desktop entry and the icon. Each carries a mark, and
# only files with the mark are ever replaced or removed. An installed package has its launcher already: LUMENPILOT_COMMAND is its path.
set -euo pipefail
checkout=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)
mark="made by LumenPilot's make install"

: "${HOME:?desktop.sh: HOME is not set}"
data=${XDG_DATA_HOME:-}
[[ $data == /* ]] || data=$HOME/.local/share # the specification: a path that is not absolute does not count
launcher=${LUMENPILOT_COMMAND:-$HOME/.local/bin/lumenpilot}
entry=$data/applications/lumenpilot.desktop
icon=$data/icons/hicolor/scalable/apps/lumenpilot.svg
files=("$entry" "$icon")
[[ -n ${LUMENPILOT_COMMAND:-} ]] || files+=("$launcher")

stop() {
    printf 'desktop.sh: %s\n' "$*" >&2
    exit 1
}

is_ours() { [[ -f $1 && ! -L $1 ]] && grep -qF "$mark" "$1"; }

# A string argument of the Exec line: in quotes, with " ` $ and \ escaped, the backslash twice, and % doubled.
exec_argument() {
    local text=$1
    text=${text//\\/\\\\\\\\}
    text=${text//\"/\\\\\"}
    text=${text//\`/\\\\\`}
    text=${text//\$/\\\\\$}
    printf '"%s"' "${text//%/%%}"
}

write_launcher() {
    cat <<LAUNCHER
#!/usr/bin/env bash
# $mark; make uninstall removes it
checkout=$(printf '%q' "$checkout")
if [[ ! -x \$checkout/.venv/bin/python ]]; then
    echo "lumenpilot: \$checkout is not set up (or was moved): run make install there again" >&2
    exit 1
fi
unset PYTHONPATH PYTHONHOME # of a ROS set-up, say: its packages would hide those of .venv
exec "\$checkout/.venv/bin/python" "\$checkout/main.py" "\$@"
LAUNCHER
}

write_entry() {
    local program
    program=$(exec_argument "$launcher")
    cat <<ENTRY
[Desktop Entry]
# $mark; make uninstall removes it
$(printf '%s\n' "${made[@]/#/# folder }")
Type=Application
Version=1.5
Name=LumenPilot
GenericName=Robot teleoperation assist
Comment=Perception, advice and control for a tendon-driven interventional robot
Exec=$program
TryExec=${launcher//\\/\\\\}
Icon=lumenpilot
Terminal=false
Categories=Science;Robotics;
Keywords=robot;catheter;vessel;phantom;teleoperation;
StartupNotify=true
StartupWMClass=LumenPilot
Actions=tour;

[Desktop Action tour]
Name=Show the tour
Exec=$program gui --tour
ENTRY
}

write_icon() {
    cat "$checkout/resources/icons/lumenpilot.svg"
    printf '<!-- %s -->\n' "$mark"
}

# Folders that were not there before are remembered in the desktop entry, and taken away with it.
made=()
remember_folders() {
    ! is_ours "$entry" || mapfile -t made < <(sed -n 's/^# folder //p' "$entry")
    local path folder
    for path in "${files[@]}"; do
        folder=$(dirname "$path")
        while [[ ! -d $folder ]]; do
            made+=("$folder")
            folder=$(dirname "$folder")
        done
    done
    mapfile -t made < <(printf '%s\n' "${made[@]}" | sed '/^$/d' | sort -ru) # the inner ones first
}

# The file appears whole or not at all.
put() {
    local path=$1 mode=$2 writer=$3
    mkdir -p "$(dirname "$path")"
    "$writer" >"$path.new"
    chmod "$mode" "$path.new"
    mv -f "$path.new" "$path"
    echo "wrote    $path"
}

renew_menu() {
    if command -v update-desktop-database >/dev/null; then
        update-desktop-database -q "$data/applications" || true
    fi
}

install_all() {
    local path
    for path in "${files[@]}"; do
        [[ ! -e $path && ! -L $path ]] || is_ours "$path" || stop "$path is there and is not ours: move it away, then run make install again"
    done
    remember_folders
    [[ -n ${LUMENPILOT_COMMAND:-} ]] || put "$launcher" 755 write_launcher
    put "$icon" 644 write_icon
    put "$entry" 644 write_entry
    renew_menu
    case ":$PATH:" in
    *":$(dirname "$launcher"):"*) echo "start it from the desktop's menu, or with: lumenpilot" ;;
    *) echo "start it from the desktop's menu, or with: $launcher (its folder is not in your PATH)" ;;
    esac
}

uninstall_all() {
    local path found=
    remember_folders
    for path in "${files[@]}"; do
        if is_ours "$path"; then
            rm -f "$path"
            echo "removed  $path"
            found=1
        elif [[ -e $path || -L $path ]]; then
            echo "left     $path: it is not ours"
        fi
    done
    [[ ! -d $data/applications ]] || renew_menu
    for path in "${made[@]}"; do
        rmdir "$path" 2>/dev/null || true # others have put something there since
    done
    [[ -n $found ]] || echo "nothing to remove"
}

case ${1:-} in
install) install_all ;;
uninstall) uninstall_all ;;
*) stop "usage: desktop.sh install|uninstall" ;;
esac
