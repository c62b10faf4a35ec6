# SPDX-License-Identifier: Apache-2.0
"""Parameter writes that wait for one drive share a line and a read-back, and nothing long is said while drives move."""

import struct
import time

from bridgelib import MOVING_BIT, RESULT_OK, RESULT_UNPROVEN, code, encode, eventually

LINE_MOVES = code("result", "line_moves")

# No two of them have anything to do with each other.
TEN = [("dar", 11), ("s1f", 3), ("s1r", 4), ("s2f", 3), ("s2r", 4), ("s3f", 3), ("s3r", 4), ("s4f", 3), ("zmd", 1),
       ("osv", 1)]


def write_all(bridge, settings, number=1):
    """Writes each by a request of its own, all at once; the exception codes by name, and the seconds it took."""
    with bridge.raw() as raw:
        begun = time.monotonic()
        send_all(bridge, raw, settings, number)
        codes = take_all(raw, settings)
        return codes, time.monotonic() - begun


def send_all(bridge, raw, settings, number=1):
    """Writes each by a request of its own, all at once."""
    drive = bridge.drive(number)
    for transaction, (name, value) in enumerate(settings):
        row = drive.row(name)
        words = encode(row.type, value)
        pdu = struct.pack(f">BHHB{len(words)}H", 16, row.address, len(words), 2 * len(words), *words)
        raw.send(raw.adu(transaction, number, pdu))


def raw_codes(raw, count):
    """The exception codes by transaction; answers come in any order."""
    codes = {}
    for _ in range(count):
        transaction, _, pdu = raw.receive()
        codes[transaction] = pdu[1] if pdu[0] & 0x80 else 0
    return codes


def take_all(raw, settings):
    """The exception codes by name."""
    return {settings[transaction][0]: got for transaction, got in raw_codes(raw, len(settings)).items()}


def test_a_stop_ends_what_waits_and_nothing_is_written_later(make_bridge):
    bridge = make_bridge(baud=9600, drives=2, modbus={"confirm-ms": 8000})
    drive = bridge.drive()
    before = {name: drive.read(name) for name, _ in TEN}
    mark = bridge.sim.mark()
    with bridge.raw() as raw:
        send_all(bridge, raw, TEN)
        eventually(lambda: lines(bridge, mark))
        assert drive.command("stop") == 0
        codes = take_all(raw, TEN)
    said = [line.strip(".") for line in bridge.sim.trace(">")[mark:]]
    stop = said.index("1 stp")
    written = " ".join(line for line in said[:stop] if line.startswith("1 cfg "))
    # What was on the wire ends truly, and what was not begun is cancelled.
    assert written
    assert codes == {name: 0 if f"{name}={value}" in written else 4 for name, value in TEN}, said
    # All stand again and are read; a later write of another kind finds nothing left over.
    assert drive.settle("read_parameters") == RESULT_OK
    after = [line.strip(".") for line in bridge.sim.trace(">")[mark + stop:]]
    assert not [line for line in after if line.startswith("1 cfg ")]
    for name, value in TEN:
        assert drive.read(name) == (value if f"{name}={value}" in written else before[name])


def test_a_stop_cancels_writes_that_were_not_begun(make_bridge):
    bridge = make_bridge(baud=9600, drives=2, modbus={"confirm-ms": 8000})
    drive = bridge.drive()
    # To one parameter, so that each needs a line of its own.
    ten = [("dar", value) for value in range(1, 11)]
    mark = bridge.sim.mark()
    with bridge.raw() as raw:
        send_all(bridge, raw, ten)
        eventually(lambda: lines(bridge, mark))
        assert drive.command("stop") == 0
        codes = [code for _, code in sorted(raw_codes(raw, len(ten)).items())]
    said = [line.strip(".") for line in bridge.sim.trace(">")[mark:]]
    begun = [line for line in said[:said.index("1 stp")] if line.startswith("1 cfg ")]
    assert 0 < len(begun) < len(ten)
    assert codes == [0] * len(begun) + [4] * (len(ten) - len(begun)), said
    assert drive.settle("read_parameters") == RESULT_OK
    assert drive.read("dar") == len(begun)
    assert [line for line in lines(bridge, mark) if line.startswith("1 cfg ")] == begun


def test_a_refused_save_is_not_counted_as_one(make_bridge):
    bridge = make_bridge(drives=2, bus={"save-interval-s": 60})
    one, two = bridge.drive(1), bridge.drive(2)
    assert one.command("enable") == 0
    assert one.command("move_velocity", target_velocity=500.0) == 0
    eventually(lambda: one.read("status") & MOVING_BIT)
    assert two.settle("save_parameters") == LINE_MOVES
    # The next command of that drive has its turn at once.
    assert two.command("enable") == 0
    assert one.command("stop") == 0
    bridge.wait_standing(1)
    assert two.settle("save_parameters") == RESULT_OK


def longest_exchange(bridge, mark):
    """Seconds from the beginning of a request to the end of its answer, at most, since then."""
    longest, begun, said = 0, None, 0
    for line in bridge.sim.trace_path.read_text(encoding="utf-8").splitlines():
        parts = line.split(" ", 3)
        if len(parts) != 4 or parts[2] not in "<>":
            continue
        if parts[2] == ">":
            said += 1
            begun = int(parts[0]) if said > mark else None
        elif begun is not None:
            longest = max(longest, int(parts[0]) - begun)
            begun = None
    return longest / 1e6


def test_what_a_stop_waits_for_beside_parameters_of_another_drive(make_bridge):
    """The longest exchange is what a stop waits for at most: it goes out as soon as the one on the wire has ended."""
    for baud in (9600, 115200):
        for moves in (False, True):
            bridge = make_bridge(baud=baud, drives=2, modbus={"confirm-ms": 5000})
            one, two = bridge.drive(1), bridge.drive(2)
            assert one.command("enable") == 0
            if moves:
                assert one.command("move_velocity", target_velocity=500.0) == 0
                eventually(lambda: one.read("status") & MOVING_BIT)
            mark = bridge.sim.mark() + 1
            for _ in range(3):
                assert set(write_all(bridge, TEN, number=2)[0].values()) == {0}
                two.command("read_parameters")
            longest = longest_exchange(bridge, mark)
            begun = time.monotonic()
            assert one.command("stop") == 0
            print(f"at {baud}, {'moving' if moves else 'idle'}: longest exchange {1000 * longest:.1f} ms,"
                  f" stop confirmed after {1000 * (time.monotonic() - begun):.0f} ms")
            # Two status reads: a request of six bytes and a frame of twenty, ten bits each, and what the drive thinks.
            if moves:
                assert longest <= 2 * (27 * 10 / baud + 0.002), longest
            bridge.finish()


def lines(bridge, mark, number=1):
    """What was said to the drive since, but its status."""
    said = [line.strip(".") for line in bridge.sim.trace(">")[mark:]]
    return [line for line in said if line.startswith(f"{number} cfg") or line == f"{number} sav"]


def test_ten_writes_share_lines_and_read_backs(make_bridge):
    for baud in (9600, 115200):
        bridge = make_bridge(baud=baud)
        mark = bridge.sim.mark()
        codes, seconds = write_all(bridge, TEN)
        said = lines(bridge, mark)
        print(f"ten writes at {baud}: {seconds:.2f} s, {said.count('1 cfg')} read-backs")
        assert set(codes.values()) == {0}
        assert said.count("1 cfg") <= 2 and len(said) <= 5, said
        assert {name: bridge.drive().read(name) for name, _ in TEN} == dict(TEN)
        bridge.finish()


def test_writes_to_one_parameter_keep_their_order(make_bridge):
    bridge = make_bridge()
    mark = bridge.sim.mark()
    codes, _ = write_all(bridge, [("dar", 5), ("zmd", 1), ("dar", 6), ("osv", 1), ("dar", 7)])
    assert set(codes.values()) == {0} and bridge.drive().read("dar") == 7
    written = " ".join(lines(bridge, mark))
    assert written.index("dar=5") < written.index("dar=6") < written.index("dar=7")


def test_a_refused_or_clamped_write_is_its_writers_alone(make_bridge):
    for clamps in (False, True):
        bridge = make_bridge(baud=9600, modbus={"confirm-ms": 8000}, sim_drive={"max-current": 2.5, "clamps": clamps})
        codes, _ = write_all(bridge, [*TEN[:4], ("crn", 5.0), *TEN[4:]])
        assert codes.pop("crn") == 4
        assert set(codes.values()) == {0}, codes
        assert {name: bridge.drive().read(name) for name, _ in TEN} == dict(TEN)
        bridge.finish()


def test_with_the_defaults_a_write_is_a_success(make_bridge):
    bridge = make_bridge(modbus={"confirm-ms": 40})
    drive = bridge.drive()
    for value in range(5, 10):
        begun = time.monotonic()
        assert drive.write("dar", value) == 0
        print(f"a write at 115200: {1000 * (time.monotonic() - begun):.0f} ms")
        eventually(lambda: drive.read("write_result") == RESULT_OK)
        assert drive.read("dar") == value


def test_a_stop_waits_for_no_parameters_of_another_drive(make_bridge):
    for baud in (9600, 115200):
        bridge = make_bridge(baud=baud, drives=2)
        one, two = bridge.drive(1), bridge.drive(2)
        assert one.command("enable") == 0
        assert one.command("move_velocity", target_velocity=500.0) == 0
        eventually(lambda: one.read("status") & MOVING_BIT)
        mark = bridge.sim.mark()
        codes, seconds = write_all(bridge, TEN, number=2)
        print(f"ten writes at {baud} while another moves: {seconds:.2f} s")
        assert set(codes.values()) == {0}
        assert one.command("stop") == 0
        said = [line.strip(".") for line in bridge.sim.trace(">")[mark:]]
        assert "2 cfg" not in said[:said.index("1 stp")]
        assert all(len(line) <= 40 for line in said)
        eventually(lambda: "2 cfg" in lines(bridge, mark, 2))
        eventually(lambda: {name: two.read(name) for name, _ in TEN} == dict(TEN))
        bridge.finish()


def test_a_save_is_refused_while_another_moves(make_bridge):
    bridge = make_bridge(drives=2, bus={"save-interval-s": 0})
    one, two = bridge.drive(1), bridge.drive(2)
    assert one.command("enable") == 0
    assert one.command("move_velocity", target_velocity=500.0) == 0
    eventually(lambda: one.read("status") & MOVING_BIT)
    mark = bridge.sim.mark()
    for command in ("save_parameters", "read_parameters"):
        assert two.settle(command) == LINE_MOVES
    assert not lines(bridge, mark, 2)
    assert one.command("stop") == 0
    bridge.wait_standing(1)
    assert two.settle("save_parameters") == RESULT_OK
    assert "2 sav" in lines(bridge, mark, 2)


def test_what_was_unproven_is_settled_when_all_stand(make_bridge):
    """The drive makes another value of one of them, and nobody can see it before the motion has ended."""
    bridge = make_bridge(drives=2, sim_drive={"max-current": 2.5, "clamps": True})
    one, two = bridge.drive(1), bridge.drive(2)
    for name, value, found, held in (("crn", 1.5, RESULT_OK, 1.5), ("crn", 5.0, code("result", "refused"), 2.5)):
        assert one.command("enable") == 0
        assert one.command("move_velocity", target_velocity=500.0) == 0
        eventually(lambda: one.read("status") & MOVING_BIT)
        assert two.write(name, value) == 0
        eventually(lambda: two.read("write_result") == RESULT_UNPROVEN)
        assert two.read("history1_result") == RESULT_UNPROVEN
        assert one.command("stop") == 0
        eventually(lambda: two.read("write_result") == found, what=f"the write of {value} to be settled")
        assert two.read("history1_result") == found and two.read(name) == held
    bridge.told("the drive acknowledged a write of parameter crn, but its value is 2.5")
