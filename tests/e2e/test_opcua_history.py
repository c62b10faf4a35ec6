# SPDX-License-Identifier: Apache-2.0
"""How a drive was, and who did what with it, as a client of OPC UA (asyncua) reads it: what the service has kept over
restarts."""

import datetime

from asyncua import ua
from bridgelib import eventually
from opcualib import at, call, fixture_certificate, fixture_make_server, in_loop, type_at, until  # noqa: F401
from test_audit import records, state  # noqa: F401
from test_health import health
from test_roles import USERS, method, users_text

INTERVALS = 3
# No time at all is the begin of OPC UA's.
NEVER = datetime.datetime(1601, 1, 1, tzinfo=datetime.timezone.utc)


def date(us):
    return datetime.datetime(1970, 1, 1, tzinfo=datetime.timezone.utc) + datetime.timedelta(microseconds=us)


async def read(session, name, start=None, end=None, most=0, bounds=False, after=None):
    """One answer: its status, the values, and where the next one begins."""
    details = ua.ReadRawModifiedDetails()
    details.IsReadModified = False
    details.StartTime, details.EndTime = start or NEVER, end or NEVER
    details.NumValuesPerNode, details.ReturnBounds = most, bounds
    result = await history_read(session, at(session, name), details, after)
    values = getattr(result.HistoryData, "DataValues", None)
    return result.StatusCode.name, values or [], result.ContinuationPoint


async def history_read(session, node, details, after=None):
    wanted = ua.HistoryReadValueId()
    wanted.NodeId = node.nodeid
    wanted.ContinuationPoint = after
    request = ua.HistoryReadParameters()
    request.HistoryReadDetails = details
    request.TimestampsToReturn = ua.TimestampsToReturn.Both
    request.ReleaseContinuationPoints = False
    request.NodesToRead = [wanted]

    async def ask():
        # A busy service does not hold up others' stops.
        result = (await session.uaclient.history_read(request))[0]
        return result.StatusCode.name != "BadResourceUnavailable" and result

    return await until(ask)


@in_loop
async def test_what_was_kept_of_round_trips(state, make_bridge, make_server):  # noqa: F811
    bridge = make_bridge()
    for _ in range(INTERVALS):
        # Each end of the service ends an interval.
        eventually(lambda: health(bridge)["running"][0]["span_s"] >= 1)
        bridge.stop_bridge()
        bridge.start_bridge()
    kept = eventually(lambda: len(health(bridge)["values"]) >= INTERVALS and health(bridge)["values"])
    kept = kept[:INTERVALS]
    times = [date(one["end_us"]) for one in kept]
    mean = "drive1.Service.RoundTripMeanUs"
    server = make_server(bridge)
    async with server.session() as session:
        node = at(session, mean)
        level = (await node.read_attribute(ua.AttributeIds.UserAccessLevel)).Value.Value
        assert level & 4 and (await node.read_attribute(ua.AttributeIds.Historizing)).Value.Value is True
        late = times[-1] + datetime.timedelta(microseconds=1)
        status, values, after = await read(session, mean, times[0], late)
        assert (status, after) == ("Good", None)
        assert [(one.SourceTimestamp, one.Value.Value) for one in values] == [
            (when, one["round_trip_us"]) for when, one in zip(times, kept)]
        # By the client's own function; backwards; a page at a time.
        # That one asks for bounds: what comes next is the last one.
        own = [one.SourceTimestamp for one in await node.read_raw_history(times[0], late)]
        assert own[:INTERVALS] == times and len(own) == INTERVALS + 1
        back = [one.SourceTimestamp for one in (await read(session, mean, late, date(1)))[1]]
        assert back == times[::-1]
        status, values, after = await read(session, mean, times[0], late, most=2)
        assert status == "Good" and len(values) == 2 and after
        status, values, after = await read(session, mean, times[0], late, most=2, after=after)
        assert [one.SourceTimestamp for one in values] == times[2:] and not after
        # The longest of an interval is another variable.
        _, values, _ = await read(session, "drive1.Service.RoundTripMaxUs", times[0], late)
        assert [one.Value.Value for one in values] == [one["round_trip_longest_us"] for one in kept]
        # What is next to the bounds, and what is not there.
        _, values, _ = await read(session, mean, date(10), times[0], bounds=True)
        assert [one.StatusCode.name for one in values] == ["BadBoundNotFound", "Good"]
        assert (await read(session, mean, date(10), date(20)))[0] == "GoodNoData"
        for name, wanted in (("drive1.PositionActualValue", "BadHistoryOperationUnsupported"),
                             ("/Gateway.DriveCount", "BadHistoryOperationUnsupported"),
                             ("drive1.Nope", "BadNodeIdUnknown")):
            assert (await read(session, name, times[0], late))[0] == wanted
        assert (await read(session, mean, times[0]))[0] == "BadHistoryOperationInvalid"
        assert (await read(session, mean, times[0], late, after=b"x"))[0] == "BadContinuationPointInvalid"


STANDARD = ("EventId", "EventType", "SourceNode", "SourceName", "Time", "Message", "Severity", "Status", "ServerId",
            "ClientUserId")
OWN = ("Number", "Kind", "What", "Details", "Result", "RecordOf", "TookUs")


def selected(session, names=(*STANDARD, *OWN, "NoSuchField")):
    made = ua.EventFilter()
    for name in names:
        one = ua.SimpleAttributeOperand()
        one.TypeDefinitionId = type_at(session, "AuditTrailEventType").nodeid
        one.BrowsePath = [ua.QualifiedName(name, 0 if name in STANDARD else session.types)]
        one.AttributeId = ua.AttributeIds.Value
        made.SelectClauses.append(one)
    return made


async def read_events(session, node, start=None, end=None, most=0, after=None, wanted=None):
    """One answer: its status, each event as a dictionary, and where the next one begins."""
    details = ua.ReadEventDetails()
    details.StartTime, details.EndTime = start or NEVER, end or NEVER
    details.NumValuesPerNode = most
    details.Filter = wanted or selected(session)
    result = await history_read(session, node, details, after)
    names = [one.BrowsePath[0].Name for one in details.Filter.SelectClauses]
    events = [dict(zip(names, (field.Value for field in event.EventFields)))
              for event in getattr(result.HistoryData, "Events", None) or []]
    return result.StatusCode.name, events, result.ContinuationPoint


async def read_all_events(session, *arguments, **options):
    """All pages."""
    found, after = [], None
    while True:
        status, events, after = await read_events(session, *arguments, after=after, **options)
        assert status in ("Good", "GoodNoData")
        found += events
        if not after:
            return found


@in_loop
async def test_who_did_what(state, make_bridge, make_server, certificate):  # noqa: F811
    """Past events are the audit trail: by drive and as a whole, in both directions, in pages, over a restart; for those who may
    read it."""
    bridge = make_bridge(drives=2)
    server = make_server(bridge)
    server.users_path.write_text(users_text(), encoding="utf-8")
    long_ago = date(1)
    async with server.session(certificate, USERS["engineer"][:2]) as session:
        for drive, command, *arguments in (("drive1", "Enable"), ("drive1", "MoveAbsolute", 640, 640.0), ("drive2", "Enable"),
                                           ("drive1", "Stop"), ("drive2", "Disable")):
            await call(session, drive, command, *arguments)
        assert await method("MoveAbsolute", 640, 640.0, drive="drive2")(session) == "BadInvalidState"
        bridge.stop_bridge()
        bridge.start_bridge()
        await until(at(session, "/Drives").get_children, timeout=40, what="drives")
        # A login is a record when the server is connected to the service; the first one of this test may have been too early.
        await until(lambda: "is there again" in server.log(), what="the service")
        async with server.session(certificate, USERS["engineer"][:2]):
            await until(lambda: any(one["kind"] == "login" for one in records(bridge)), what="the record of a login")
        server_node = session.get_node(ua.ObjectIds.Server)
        for node in (server_node, at(session, "/Drives"), at(session, "drive1")):
            notifier = (await node.read_attribute(ua.AttributeIds.EventNotifier)).Value.Value
            assert notifier & 4, node
        # What drivebridgectl has, in the same order.
        now = datetime.datetime.now(datetime.timezone.utc)
        for name in ("drive1", "drive2"):
            kept = [one for one in records(bridge, "--drive", name) if date(one["time_us"]) < now]
            found = await read_all_events(session, at(session, name), long_ago, now)
            assert [one["Number"] for one in found] == [one["number"] for one in kept] and len(kept) >= 3
            for event, record in zip(found, kept):
                assert event["Time"] == date(record["time_us"]) and event["EventId"] == b"audit %d" % record["number"]
                assert (event["Kind"], event["What"], event["Result"], event["ClientUserId"], event["RecordOf"]) == tuple(
                    record.get(key) for key in ("kind", "what", "result", "who", "of"))
                assert event["SourceNode"] == at(session, name).nodeid and event["SourceName"] == name
                assert event["EventType"] == type_at(session, "AuditTrailEventType").nodeid
                assert event["ServerId"] == "urn:gw:drivebridge" and event["NoSuchField"] is None
        move = next(one for one in found if one["What"] == "move_absolute")
        assert "for egon, OPC UA, 127.0.0.1" in move["ClientUserId"]
        assert move["Details"] == "move_absolute target_position=640 target_velocity=640.0"
        assert move["Message"].Text == f"{move['Details']}: {move['Result']}"
        refusal = next(one for one in found if one["What"] == "move_absolute" and one["Result"] == "refused")
        assert (refusal["Status"], refusal["Severity"]) == (False, 600) and (found[0]["Status"], found[0]["Severity"]) == (True, 300)
        # The whole; backwards, in pages.
        whole = await read_all_events(session, server_node, long_ago, now)
        assert {"service", "login", "command"} <= {one["Kind"] for one in whole}
        assert await read_all_events(session, at(session, "/Drives"), long_ago, now) == whole
        for options in ({"start": now, "end": long_ago, "most": 3}, {"end": now, "most": 4}, {"start": now, "end": long_ago}):
            assert await read_all_events(session, server_node, **options) == whole[::-1], options
        assert await read_all_events(session, server_node, start=long_ago, end=now, most=2) == whole
        status, events, after = await read_events(session, server_node, start=long_ago, most=2)
        assert (status, events) == ("Good", whole[:2]) and after
        # Between two moments: the first bound is included.
        first, last = whole[2], whole[-2]
        between = [one for one in whole if first["Time"] <= one["Time"] < last["Time"]]
        assert await read_all_events(session, server_node, first["Time"], last["Time"]) == between
        assert (await read_events(session, server_node, long_ago, date(2)))[:2] == ("GoodNoData", [])
        # By the client's own function, whose filter has a list of types.
        own = await at(session, "drive2").read_event_history(long_ago, now, 0, type_at(session, "AuditTrailEventType"))
        assert [one.Number for one in own] == [one["Number"] for one in found]
        other = ua.ContentFilterElement()
        other.FilterOperator = ua.FilterOperator.OfType
        other.FilterOperands = [ua.LiteralOperand(Value=ua.Variant(type_at(session, "DriveEventType").nodeid))]
        wanted = selected(session)
        wanted.WhereClause.Elements = [other]
        assert (await read_events(session, server_node, long_ago, now, wanted=wanted))[:2] == ("GoodNoData", [])
        other.FilterOperands = [ua.LiteralOperand(Value=ua.Variant(ua.NodeId(ua.ObjectIds.AuditEventType)))]
        assert (await read_events(session, server_node, long_ago, now, wanted=wanted))[1] == whole
        other.FilterOperator = ua.FilterOperator.IsNull
        for node, status, options in (
                (at(session, "drive1.PositionActualValue"), "BadHistoryOperationUnsupported", {}),
                (at(session, "/Gateway"), "BadHistoryOperationUnsupported", {}),
                (at(session, "drive9"), "BadNodeIdUnknown", {}),
                (server_node, "BadHistoryOperationInvalid", {"end": None}),
                (server_node, "BadContinuationPointInvalid", {"after": b"x"}),
                (server_node, "BadEventFilterInvalid", {"wanted": ua.EventFilter()}),
                (server_node, "BadFilterOperatorUnsupported", {"wanted": wanted})):
            assert (await read_events(session, node, **{"start": long_ago, "end": now, **options}))[0] == status
