# SPDX-License-Identifier: Apache-2.0
"""How a drive was, as a client of OPC UA (asyncua) reads it: what the service has kept over restarts."""

import datetime

from asyncua import ua
from bridgelib import eventually
from opcualib import at, fixture_certificate, fixture_make_server, in_loop, until  # noqa: F401
from test_audit import state  # noqa: F401
from test_health import health

INTERVALS = 3
# No time at all is the begin of OPC UA's.
NEVER = datetime.datetime(1601, 1, 1, tzinfo=datetime.timezone.utc)


def date(us):
    return datetime.datetime(1970, 1, 1, tzinfo=datetime.timezone.utc) + datetime.timedelta(microseconds=us)


async def read(session, name, start=None, end=None, most=0, bounds=False, after=None):
    """One answer: its status, the values, and where the next one begins."""
    wanted = ua.HistoryReadValueId()
    wanted.NodeId = at(session, name).nodeid
    wanted.ContinuationPoint = after
    details = ua.ReadRawModifiedDetails()
    details.IsReadModified = False
    details.StartTime, details.EndTime = start or NEVER, end or NEVER
    details.NumValuesPerNode, details.ReturnBounds = most, bounds
    request = ua.HistoryReadParameters()
    request.HistoryReadDetails = details
    request.TimestampsToReturn = ua.TimestampsToReturn.Both
    request.ReleaseContinuationPoints = False
    request.NodesToRead = [wanted]

    async def ask():
        # A busy service does not hold up others' stops.
        result = (await session.uaclient.history_read(request))[0]
        return result.StatusCode.name != "BadResourceUnavailable" and result

    result = await until(ask)
    values = getattr(result.HistoryData, "DataValues", None)
    return result.StatusCode.name, values or [], result.ContinuationPoint


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
