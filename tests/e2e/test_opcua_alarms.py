# SPDX-License-Identifier: Apache-2.0
"""Alarms as conditions of OPC UA: told, told again, acknowledged, and gone (asyncua)."""

import datetime

from asyncua import ua
from opcualib import (  # noqa: F401
    OPERATOR,
    READER,
    Follower,
    at,
    browse,
    fixture_certificate,
    fixture_make_server,
    in_loop,
    read_all,
    says,
    until,
)
from test_audit import state, wait_for  # noqa: F401
from test_health import wait_for_alarm

REFRESH = ua.NodeId(ua.ObjectIds.ConditionType_ConditionRefresh)
REFRESH2 = ua.NodeId(ua.ObjectIds.ConditionType_ConditionRefresh2)
ACKNOWLEDGE = ua.NodeId(ua.ObjectIds.AcknowledgeableConditionType_Acknowledge)
SILENT = "/Alarms.drive.drive1.no_answer"


async def call(session, target, method, *arguments):
    return await session.get_node(target).call_method(session.get_node(method), *arguments)


async def acknowledge(session, event, comment="seen"):
    return await call(session, event.NodeId, ACKNOWLEDGE, event.EventId, ua.LocalizedText(comment))


async def follow(session):
    """What a client of alarms and conditions subscribes to: all fields, and the id of the condition."""
    follower = Follower(session)
    follower.subscription = await session.create_subscription(50, follower)
    await follower.subscription.subscribe_alarms_and_conditions(
        ua.ObjectIds.Server, [ua.ObjectIds.AlarmConditionType, ua.ObjectIds.RefreshStartEventType,
                              ua.ObjectIds.RefreshEndEventType])
    return follower


def of(follower, condition=SILENT):
    return [one for one in follower.events if getattr(one, "ConditionName", None) == condition.rsplit(".", 1)[1]]


async def refreshed(session, follower, method=REFRESH, *more):
    """What comes between the begin and the end of the events that are told again."""
    del follower.events[:]
    number = ua.Variant(follower.subscription.subscription_id, ua.VariantType.UInt32)
    await call(session, ua.NodeId(ua.ObjectIds.ConditionType), method, number, *more)
    end = ua.NodeId(ua.ObjectIds.RefreshEndEventType)
    await until(lambda: follower.events and follower.events[-1].EventType == end)
    first, *between, _ = follower.events
    assert first.EventType == ua.NodeId(ua.ObjectIds.RefreshStartEventType)
    return between


@in_loop
async def test_an_alarm_from_its_begin_to_its_end(state, make_bridge, make_server, certificate):  # noqa: F811
    bridge = make_bridge()
    server = make_server(bridge)
    async with server.session(certificate, OPERATOR) as olga, server.session(certificate, READER) as rita, \
            server.session() as plain:
        followers = [await follow(session) for session in (olga, rita, plain)]
        follower = followers[0]
        assert await refreshed(olga, follower) == []
        bridge.sim.fault("silence on")
        for one in followers:
            event = (await until(lambda one=one: of(one)))[0]
            # Also for one whose messages are not signed.
            assert event.NodeId == at(olga, SILENT).nodeid
        assert event.EventType == ua.NodeId(ua.ObjectIds.DiscreteAlarmType)
        assert event.SourceNode == at(olga, "drive1").nodeid and event.SourceName == "drive1"
        assert event.InputNode == at(olga, "drive1.Trouble").nodeid and event.BranchId == ua.NodeId()
        assert event.Message.Text == "drive1: no answer" and event.Severity == 900 and event.Retain is True
        assert (getattr(event, "ActiveState/Id"), getattr(event, "AckedState/Id"),
                getattr(event, "EnabledState/Id")) == (True, False, True)
        assert event.ActiveState.Text == "Active" and event.AckedState.Text == "Unacknowledged"
        alarm = wait_for_alarm(bridge, cause="no_answer")
        assert abs(event.Time.replace(tzinfo=datetime.timezone.utc).timestamp() - alarm["came_us"] / 1e6) < 0.001

        # Told again with the id that it had, by either method.
        item = ua.Variant(1, ua.VariantType.UInt32)
        for again in (await refreshed(olga, follower), await refreshed(olga, follower, REFRESH2, item)):
            assert [one.EventId for one in again] == [event.EventId]
        with says("BadSubscriptionIdInvalid"):
            await call(olga, ua.NodeId(ua.ObjectIds.ConditionType), REFRESH, ua.Variant(77, ua.VariantType.UInt32))
        with says("BadSubscriptionIdInvalid"):
            # Another session's.
            number = followers[1].subscription.subscription_id
            await call(olga, ua.NodeId(ua.ObjectIds.ConditionType), REFRESH, ua.Variant(number, ua.VariantType.UInt32))

        # Acknowledged by those who may, with an id that this alarm had.
        with says("BadUserAccessDenied"):
            await acknowledge(rita, event)
        for wrong in (b"", b"x" * 24, event.EventId[:-1], event.EventId[:8] + b"\1" * 16):
            with says("BadEventIdUnknown"):
                await call(olga, event.NodeId, ACKNOWLEDGE, wrong, ua.LocalizedText("seen"))
        for target in (ua.NodeId(ua.ObjectIds.AlarmConditionType), at(olga, "drive1").nodeid):
            with says("BadNodeIdInvalid", "BadMethodInvalid"):
                await call(olga, target, ACKNOWLEDGE, event.EventId, ua.LocalizedText("seen"))
        for method, status in ((ua.ObjectIds.ConditionType_Enable, "BadConditionAlreadyEnabled"),
                               (ua.ObjectIds.ConditionType_Disable, "BadNotSupported")):
            with says(status):
                await call(olga, event.NodeId, ua.NodeId(method))
        del follower.events[:]
        await acknowledge(olga, event, "plug was loose")
        with says("BadConditionBranchAlreadyAcked"):
            await acknowledge(olga, event)
        acked = (await until(lambda: of(follower)))[0]
        assert getattr(acked, "AckedState/Id") is True and acked.Retain is True and acked.EventId != event.EventId
        assert acked.Comment.Text == "plug was loose" and "olga" in acked.ClientUserId
        assert "olga" in wait_for_alarm(bridge, acknowledged_us=acked_us(bridge))["acknowledged_by"]
        record = wait_for(bridge, kind="alarm")[0]
        assert record["user"] == "olga" and record["text"].endswith("no_answer: plug was loose")

        # Gone: it concerns nobody any more.
        bridge.sim.fault("silence off")
        gone = (await until(lambda: [one for one in of(follower) if not one.Retain]))[0]
        assert getattr(gone, "ActiveState/Id") is False and gone.ActiveState.Text == "Inactive"
        assert await refreshed(olga, follower) == []


def acked_us(bridge):
    return wait_for_alarm(bridge, cause="no_answer")["acknowledged_us"]


@in_loop
async def test_conditions_are_nodes(bridge, make_server):
    """Each alarm that there has been is a node below Alarms, to which what it is about refers, and whose members are those of its
    type."""
    server = make_server(bridge)
    bridge.sim.fault("silence on")
    async with server.session() as session:
        await until(at(session, "/Alarms").get_children)
        condition = (await browse(session, at(session, "/Alarms"))).children["drive.drive1.no_answer"]
        # The methods are those of its types.
        shown = [entry for _, entry in condition.walk()
                 if entry.kind == ua.NodeClass.Variable and entry.node.nodeid.NamespaceIndex == session.space]
        values = await read_all(session, shown)
        assert len(shown) == 30 and all(one.StatusCode.is_good() for one in values)
        types = await read_all(session, shown, ua.AttributeIds.DataType)
        for entry, value, kind in zip(shown, values, types):
            assert ua.NodeId(value.Value.VariantType.value) == kind.Value.Value, entry.node
            assert (await entry.node.get_parent()).nodeid.Identifier in entry.node.nodeid.Identifier
        about = await at(session, "drive1").get_references(ua.ObjectIds.HasCondition, includesubtypes=False)
        assert [one.NodeId for one in about] == [condition.node.nodeid]
        back = await condition.node.get_references(ua.ObjectIds.HasCondition, ua.BrowseDirection.Inverse)
        assert [one.NodeId for one in back] == [at(session, "drive1").nodeid]
        # No second step: neither the conditions nor their type show one.
        assert not any("Confirm" in entry.name for _, entry in condition.walk())
        kind = await browse(session, session.get_node(ua.ObjectIds.AcknowledgeableConditionType))
        assert {"AckedState", "Acknowledge"} <= set(kind.children) and not {"ConfirmedState", "Confirm"} & set(kind.children)
        with says("BadMethodInvalid", "BadNodeIdUnknown"):
            await call(session, condition.node.nodeid, ua.NodeId(ua.ObjectIds.AcknowledgeableConditionType_Confirm),
                       b"x" * 24, ua.LocalizedText("done"))
        for name in (SILENT + ".", SILENT + ".Nope", SILENT + ".AckedState.", "/Alarms.", "/Alarms.drive", SILENT[:-1]):
            with says("BadNodeIdUnknown"):
                await at(session, name).read_browse_name()
        with says("BadUserAccessDenied", "BadNotWritable"):
            await at(session, SILENT + ".Retain").write_value(False)
