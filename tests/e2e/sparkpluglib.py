# SPDX-License-Identifier: Apache-2.0
"""A Sparkplug host application that a test plays: it decodes with Google's library, not with ours, and keeps to the
specification: what breaks its rules of order, numbers and aliases is a failure."""

import json
import time

import paho.mqtt.client as paho
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mqttlib import Watcher
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.subscribeoptions import SubscribeOptions

SCALARS = [("int_value", "UINT32"), ("long_value", "UINT64"), ("float_value", "FLOAT"), ("double_value", "DOUBLE"),
           ("boolean_value", "BOOL"), ("string_value", "STRING")]
# Of each message its fields: number, name, type, R: repeated, V: one of the values.
FIELDS = {
    "PropertyValue": [(1, "type", "UINT32", ""), (2, "is_null", "BOOL", "")] +
                     [(3 + i, name, kind, "V") for i, (name, kind) in enumerate(SCALARS)],
    "PropertySet": [(1, "keys", "STRING", "R"), (2, "values", "PropertyValue", "R")],
    "Template": [(1, "version", "STRING", ""), (2, "metrics", "Metric", "R"), (4, "template_ref", "STRING", ""),
                 (5, "is_definition", "BOOL", "")],
    "Metric": [(1, "name", "STRING", ""), (2, "alias", "UINT64", ""), (3, "timestamp", "UINT64", ""),
               (4, "datatype", "UINT32", ""), (5, "is_historical", "BOOL", ""), (6, "is_transient", "BOOL", ""),
               (7, "is_null", "BOOL", ""), (9, "properties", "PropertySet", "")] +
              [(10 + i, name, kind, "V") for i, (name, kind) in enumerate(SCALARS)] +
              [(18, "template_value", "Template", "V")],
    "Payload": [(1, "timestamp", "UINT64", ""), (2, "metrics", "Metric", "R"), (3, "seq", "UINT64", ""),
                (4, "uuid", "STRING", ""), (5, "body", "BYTES", "")],
}
INT32, INT64, UINT16, UINT32, UINT64, FLOAT, DOUBLE, BOOLEAN, STRING, TEMPLATE = 3, 4, 6, 7, 8, 9, 10, 11, 12, 19


def make_payload_class():
    file = descriptor_pb2.FileDescriptorProto(name="host.proto", package="host", syntax="proto2")
    for message, fields in FIELDS.items():
        made = file.message_type.add(name=message)
        for number, name, kind, mark in fields:
            field = made.field.add(name=name, number=number,
                                   label=3 if mark == "R" else 1)
            if kind in FIELDS:
                field.type, field.type_name = 11, f".host.{kind}"
            else:
                field.type = getattr(descriptor_pb2.FieldDescriptorProto, f"TYPE_{kind}")
            if mark == "V":
                if not made.oneof_decl:
                    made.oneof_decl.add(name="value")
                field.oneof_index = 0
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("host.Payload"))


Payload = make_payload_class()


def value_of(metric, kind=None):
    """As Python has it; None: null."""
    if metric.is_null:
        return None
    which = metric.WhichOneof("value")
    assert which, f"a metric with neither a value nor is_null: {metric}"
    value = getattr(metric, which)
    if kind == INT32 and value >= 2**31:
        value -= 2**32
    if kind == INT64 and value >= 2**63:
        value -= 2**64
    if which == "template_value":
        return {one.name: value_of(one, one.datatype) for one in value.metrics}
    return value


def properties_of(metric):
    return {key: getattr(value, value.WhichOneof("value"))
            for key, value in zip(metric.properties.keys, metric.properties.values, strict=True)}


class Metrics(dict):
    """Of a node or a device, by name: the last metric, with what its birth said of it."""

    def born(self, payload):
        self.clear()
        for metric in payload.metrics:
            assert metric.name and metric.datatype and metric.timestamp
            self[metric.name] = metric

    def value(self, name):
        return value_of(self[name], self[name].datatype)


class Message:
    def __init__(self, topic, raw, retain, qos):
        parts = topic.split("/")
        self.topic = topic
        self.kind = parts[2]
        self.device = parts[4] if len(parts) > 4 else ""
        self.retain, self.qos = retain, qos
        self.payload = Payload.FromString(raw)
        self.length = len(raw)
        self.metrics = {}   # name -> metric, aliases resolved
        self.values = {}
        self.historical = bool(self.payload.metrics) and all(m.is_historical for m in self.payload.metrics)

    def __repr__(self):
        return f"{self.kind} {self.device} seq={self.payload.seq} {self.values}"


class Host(Watcher):
    """Follows one edge node; `problems` has what it did that no edge node may."""

    def __init__(self, broker, group="drivebridge", node="gw", host_id=None, **options):
        self.group, self.node, self.host_id = group, node, host_id
        self.seq = None
        self.bd_seq = None
        self.births = {}      # device ("": the node) -> alias -> metric of its birth
        self.alive = {}       # device -> Metrics
        self.problems = []
        self.alias_owner = {}
        super().__init__(broker, prefix="", filters=[f"spBv1.0/{group}/#"], **options)

    def _connected(self, client, *unused):
        # As the publisher set it, so that a retained one is seen.
        client.subscribe([(one, SubscribeOptions(qos=1, retainAsPublished=True)) for one in self.filters])

    def _take(self, client, data, message):
        if message.topic.split("/")[1] == "STATE":
            return
        if message.topic.split("/")[2] in ("NCMD", "DCMD"):
            return
        with self.changed:
            one = Message(message.topic, message.payload, message.retain, message.qos)
            try:
                self._follow(one)
            except AssertionError as problem:
                self.problems.append(f"{one}: {problem}")
            self.messages.append(one)
            self.changed.notify_all()

    def _follow(self, one):
        assert not one.retain, "retained"
        assert one.topic.split("/")[3] == self.node
        assert one.payload.timestamp, "no time"
        if one.kind == "NDEATH":
            assert not one.payload.HasField("seq"), "NDEATH with seq"
            assert [m.name for m in one.payload.metrics] == ["bdSeq"]
            one.values["bdSeq"] = value_of(one.payload.metrics[0])
            if one.values["bdSeq"] == self.bd_seq:
                self.alive, self.births = {}, {}
            return
        assert one.qos == 0, "quality of service"
        if one.kind == "NBIRTH":
            assert one.payload.seq == 0 and one.payload.HasField("seq")
            self.births, self.alive, self.alias_owner = {}, {}, {}
        else:
            assert "" in self.births, "before NBIRTH"
            assert one.payload.seq == (self.seq + 1) % 256, f"seq after {self.seq}"
        self.seq = one.payload.seq
        if one.kind in ("NBIRTH", "DBIRTH"):
            self._born(one)
        elif one.kind == "DDEATH":
            assert one.device in self.alive, "it was not born"
            assert not one.payload.metrics
            del self.births[one.device], self.alive[one.device]
        else:
            assert one.device in self.births, "data before the birth"
            for metric in one.payload.metrics:
                assert not metric.name and metric.HasField("alias"), "name in data"
                assert metric.timestamp and not metric.HasField("datatype")
                known = self.births[one.device][metric.alias]
                one.metrics[known.name] = metric
                one.values[known.name] = value_of(metric, known.datatype)
                if not metric.is_historical and not metric.HasField("template_value"):
                    kept = self.alive[one.device]
                    metric.datatype, metric.name = known.datatype, known.name
                    kept[known.name] = metric

    def _born(self, one):
        self.births[one.device] = {}
        metrics = self.alive[one.device] = Metrics()
        metrics.born(one.payload)
        for metric in one.payload.metrics:
            one.metrics[metric.name] = metric
            one.values[metric.name] = value_of(metric, metric.datatype)
            if metric.HasField("template_value") and metric.template_value.is_definition:
                continue
            if metric.name == "Node Control/Rebirth":
                assert not metric.HasField("alias"), "a host without aliases asks for it"
                continue
            assert metric.HasField("alias")
            owner = self.alias_owner.setdefault(metric.alias, (one.device, metric.name))
            assert owner == (one.device, metric.name), f"alias of {owner}"
            self.births[one.device][metric.alias] = metric
        if one.kind == "NBIRTH":
            self.bd_seq = one.values["bdSeq"]
            assert metrics["bdSeq"].datatype == INT64 and 0 <= self.bd_seq <= 255
            assert one.values["Node Control/Rebirth"] is False
            assert metrics["Node Control/Rebirth"].datatype == BOOLEAN

    def wait_for(self, kind, device="", check=lambda message: True, since=0, timeout=10):
        deadline = time.monotonic() + timeout
        with self.changed:
            while True:
                for one in self.messages[since:]:
                    if one.kind == kind and one.device == device and check(one):
                        return one
                left = deadline - time.monotonic()
                if not self.changed.wait(max(left, 0)) and left <= 0:
                    seen = [one for one in self.messages[since:] if one.kind == kind and one.device == device]
                    raise AssertionError(f"no such {kind} {device}; {seen[-3:]}; {self.problems[-3:]}")

    def of(self, *kinds, since=0):
        with self.changed:
            return [one for one in self.messages[since:] if one.kind in kinds]

    def topic(self, kind, device=""):
        return f"spBv1.0/{self.group}/{kind}/{self.node}" + (f"/{device}" if device else "")

    def command(self, kind, device="", at=None, timed=True, qos=0, retain=False, payload_time=True, alias=True, **metrics):
        """A DCMD or NCMD: values by the names of metrics, `__` for a slash. Returns its bytes."""
        ms = int((time.time() if at is None else at) * 1000)
        payload = Payload()
        if payload_time:
            payload.timestamp = ms
        for name, value in metrics.items():
            name = name.replace("__", "/").replace("_SPACE_", " ")
            known = self.alive.get(device, {}).get(name)
            metric = payload.metrics.add()
            if known is not None and known.HasField("alias") and alias:
                metric.alias = known.alias
            else:
                metric.name = name
            if timed:
                metric.timestamp = ms
            if value is None:
                metric.is_null = True
            elif isinstance(value, bool):
                metric.boolean_value = value
            elif isinstance(value, float):
                metric.float_value = value
            elif isinstance(value, int):
                metric.int_value = value % 2**32
            else:
                metric.string_value = value
        raw = payload.SerializeToString()
        self.publish(self.topic(kind, device), raw, qos=qos, retain=retain)
        return raw

    def result(self, device, check=lambda values: True, since=0, **options):
        """The first result of a command that the check takes: from data of the device."""
        return self.wait_for("DDATA", device, lambda one: "result/result" in one.values and check(one.values),
                             since, **options).values


class State:
    """The STATE of a host application, at one broker, with its will."""

    def __init__(self, broker, name, online=True):
        self.topic = f"spBv1.0/STATE/{name}"
        self.client = paho.Client(CallbackAPIVersion.VERSION2, protocol=paho.MQTTv5)
        self.client.will_set(self.topic, self.text(False), qos=1, retain=True)
        self.client.connect(broker.host, broker.port)
        self.client.loop_start()
        if online:
            self.tell(True)

    @staticmethod
    def text(online, at=None):
        return json.dumps({"online": online, "timestamp": int((at or time.time()) * 1000)})

    def tell(self, online, at=None):
        self.client.publish(self.topic, self.text(online, at), qos=1, retain=True).wait_for_publish(10)

    def close(self):
        self.client.disconnect()
        self.client.loop_stop()
