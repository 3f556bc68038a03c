"""What the EEPROM of a servo was before this program changed it: kept in a file, once per servo, and restored from there.

DYNAMIXEL X servos tell no serial number, so a servo is known by the adapter's port, its id and its model. Of a servo that was
exchanged for another of the same id and model the file of the first one stays.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from core.config.safety import JointConfig, ServosConfig
from core.config.servo_models import model_name
from core.devices import UserError
from hardware.servos.bus_ipc import ask_for_port
from hardware.servos.dynamixel_port import ServoError, ServoLine, WrongServo

EEPROM_BYTES = 64
"""The EEPROM area: registers 0 to 63."""
CHANGED = {
    9: ("return delay", 1),
    10: ("drive mode", 1),
    11: ("operating mode", 1),
    20: ("homing offset", 4),
    44: ("velocity limit", 4),
    60: ("startup configuration", 1),
}
"""Name and bytes of the registers that the driver changes, by address."""
_TORQUE = 64
_FORMAT = 1


@dataclass(frozen=True, slots=True)
class EepromBackup:
    """A servo's EEPROM (``EEPROM_BYTES``) as it was at ``made_utc``."""

    made_utc: str
    table: bytes


def backups_folder() -> Path:
    """Where the backups are; it need not exist."""
    from core.config.files import settings_folder

    return settings_folder() / "servos"


def keep_eeprom(folder: Path, port: str, table: bytes) -> None:
    """Save a servo's EEPROM, unless it was saved before: what this program has made of it must not replace what it was.

    Raises ServoError: the file cannot be written.
    """
    path = _path(folder, port, table[7], int.from_bytes(table[:2], "little"))
    if path.exists():
        return
    from core.files import write_atomic  # OpenCV with it, which the servo bus process else does without

    made_utc = datetime.now(UTC).replace(microsecond=0).isoformat()
    content = {"format": _FORMAT, "made_utc": made_utc, "port": port, "firmware": table[6], "eeprom": table.hex(" ")}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomic(path, (json.dumps(content, indent=1) + "\n").encode(), durable=True)
    except OSError as error:
        raise ServoError(
            "{path}: the servo's EEPROM cannot be saved ({why}), so it is not changed: make room, or the folder writable",
            path=path,
            why=error.strerror,
        ) from None


def read_backup(folder: Path, port: str, servo_id: int, model: int) -> EepromBackup | None:
    """The backup of a servo; None where it is missing. Raises UserError for a file that is no backup."""
    path = _path(folder, port, servo_id, model)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        table = bytes.fromhex(content["eeprom"])
        backup = EepromBackup(str(content["made_utc"]), table)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError):
        raise UserError(f"{path}: no backup of a servo: restore that servo with DYNAMIXEL Wizard 2") from None
    if len(table) != EEPROM_BYTES or table[7] != servo_id or int.from_bytes(table[:2], "little") != model:
        raise UserError(f"{path}: the backup of another servo: restore that servo with DYNAMIXEL Wizard 2")
    return backup


def restore_eeprom(servos: ServosConfig, folder: Path, say: Callable[[str], object]) -> int:
    """Write back what the driver has changed in the servos, as far as there are backups; returns the number of servos restored.

    Nothing moves, and the torque must be off. All is checked before anything is written.

    Raises UserError, ServoError: no backups, no answer, another model, torque on.
    """
    assert servos.port is not None
    kept = {joint.id: read_backup(folder, servos.port, joint.id, servos.model_of(joint).number) for joint in servos.joints}
    if not any(kept.values()):
        raise UserError(f"there is no backup of these servos in {folder}: the program has not changed any")
    ask_for_port(servos.port, relaxed=True)  # a bus process of this program may watch servos that hold: it relaxes them
    line = ServoLine(servos.port, servos.baud)
    line.open()
    try:
        for joint in servos.joints:
            _check_unchanged(line, joint, servos)
        for joint in servos.joints:
            backup = kept[joint.id]
            if backup is None:
                say(f"{joint.name} (id {joint.id}): no backup, left as it is")
            else:
                changed = ", ".join(_write_back(line, joint, backup)) or "nothing to restore"
                say(f"{joint.name} (id {joint.id}), as of {backup.made_utc}: {changed}")
    finally:
        line.close()
    return sum(backup is not None for backup in kept.values())


def _check_unchanged(line: ServoLine, joint: JointConfig, servos: ServosConfig) -> None:
    """Raise WrongServo when the servo is of another model, or holds."""
    model, expected = int.from_bytes(line.read(joint.id, 0, 2), "little"), servos.model_of(joint).number
    if model != expected:
        raise WrongServo(f"servo {joint.name} (id {joint.id}) is {model_name(model)}, not {model_name(expected)}: set its id")
    if line.read(joint.id, _TORQUE, 1) != b"\0":
        raise WrongServo(f"servo {joint.name} (id {joint.id}) holds: switch the torque off first (the wires go slack)")


def _write_back(line: ServoLine, joint: JointConfig, backup: EepromBackup) -> list[str]:
    """Restore the registers that differ; returns what was done."""
    now, done = line.read(joint.id, 0, EEPROM_BYTES), []
    for address, (name, size) in CHANGED.items():
        before, after = now[address : address + size], backup.table[address : address + size]
        if before != after:
            line.write(joint.id, address, after)
            if line.read(joint.id, address, size) != after:
                raise WrongServo(f"servo {joint.name} (id {joint.id}) keeps its {name}: restore it with DYNAMIXEL Wizard 2")
            done.append(f"{name} {_number(before)} -> {_number(after)}")
    return done


def _number(data: bytes) -> int:
    return int.from_bytes(data, "little", signed=len(data) == 4)


def _path(folder: Path, port: str, servo_id: int, model: int) -> Path:
    """One file per port, id and model."""
    adapter = re.sub(r"[^\w.-]", "_", Path(port).name)
    return folder / f"{adapter}_id{servo_id}_model{model}.json"
