# SPDX-License-Identifier: Apache-2.0
"""drivebridge-opcua when somebody acts, or would like to: methods, parameters, the command block, users and their
roles, certificates, sessions and their loss, events."""

import asyncio
import contextlib
import re
import shutil
import signal
import socket

import pytest
from asyncua import ua
from asyncua.common.events import Event
from asyncua.ua.uaerrors import UaStatusCodeError
from bridgelib import CONTINUOUS, MOVE_VELOCITY, RESULT_OK, RESULT_REFUSED, RESULT_UNPROVEN, STANDSTILL
from opcualib import (  # noqa: F401
    OPERATOR,
    READER,
    Follower,
    Server,
    at,
    call,
    connect,
    cut,
    event_of,
    fixture_certificate,
    fixture_make_server,
    in_loop,
    outcome,
    make_certificate,
    says,
    until,
)
from relay import Relay

# Of the status of a simulated stepper.
OVER_CURRENT = 1 << 21

# What a simulated stepper takes for each command's arguments.
ARGUMENTS = {
    "MoveVelocity": (800.0,), "MoveAbsolute": (3200, 0.0), "MoveRelative": (100, 0.0), "SetPosition": (0,),
    "SetOutput": (1, 1), "SetOutputs": (3, 1), "SetSv": (1, 100), "SetNmos": (1, 100),
    "ShakeStart": (0, 320, 2.0, 1), "ShakeStartTime": (0, 320, 2.0, 1),
}


# --- methods


@in_loop
async def test_nobody_is_served_before_the_drives_are_known(make_bridge, make_server, certificate):
    """A client that was there before knows the nodes' ids: that there is no such method, or no such value, would be wrong."""
    bridge = make_bridge()
    server = make_server(bridge)
    async with server.session(certificate, OPERATOR) as session:
        drive, stop, velocity = (at(session, name).nodeid for name in ("drive1", "drive1.Stop", "drive1.VelocityActualValue"))
    server.kill()
    bridge.process.send_signal(signal.SIGSTOP)
    try:
        server.start()
        connecting = asyncio.ensure_future(connect(server.client(certificate, OPERATOR)))
        await asyncio.wait([connecting], timeout=0.5)
    finally:
        bridge.process.send_signal(signal.SIGCONT)
    session = await connecting
    called = (await session.uaclient.call([ua.CallMethodRequest(drive, stop, [])]))[0]
    assert called.StatusCode.name == "Good", called
    assert (await session.uaclient.read_attributes([velocity], ua.AttributeIds.Value))[0].StatusCode.name != "BadNodeIdUnknown"
    await session.disconnect()


@in_loop
async def test_a_service_that_does_not_come_keeps_nobody_waiting(make_server, certificate):
    server = make_server(None)
    session = await connect(server.client(certificate, OPERATOR))
    assert await at(session, "/Drives").get_children() == []
    await session.disconnect()


@in_loop
async def test_methods(make_bridge, make_server, certificate):
    """Each command of the drive by its method ends as its registers say; what a drive cannot, may not or does not do is said by the
    status, and by the reason."""
    bridge = make_bridge(drive={"max-position": 100000, "min-position": -100000})
    server = make_server(bridge)
    unit = bridge.drive()
    async with server.session(certificate, OPERATOR) as session:
        await call(session, "drive1", "Enable")
        methods = {(await node.read_browse_name()).Name for node in await at(session, "drive1").get_methods()}
        refused = set()
        for name in sorted(methods - {"Enable", "Disable"}):
            try:
                result, reason = await call(session, "drive1", name, *ARGUMENTS.get(name, ()))
                assert result in ("ok", "unproven", "pending") and reason == "", name
                await until(lambda: unit.read("result") in (RESULT_OK, RESULT_UNPROVEN), what=name)
            except ua.uaerrors.BadInvalidState:
                assert unit.read("result") == RESULT_REFUSED, name
                refused.add(name)
            await call(session, "drive1", "Stop")
            await until(lambda: at_rest(session))
        # It has no fault to clear, no way to home by, and no outputs that are set up.
        assert refused <= {"ClearFault", "Home", "SetOutput", "SetOutputs", "SetSv", "SetNmos"}
        await call(session, "drive1", "MoveAbsolute", 6400, 0.0)
        await until(lambda: unit.read("position") == 6400)

        for arguments, why in (((), "BadArgumentsMissing"), ((1, 2.0, 3), "BadTooManyArguments"),
                               ((100001, 0.0), "BadOutOfRange"), ((0, float("nan")), "BadOutOfRange")):
            with says(why):
                await call(session, "drive1", "MoveAbsolute", *arguments)
        with says("BadInvalidArgument"):
            await at(session, "drive1").call_method(at(session, "drive1.MoveAbsolute"),
                                                    ua.Variant("far", ua.VariantType.String),
                                                    ua.Variant(0.0, ua.VariantType.Float))
        with says("BadMethodInvalid"):
            await at(session, "drive1").call_method(at(session, "drive1.Jump"))
        assert unit.read("position") == 6400

        bridge.sim.fault("silence on")
        await until(lambda: is_bad_now(at(session, "drive1.PositionActualValue")))
        with says("BadNoCommunication"):
            await call(session, "drive1", "MoveAbsolute", 0, 0.0)


async def good_now(node):
    return (await node.read_data_value(raise_on_bad_status=False)).StatusCode.is_good()


async def is_bad_now(node):
    return (await node.read_data_value(raise_on_bad_status=False)).StatusCode.is_bad()


async def at_rest(session):
    return not await at(session, "drive1.Bits.Moving").read_value()


@in_loop
async def test_a_stop_does_not_wait_for_others(make_bridge, make_server, certificate):
    """While the method of one session waits for a drive that is silent, another's Stop is carried out and answered; who has
    waited is let go, and nobody takes that for a success."""
    bridge = make_bridge(drives=2)
    server = make_server(bridge, commands={"confirm-ms": 1000})
    clock = asyncio.get_running_loop().time
    async with server.session(certificate, OPERATOR) as one, server.session(certificate, OPERATOR) as two:
        await call(two, "drive2", "Enable")
        await call(two, "drive2", "MoveVelocity", 1600.0)
        bridge.sim.fault("silence on", "drive1")

        async def was_let_go():
            begin = clock()
            waits = asyncio.create_task(outcome(one, "drive1", "Stop"))
            # It may be overtaken: then it waits for as long as it may.
            await asyncio.sleep(0.02)
            assert (await call(two, "drive2", "Stop"))[0] in ("ok", "pending")
            status, result, reason = await waits
            assert (status, result) == ("BadRequestNotComplete", "pending") and reason
            return clock() - begin < 0.8

        assert await was_let_go() or await was_let_go() or await was_let_go()
        bridge.wait_standing(2)


@in_loop
async def test_nothing_is_done_late(make_bridge, make_server, certificate):
    """A drive is unplugged while it moves: methods end with why not, and as soon as was promised; when it is there again
    it stops, and does nothing of what was refused to it, or has waited."""
    bridge = make_bridge(drive={"counts-per-unit": 320.0})
    server = make_server(bridge, commands={"confirm-ms": 500})
    unit = bridge.drive()
    async with server.session(certificate, OPERATOR) as session:
        await call(session, "drive1", "Enable")
        await call(session, "drive1", "MoveVelocity", 1600.0)
        bridge.sim.fault("silence on")
        for command in (("Stop",), ("MoveRelative", 640000, 0.0), ("Stop",), ("MoveVelocity", 3200.0), ("QuickStop",)):
            begin = asyncio.get_running_loop().time()
            status, result, reason = await outcome(session, "drive1", *command)
            assert status.startswith("Bad") and result not in ("ok", "unproven") and reason, command
            # A machine that is busy with other things is late, too.
            assert asyncio.get_running_loop().time() - begin < 0.5 + 1.5, command
        block = at(session, "drive1.CommandBlock.Command")
        with contextlib.suppress(UaStatusCodeError):
            await block.write_value(3, ua.VariantType.Int32)
        said = len(bridge.sim.trace(">"))
        bridge.sim.fault("silence off")
        await until(lambda: good_now(at(session, "drive1.PositionActualValue")))
        bridge.wait_standing()
        assert (await call(session, "drive1", "Stop"))[0] in ("ok", "pending")
        assert not [line for line in bridge.sim.trace(">")[said:] if re.match("1 (mov|pos|rmv)", line)]
        stands = unit.read("position")
        # It is commanded as before, and what comes is what is told now.
        assert (await call(session, "drive1", "MoveAbsolute", stands + 320, 0.0))[0] in ("ok", "pending")
        await until(lambda: unit.read("position") == stands + 320 and unit.read("axis_state") == STANDSTILL)


@in_loop
async def test_stops_of_many_silent_drives_leave_room(make_bridge, make_server, certificate):
    """More drives are silent than the server has connections for what acts: each stop is taken all the same, and so is
    that of the drive that hears it."""
    bridge = make_bridge(drives=18)
    server = make_server(bridge, commands={"confirm-ms": 20})
    async with server.session(certificate, OPERATOR) as session:
        for number in range(1, 18):
            bridge.sim.fault("silence on", f"drive{number}")
        requests = [ua.CallMethodRequest(at(session, f"drive{number}").nodeid, at(session, f"drive{number}.Stop").nodeid,
                                         [])
                    for number in range(1, 19)]
        ends = [result.StatusCode.name for result in await session.uaclient.call(requests)]
        assert "BadResourceUnavailable" not in ends
        assert ends.count("BadRequestNotComplete") > 16


@in_loop
async def test_a_stop_while_others_fill_the_control_socket(make_bridge, make_server, certificate):
    """This program's own connections are there already; that for the stop is a new one."""
    bridge = make_bridge()
    server = make_server(bridge)
    async with server.session(certificate, OPERATOR) as session:
        await call(session, "drive1", "Enable")
        await call(session, "drive1", "MoveVelocity", 1600.0)
        with contextlib.ExitStack() as stack:
            for _ in range(64):
                line = stack.enter_context(socket.socket(socket.AF_UNIX))
                line.connect(str(bridge.control_path))
            assert (await outcome(session, "drive1", "Stop"))[:2] in (("Good", "ok"), ("BadRequestNotComplete", "pending"))
            bridge.wait_standing()


@in_loop
async def test_the_service_ends_while_a_method_waits(make_bridge, make_server, certificate):
    """Whether the drive has done it, nobody knows then: not what a client may take for "nothing happened"."""
    bridge = make_bridge()
    server = make_server(bridge, commands={"confirm-ms": 1000})
    async with server.session(certificate, OPERATOR) as session:
        await call(session, "drive1", "Enable")
        bridge.sim.fault("silence on")
        known = len(bridge.sim.trace(">"))
        waits = asyncio.create_task(outcome(session, "drive1", "Stop"))
        await until(lambda: any("stp" in line for line in bridge.sim.trace(">")[known:]))
        bridge.process.kill()
        bridge.process.wait()
        status, result, reason = await waits
        assert (status, result) == ("BadUnknownResponse", "indeterminate") and reason
        # Nothing was told: that is known.
        assert (await outcome(session, "drive1", "Stop"))[0] == "BadNoCommunication"
        bridge.sim.fault("silence off")
        bridge.units = {}
        bridge.start_bridge()


@in_loop
async def test_what_moves_is_fed_while_somebody_waits(make_bridge, make_server, certificate):
    """The methods of one session wait for a drive that is unplugged, each for longer than the watchdog of another one's
    drive has."""
    bridge = make_bridge(drives=2, drive={"watchdog-ms": 600})
    server = make_server(bridge, commands={"confirm-ms": 1000})
    unit = bridge.drive(2)
    async with server.session(certificate, OPERATOR) as one, server.session(certificate, OPERATOR) as two:
        await call(two, "drive2", "Enable")
        await call(two, "drive2", "MoveVelocity", 1600.0)
        bridge.sim.fault("silence on", "drive1")
        for _ in range(3):
            assert (await outcome(one, "drive1", "Stop"))[:2] == ("BadRequestNotComplete", "pending")
        assert unit.read("watchdog_trips") == 0 and unit.read("axis_state") == CONTINUOUS
        assert (await call(two, "drive2", "Stop"))[0] in ("ok", "pending")
        bridge.wait_standing(2)


# --- age


@in_loop
async def test_what_is_asked_for_late_moves_nothing(make_bridge, make_server, certificate):
    """A session that has written the service's clock once says with each motion how old that is: behind half a second it
    is refused, and a stop never is. Sessions that do not write it are served as before."""
    bridge = make_bridge(drives=2)
    server = make_server(bridge)
    async with server.session(certificate, OPERATOR) as session, server.session(certificate, OPERATOR) as other:
        clock = at(session, "/Gateway.Clock")

        async def too_old(*command):
            return (await outcome(session, "drive1", *command))[:2] == ("BadInvalidTimestamp", "TooOld")

        await call(session, "drive1", "Enable")
        await call(other, "drive2", "Enable")
        token = await clock.read_value()
        assert token and token != await until(lambda: other_value(clock, token))
        # The machine may be busy for longer than a token lasts.
        await until(lambda: started(session, clock))
        await clock.write_value(token, ua.VariantType.String)
        await asyncio.sleep(0.6)
        assert await too_old("MoveAbsolute", 3200, 0.0)
        block = at(session, "drive1.CommandBlock.Command")
        with says("BadInvalidTimestamp"):
            await block.write_value(MOVE_VELOCITY, ua.VariantType.Int32)
        assert (await call(session, "drive1", "Stop"))[0] in ("ok", "pending")
        assert (await call(session, "drive1", "Disable"))[0] in ("ok", "pending")
        assert (await call(session, "drive1", "Enable"))[0] in ("ok", "pending")
        assert (await call(other, "drive2", "MoveAbsolute", 320, 0.0))[0] in ("ok", "pending")
        await clock.write_value("no token", ua.VariantType.String)
        assert await too_old("MoveAbsolute", 3200, 0.0)
        with says("BadOutOfRange"):
            await clock.write_value(64 * "x", ua.VariantType.String)
        await clock.write_value("", ua.VariantType.String)
        assert (await call(session, "drive1", "MoveAbsolute", 320, 0.0))[0] in ("ok", "pending")
    async with server.session() as reader:
        with says("BadUserAccessDenied"):
            await at(reader, "/Gateway.Clock").write_value("", ua.VariantType.String)


async def other_value(node, value):
    """None while it is that."""
    found = await node.read_value()
    return found if found != value else None


async def started(session, clock):
    """Whether a motion with a token of now was."""
    await clock.write_value(await clock.read_value(), ua.VariantType.String)
    return (await outcome(session, "drive1", "MoveAbsolute", 640, 0.0))[1] in ("ok", "pending")


# --- groups


@pytest.mark.parametrize("control", ["off", "drive"])
@in_loop
async def test_groups(make_bridge, make_server, certificate, control):
    """What is staged starts together, also where this session has control of the drives, and is fed for as long as the
    session lives; the gateway's stop stops all, and waits for nobody's method."""
    bridge = make_bridge(drives=3, drive={"watchdog-ms": 600}, modbus={"control": control})
    server = make_server(bridge, commands={"confirm-ms": 1000})
    units = [bridge.drive(1), bridge.drive(2)]
    start, stop = at_gateway("GroupStart"), at_gateway("GroupStop")

    async def stand(*which):
        await until(lambda: all(unit.read("axis_state") == STANDSTILL for unit in which))

    async def stage(session, speed):
        for drive, unit in zip(("drive1", "drive2"), units):
            await call(session, drive, "Enable")
            await until(lambda: unit.read("active_command") == 0 and unit.read("status") & 2)
            if control == "drive":
                await at(session, f"{drive}.ControlRequest").write_value(1, ua.VariantType.UInt16)
            block = [at(session, f"{drive}.CommandBlock.{name}") for name in ("TargetVelocity", "StagedCommand")]
            await session.write_values(block, [ua.Variant(speed, ua.VariantType.Float),
                                               ua.Variant(5, ua.VariantType.Int32)])

    async with server.session(certificate, OPERATOR) as session:
        await stage(session, 1600.0)
        # For longer than what was told before would be fed.
        await asyncio.sleep(1.2)
        await start(session)
        await until(lambda: all(unit.read("velocity") == 1600.0 for unit in units))
        await asyncio.sleep(1.2)
        assert [(unit.read("axis_state"), unit.read("watchdog_trips")) for unit in units] == 2 * [(CONTINUOUS, 0)]
        bridge.sim.fault("silence on", "drive3")
        waits = asyncio.create_task(outcome(session, "drive3", "Stop"))
        await asyncio.sleep(0.02)
        with contextlib.suppress(UaStatusCodeError):
            await stop(session)
        await stand(*units)
        assert (await waits)[0] == "BadRequestNotComplete"
        assert "gateway: write of group_stop by olga" in server.log()
        bridge.sim.fault("silence off", "drive3")

        await stage(session, 800.0)
        await start(session)
        await until(lambda: all(unit.read("velocity") == 800.0 for unit in units))
        await call(session, "drive2", "Stop")
        await stand(units[1])
        assert units[0].read("axis_state") == CONTINUOUS
    # A session that is gone is the loss of a client.
    await until(lambda: units[0].read("watchdog_trips") == 1 and units[0].read("velocity") == 0)


def at_gateway(name):
    """A function that writes 1 there."""
    return lambda session: at(session, f"/Gateway.{name}").write_value(1, ua.VariantType.UInt16)


# --- parameters and the command block


@in_loop
async def test_writing(bridge, make_server, certificate):
    """Parameters within their range, with their type, of who may; and commands by the block, for clients without
    methods."""
    server = make_server(bridge)
    unit = bridge.drive()
    async with server.session(certificate, OPERATOR) as session:
        speed = at(session, "drive1.Parameters.spd")
        await speed.write_value(3200.0, ua.VariantType.Float)
        assert unit.read("spd") == 3200 and await speed.read_value() == 3200
        with says("BadOutOfRange"):
            await speed.write_value(1e6, ua.VariantType.Float)
        with says("BadTypeMismatch"):
            await speed.write_value("fast", ua.VariantType.String)
        for name in ("drive1.PositionActualValue", "drive1.History.Result"):
            with says("BadNotWritable", "BadUserAccessDenied"):
                await at(session, name).write_value(5, ua.VariantType.Int32)
        assert unit.read("spd") == 3200

        block = [at(session, f"drive1.CommandBlock.{name}") for name in ("TargetPosition", "Command")]
        await call(session, "drive1", "Enable")
        await session.write_values(block, [ua.Variant(3200, ua.VariantType.Int32),
                                           ua.Variant(6, ua.VariantType.Int32)])
        await until(lambda: unit.read("position") == 3200)
        # It is in the history, with who did it; as in the log.
        await until(lambda: newest(session, "Command", 6))
        assert await newest(session, "Address", "control, user root")
        assert await newest(session, "User", OPERATOR[0])
        assert (unit.read("history1_address"), unit.read("history1_user")) == ("control, user root", OPERATOR[0])
        assert f"by {OPERATOR[0]} at 127.0.0.1: ok" in server.log()
    async with server.session(certificate, READER) as session:
        for node, value in ((at(session, "drive1.Parameters.spd"), ua.Variant(1.0, ua.VariantType.Float)),
                            (at(session, "drive1.CommandBlock.Command"), ua.Variant(2, ua.VariantType.Int32))):
            with says("BadUserAccessDenied"):
                await node.write_value(value)
        assert unit.read("spd") == 3200


async def newest(session, column, value):
    read = await at(session, f"drive1.History.{column}").read_data_value(raise_on_bad_status=False)
    return read.Value.Value and read.Value.Value[0] == value


# --- who may


@in_loop
async def test_roles(bridge, make_server, certificate):
    """Observers read, and stop; who has no name, and an operator over a connection without security, reads and nothing else
    (test_roles.py has the rest); wrong passwords and unknown names get no session."""
    server = make_server(bridge)
    unit = bridge.drive()
    unit.settle("enable")
    for how in ((certificate, READER), (certificate, None), (None, None), (None, OPERATOR)):
        try:
            async with server.session(*how) as session:
                assert await at(session, "drive1.PositionActualValue").read_value() == 0
                # Synchronous methods and asynchronous ones go different ways in the library.
                for name in ("MoveRelative", "Disable") if how == (certificate, READER) else ("MoveRelative", "Stop", "Disable"):
                    with says("BadUserAccessDenied", "BadNotExecutable"):
                        await call(session, "drive1", name, *ARGUMENTS.get(name, ()))
                with says("BadUserAccessDenied", "BadNotWritable"):
                    await at(session, "drive1.Parameters.spd").write_value(1.0, ua.VariantType.Float)
        except UaStatusCodeError:
            # Passwords need not be taken at all where nothing is encrypted.
            assert how == (None, OPERATOR)
    for user in ((OPERATOR[0], "wrong"), ("nobody", OPERATOR[1]), (OPERATOR[0], "")):
        with says("BadUserAccessDenied", "BadIdentityTokenRejected", "BadIdentityTokenInvalid"):
            await connect(server.client(certificate, user))
    assert unit.read("position") == 0 and unit.read("status") & 2

    server.stop()
    server.sections["security"].update({"none": "off", "anonymous": "off"})
    server.start()
    with says("BadSecurityPolicyRejected", "BadSecurityModeRejected", "BadIdentityTokenRejected",
              "BadSecurityChecksFailed", "BadIdentityTokenInvalid"):
        await connect(server.client())
    with says("BadIdentityTokenRejected", "BadIdentityTokenInvalid", "BadUserAccessDenied"):
        await connect(server.client(certificate))
    async with server.session(certificate, READER) as session:
        assert await at(session, "drive1.PositionActualValue").read_value() == 0


@in_loop
async def test_users_change_while_they_are_connected(make_bridge, make_server, certificate):
    """Who is taken away, or gets another role or password, is logged out; what he moves stands, as when his connection is
    lost. Others notice nothing."""
    bridge = make_bridge(drive={"watchdog-ms": 600})
    server = make_server(bridge)
    unit = bridge.drive()
    name = OPERATOR[0]
    users = server.users_path.read_text(encoding="utf-8")
    line = next(one for one in users.splitlines() if one.startswith(name))

    def change(new):
        made = server.place / "new-users"
        made.write_text(users.replace(line, new), encoding="utf-8")
        made.chmod(0o640)
        made.replace(server.users_path)

    async with server.session(certificate, READER) as reader:
        for trips, new in enumerate(("", line.replace("operator", "reader"), line[:-1] + ("x" if line[-1] != "x" else "y")), 1):
            change(line)
            async with server.session(certificate, OPERATOR) as session:
                with contextlib.suppress(UaStatusCodeError):
                    await call(session, "drive1", "ClearFault")
                await call(session, "drive1", "Enable")
                await call(session, "drive1", "MoveVelocity", 1600.0)
                await until(lambda: unit.read("axis_state") == CONTINUOUS)
                change(new)
                await until(lambda: unit.read("watchdog_trips") == trips)
                bridge.wait_standing()
                with pytest.raises((UaStatusCodeError, ConnectionError)):
                    await call(session, "drive1", "ClearFault")
            assert f"{name} at 127.0.0.1: closed, for the file of users has changed" in server.log()
        assert await at(reader, "drive1.PositionActualValue").read_value() == unit.read("position")


@in_loop
async def test_certificates(bridge, make_server, certificate, tmp_path):
    """Nobody but who is trusted gets in; who is not lies among the rejected ones, and gets in as soon as that file was
    moved among the trusted."""
    server = make_server(bridge)
    stranger = make_certificate(tmp_path, "stranger")
    expired = make_certificate(tmp_path, "expired", begin=-30, end=-1)
    server.trust(expired)
    # Why is not told to who may be an attacker.
    for wrong in (stranger, expired):
        with pytest.raises((UaStatusCodeError, ConnectionError, asyncio.TimeoutError)):
            await connect(server.client(wrong, OPERATOR))
    rejected = await until(lambda: [path for path in (server.pki / "rejected").rglob("*")
                                    if path.is_file() and path.read_bytes() == stranger.der])
    # What nobody can trust is not kept for it, and the log does not send anybody to move it.
    assert list((server.pki / "rejected").iterdir()) == rejected
    assert re.search(r"a client's certificate is not valid now.* \(.*expired.*\)", server.log())
    assert server.log().count("to trust it, move") == 1
    shutil.move(rejected[0], server.pki / "trusted" / "stranger.der")
    async with server.session(stranger, OPERATOR) as session:
        await call(session, "drive1", "Enable")
    with pytest.raises((UaStatusCodeError, ConnectionError)):
        await connect(server.client(stranger, OPERATOR, uri="urn:somebody:else"))
    # A file that does not belong there trusts nobody, and is named.
    for folder, name in (("trusted", "notes.txt"), ("issuers", "notes.txt"), ("revoked", None)):
        stray = server.pki / folder / "notes.txt"
        stray.write_text("whom we trust, and why")
        with pytest.raises((UaStatusCodeError, ConnectionError, asyncio.TimeoutError)):
            await connect(server.client(stranger, OPERATOR))
        assert f"{stray if name else f'a file in {stray.parent}'} is none that belongs there" in server.log()
        stray.unlink()
    async with server.session(stranger, OPERATOR) as session:
        await call(session, "drive1", "Enable")
    # Its own certificate is the same for ever, and its key is nobody else's.
    own = [path for path in (server.pki / "own").rglob("*") if path.is_file()]
    before = {path: path.read_bytes() for path in own}
    assert any(path.stat().st_mode & 0o077 == 0 for path in own)
    server.stop()
    server.start()
    assert {path: path.read_bytes() for path in own} == before
    async with server.session(certificate, OPERATOR):
        pass


@in_loop
async def test_the_best_endpoint(make_bridge, make_server):
    """A client that chooses by itself takes the first or the one with the highest level: encrypted, and of the best policy."""
    server = make_server(make_bridge())
    found = await server.client().connect_and_get_server_endpoints()
    assert [(one.SecurityPolicyUri.split("#")[1], one.SecurityMode.name) for one in found] == [
        *((policy, mode) for mode in ("SignAndEncrypt", "Sign")
          for policy in ("Aes256_Sha256_RsaPss", "Aes128_Sha256_RsaOaep", "Basic256Sha256")), ("None", "None_")]
    levels = [one.SecurityLevel for one in found]
    assert levels == sorted(set(levels), reverse=True) and levels[-1] == 0


# --- sessions and their loss


@in_loop
async def test_the_loss_of_a_session_stops_the_drive(make_bridge, make_server, certificate):
    """A session that lives feeds what it moves, however little it says; pulled out, or on a line that stands still,
    it is lost, and the watchdog stops the drive. So does the end of the server."""
    bridge = make_bridge(drive={"watchdog-ms": 1000})
    server = make_server(bridge, commands={"silence-ms": 2500})
    unit = bridge.drive()

    async def begin(session):
        with contextlib.suppress(UaStatusCodeError):
            await call(session, "drive1", "ClearFault")
        await call(session, "drive1", "Enable")
        await call(session, "drive1", "MoveVelocity", 1600.0)
        await until(lambda: unit.read("axis_state") == CONTINUOUS)

    async def trips(count):
        await until(lambda: unit.read("watchdog_trips") == count)
        bridge.wait_standing()

    async with server.session(certificate, OPERATOR) as session:
        await begin(session)
        # It says something every second, of its own.
        await asyncio.sleep(3)
        assert unit.read("watchdog_trips") == 0 and unit.read("axis_state") == CONTINUOUS
        cut(session)
        await trips(1)
    with Relay(server) as relay:
        client = server.client(certificate, OPERATOR)
        client._server_url = client._server_url._replace(netloc=f"127.0.0.1:{relay.port}")
        await connect(client)
        await begin(client)
        relay.hold()
        await trips(2)
        cut(client)
    async with server.session(certificate, OPERATOR) as session:
        await begin(session)
        server.kill()
        await trips(3)
    server.start()


@in_loop
async def test_a_closed_connection_is_a_loss_at_once(make_bridge, make_server, certificate):
    """As when the client's program ends: nobody waits for it to be silent for long, and nothing is done over and over
    until then."""
    bridge = make_bridge(drive={"watchdog-ms": 1000})
    server = make_server(bridge, commands={"silence-ms": 60000})
    unit = bridge.drive()
    async with server.session(certificate, OPERATOR) as session:
        await call(session, "drive1", "Enable")
        await call(session, "drive1", "MoveVelocity", 1600.0)
        await until(lambda: unit.read("axis_state") == CONTINUOUS)
        cut(session)
        await until(lambda: unit.read("watchdog_trips") == 1)
        bridge.wait_standing()


@in_loop
async def test_nobody_takes_a_session_over(make_bridge, make_server, certificate):
    """Who knows the secret of an operator's session, but is somebody else: he does not get it, and who has it notices
    nothing."""
    bridge = make_bridge(drive={"watchdog-ms": 1000})
    server = make_server(bridge)
    unit = bridge.drive()
    async with server.session(certificate, OPERATOR) as session:
        await call(session, "drive1", "Enable")
        await call(session, "drive1", "MoveVelocity", 1600.0)
        thief = await connect(server.client())
        thief.uaclient.protocol.authentication_token = session.uaclient.protocol.authentication_token
        with says("BadIdentityChangeNotSupported"):
            await thief.activate_session()
        with says("BadSecureChannelIdInvalid"):
            await thief.nodes.server_state.read_value()
        assert unit.read("axis_state") == CONTINUOUS
        assert (await call(session, "drive1", "Stop"))[0] in ("ok", "pending")
        bridge.wait_standing()
        cut(thief)


@in_loop
async def test_as_many_sessions_as_are_allowed(bridge, make_server, certificate):
    """Twenty are served side by side, one more is told that it is too many, and gets in when another one went."""
    server = make_server(bridge, limits={"sessions": 20})
    async with contextlib.AsyncExitStack() as stack:
        sessions = [await stack.enter_async_context(server.session()) for _ in range(20)]
        values = await asyncio.gather(*(at(one, "drive1.PositionActualValue").read_value() for one in sessions))
        assert values == [0] * 20
        with says("BadTooManySessions"):
            await connect(server.client())
        await sessions.pop().disconnect()
        async with server.session() as session:
            assert await at(session, "drive1.PositionActualValue").read_value() == 0


# --- events


@in_loop
async def test_events(make_bridge, make_server, certificate):
    """A loss, a watchdog's trip and a fault of a drive are events of that drive and of no other, at the server's own node as
    well, each a type of its own with its severity."""
    bridge = make_bridge(drives=2, drive={"watchdog-ms": 300})
    server = make_server(bridge)
    unit = bridge.drive(2)
    async with server.session() as session:
        everything = await Follower(session).start(events=(session.nodes.server,))
        own = await Follower(session).start(events=(at(session, "drive2"),))
        other = await Follower(session).start(events=(at(session, "drive1"),))
        unit.settle("enable")
        unit.settle("move_velocity", target_velocity=1600)
        tripped = await until(lambda: event_of(own, "WatchdogTripped"))
        bridge.wait_standing(2)
        bridge.sim.control(f"bits drive2 {OVER_CURRENT:#x}")
        fault = await until(lambda: event_of(own, "DriveFault"))
        bridge.sim.control("bits drive2 0")
        gone = await until(lambda: event_of(own, "DriveFaultGone"))
        bridge.sim.fault("silence on", "drive2")
        lost = await until(lambda: event_of(own, "DriveLost"), 30)
        bridge.sim.fault("silence off", "drive2")
        back = await until(lambda: event_of(own, "DriveOnline"), 30)
        events = (tripped, fault, gone, lost, back)
        await until(lambda: event_of(everything, "DriveOnline"))
        assert [one.Severity for one in events] == [900, 900, 300, 600, 300]
        for one in events:
            assert one.SourceName == "drive2" and one.SourceNode == at(session, "drive2").nodeid
            assert one.Time <= one.ReceiveTime and one.Message.Text
            same = await until(lambda one=one: [same for same in everything.events if same.Message == one.Message])
            assert [each.EventType for each in same] == [one.EventType]
        assert [one.Time for one in events] == sorted(one.Time for one in events)
        assert not other.events


@in_loop
async def test_events_of_all_drives_at_once(make_bridge, make_server):
    """None is lost to a client that asks for a queue of one, as many do."""
    bridge = make_bridge(drives=32, baud=921600)
    server = make_server(bridge)
    async with server.session() as session:
        follower = Follower(session)
        subscription = await session.create_subscription(1000, follower)
        await subscription.subscribe_events(session.nodes.server, queuesize=1)
        for number in range(1, 33):
            bridge.sim.control(f"bits drive{number} {OVER_CURRENT:#x}")
        faults = lambda: [one.SourceName for one in follower.events if one.EventType.Identifier == "DriveFaultEventType"]
        await until(lambda: len(faults()) == 32)
        assert set(faults()) == {f"drive{number}" for number in range(1, 33)}


@in_loop
async def test_more_events_than_wait(make_bridge, make_server, monkeypatch):
    """The newest eighty are kept, and before them stands that others are missing."""
    bridge = make_bridge(drives=32, baud=921600)
    server = make_server(bridge)
    came = []

    def keep(_, fields):
        came.append(fields)
        return Event()

    # asyncua reads no event that has fewer fields than were asked for, nor what came with it.
    monkeypatch.setattr(Event, "from_event_fields", keep)
    async with server.session() as session:
        subscription = await session.create_subscription(100, Follower(session))
        await subscription.subscribe_events(session.nodes.server, queuesize=1)
        await subscription.set_publishing_mode(False)
        for bits in (OVER_CURRENT, 0) * 4:
            for number in range(1, 33):
                bridge.sim.control(f"bits drive{number} {bits:#x}")
            await until(lambda bits=bits: all(
                bool(bridge.drive(number).read("error")) == bool(bits) for number in range(1, 33)))
        del came[:]
        await subscription.set_publishing_mode(True)
        await until(lambda: len(came) >= 81)
        missing = [place for place, fields in enumerate(came) if len(fields) == 1]
        assert missing == [0] and came[0][0].Value.Identifier == ua.ObjectIds.EventQueueOverflowEventType


@in_loop
async def test_listeners_of_a_drive_that_changes(make_bridge, make_server):
    """A reload changes the drive: who listens to its events, and follows its values, goes on; who ends that meanwhile has
    ended it."""
    bridge = make_bridge(drives=2)
    server = make_server(bridge)
    async with server.session() as session:
        drive = at(session, "drive2")
        position = at(session, "drive2.PositionActualValue")
        followers = [await Follower(session).start([position], events=(drive,)) for _ in range(3)]
        for unit in ("mm", "deg"):
            bridge.sections["drive drive2"].update({"counts-per-unit": 320.0, "unit-name": unit})
            bridge.reload()
            await until(lambda unit=unit: is_in(session, unit))
            await followers.pop().subscription.delete()
            bridge.sim.control(f"bits drive2 {OVER_CURRENT:#x}")
            for follower in followers:
                fault = await until(lambda follower=follower: event_of(follower, "DriveFault"))
                assert fault.SourceNode == drive.nodeid
            bridge.sim.control("bits drive2 0")
            for follower in followers:
                await until(lambda follower=follower: event_of(follower, "DriveFaultGone"))
                await until(lambda follower=follower: follower.status(position).is_good())
                follower.events.clear()


async def is_in(session, unit):
    """Whether the position is said to be in this unit."""
    with contextlib.suppress(UaStatusCodeError):
        property_node = await at(session, "drive2.PositionActualValueUnits").get_child("0:EngineeringUnits")
        return (await property_node.read_value()).DisplayName.Text == unit
    return False
