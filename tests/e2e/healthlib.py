# SPDX-License-Identifier: Apache-2.0
"""Values of the service's health as it would have left them in its file: a week that nobody has to wait for. The form is
described in src/bridge/health/ring.c."""

import math
import struct
import time
import zlib

HEAD, COLUMN, SLOT_HEAD, VALUE = 32, 40, 28, 16
HOURS = 168
MOST = 1024 * 1024
WIDTHS = (1, 15, 60)  # minutes
UNKNOWN = b"\xff\xff" + bytes(14)


def shape(drives):
    """Columns, and slots of each ring."""
    columns = min((drives + 7) // 8 * 8, 247)
    slot = SLOT_HEAD + columns * VALUE
    rest = (MOST - HEAD - columns * COLUMN - HOURS * slot) // slot
    quarters = min(max(rest // 4, 24), 96)
    return columns, (min(rest - quarters, 1440), quarters, HOURS)


def short(number):
    """Eleven bits, and how often they are doubled."""
    doubled = max(0, int(number).bit_length() - 11)
    return struct.pack("<H", doubled << 11 | int(number) >> doubled)


def value(minutes, *, lost=0.0, offline=0.0, mean_us=2600, hottest=None):
    """Of so many minutes at 50 questions a second: shares lost and offline."""
    exchanges = 3000 * minutes
    losses = exchanges * max(lost, offline)
    degrees = struct.pack("bb", -128, -128) if hottest is None else struct.pack("bb", hottest - 4, hottest)
    return b"".join(short(number) for number in (
        exchanges, losses * 0.8, losses, losses * 0.1, mean_us, mean_us * (3 if losses else 1.4),
        offline * minutes * 60000)) + degrees


def checked(data, place):
    return data[:place] + struct.pack("<I", zlib.crc32(data)) + data[place + 4:]


def write_week(folder, names, of, now=None):
    """A week that ends now. of(drive, hours) is what a drive was so many hours ago: keywords of value(), or None where it
    was not known; of(None, hours) is False where the service did not run."""
    now = now or time.time()
    columns, slots = shape(len(names))
    head = struct.pack("<8s6H10x", b"DBHEALTH", 1, columns, *slots, 0)[:18] + bytes(14)
    for number in range(columns):
        name = names[number].encode() if number < len(names) else b""
        head += struct.pack("<32sHxxI", name, number + 1 if name else 0, 0)
    parts = [checked(head, 18)]
    minutes = 7 * 24 * 60
    for ring, width in enumerate(WIDTHS):
        size = SLOT_HEAD + columns * VALUE
        made = [bytes(size)] * slots[ring]
        for number in range(max(0, minutes // width - slots[ring]), minutes // width):
            ago = (minutes - (number + 1) * width) / 60
            if of(None, ago) is False:
                continue
            told = [of(name, ago) for name in names]
            values = b"".join(UNKNOWN if one is None else value(width, **one) for one in told)
            values += UNKNOWN * (columns - len(names))
            body = struct.pack("<IHHIIIQ", 0, ring, width * 60, number, 1, minutes * 60 - math.ceil(ago * 3600),
                               int((now - ago * 3600) * 1e6)) + values
            made[number % slots[ring]] = struct.pack("<I", zlib.crc32(body[4:])) + body[4:]
        parts += made
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "values").write_bytes(b"".join(parts))
