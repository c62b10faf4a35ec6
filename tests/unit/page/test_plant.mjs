/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { indexByName } from "../../../src/web/page/format.js";
import { ageOf, createPlant, judgeDrive, NEED } from "../../../src/web/page/plant.js";

const REGISTERS = indexByName([
	{ name: "axis_state", type: "u16", codes: { 0: "Offline", 1: "Disabled", 2: "Standstill", 4: "ContinuousMotion",
		7: "ErrorStop" } },
	{ name: "error", type: "u16", codes: { 0: "none", 1: "no_answer", 20: "over_current" } },
	{ name: "status", type: "bits32", codes: { 8: "warning", 10: "latched", 11: "origin_lost", 17: "params_unsaved",
		18: "must_stand" } },
	{ name: "must_stand_cause", type: "u16", codes: { 0: "none", 2: "watchdog" } },
]);
const bus = (name, drives) => ({ name, protocol: "vsmd-serial", drives, up: true });
const DESCRIPTION = {
	buses: [bus("line", ["feeder", "lift", "arm"])],
	drives: ["feeder", "lift", "arm"].map((name) => ({ name, bus: "line", unit_name: "mm" })),
};

test("a drive's need is judged as drivebridgectl status does", () => {
	const judge = (axis_state, status = 0, error = 0) => judgeDrive(REGISTERS, { axis_state, status, error });
	const cases = [
		[judge(2), NEED.nothing, ""],
		[judge(1), NEED.nothing, ""],
		[judge(0, 0, 1), NEED.act, "no answer"],
		[judge(0), NEED.act, "Offline"],
		[judge(7, 0, 20), NEED.act, "over current"],
		[judge(7), NEED.act, "ErrorStop"],
		[judge(2, 1 << 10), NEED.act, "latched"],
		[judge(2, 1 << 10 | 1 << 8), NEED.act, "latched"],
		[judge(4, 1 << 8 | 1 << 11), NEED.look, "warning"],
		[judge(2, 1 << 11 | 1 << 17), NEED.look, "origin lost"],
		[judge(2, 1 << 17), NEED.hint, "params unsaved"],
		[judgeDrive(REGISTERS, null), NEED.act, "not known"],
		[judgeDrive(undefined, null), NEED.act, "not known"],
	];

	for (const [judgement, need, why] of cases)
		assert.deepEqual([judgement.need, judgement.why], [need, why]);
	assert.equal(judgeDrive(REGISTERS, { axis_state: 4, velocity: -1 }).shape, "backward");
	assert.equal(judgeDrive(REGISTERS, { axis_state: 2, status: 1 << 10 }).shape, "error");
});

test("why a drive must stand is said beside its state", () => {
	const say = (values) => judgeDrive(REGISTERS, { axis_state: 4, error: 0, ...values }).mustStand;

	assert.equal(say({ status: 0, must_stand_cause: 0, must_stand_ms: 0 }), "");
	assert.equal(say({ status: 1 << 18, must_stand_cause: 2, must_stand_ms: 120 }), "");
	assert.equal(say({ status: 1 << 18, must_stand_cause: 2, must_stand_ms: 3210 }), "must stand: watchdog, for 3.2 s");
	assert.equal(say({ status: 1 << 18 }), "must stand");
	assert.equal(judgeDrive(undefined, null).mustStand, "");
});

function makePlant() {
	const plant = createPlant();

	plant.describe(structuredClone(DESCRIPTION));
	plant.families.set("vsmd-serial", REGISTERS);
	return plant;
}

test("the worst comes first, else the order of the configuration", () => {
	const plant = makePlant();

	plant.take([{ drive: "feeder", values: { axis_state: 2, status: 0, error: 0 } },
		{ drive: "lift", values: { axis_state: 2, status: 1 << 17, error: 0 } },
		{ drive: "arm", values: { axis_state: 0, status: 0, error: 1 } },
		{ drive: "gone", values: { axis_state: 2 } }], 0);
	assert.deepEqual(plant.worstFirst().map(({ name }) => name), ["arm", "lift", "feeder"]);
	plant.take([{ drive: "arm", values: { axis_state: 2, error: 0 } }], 0);
	assert.deepEqual(plant.worstFirst().map(({ name }) => name), ["lift", "feeder", "arm"]);
});

test("an age is as it was told, and grows when nothing comes", () => {
	const plant = makePlant();
	const drive = plant.drives.get("feeder");

	assert.equal(ageOf(drive, 5000), null);
	plant.take([{ drive: "feeder", values: { age_ms: 20 } }], 1000);
	assert.equal(ageOf(drive, 1900), 20);
	assert.equal(ageOf(drive, 4000), 2020);
	plant.take([{ drive: "feeder", values: { age_ms: 0xffffffff } }], 4000);
	assert.equal(ageOf(drive, 4000), null);
});

test("a new description keeps what is known of those that stay, and their faults", () => {
	const plant = makePlant();

	plant.take([{ drive: "feeder", values: { axis_state: 2, error: 0 } }], 1);
	plant.takeEvents([{ name: "drive-lost", drive: "feeder", text: "first" },
		{ name: "drive-fault", drive: "feeder", text: "second" }, { name: "drive-online", drive: "feeder", text: "no" },
		{ name: "command-refused", drive: "feeder", text: "no" }, { name: "bus-lost", bus: "line", text: "cable" }]);
	assert.equal(plant.drives.get("feeder").fault.text, "second");
	assert.equal(plant.busFaults.get("line").text, "cable");
	plant.describe({ buses: [bus("line", ["feeder", "new"])], drives: [{ name: "new", bus: "line" },
		{ name: "feeder", bus: "line" }] });
	assert.deepEqual([...plant.drives.keys()], ["new", "feeder"]);
	assert.equal(plant.drives.get("feeder").values.axis_state, 2);
	assert.equal(plant.drives.get("feeder").fault.text, "second");
	assert.equal(plant.drives.get("new").values, null);
});

test("figures say whether a bus is up", () => {
	const plant = makePlant();

	plant.takeFigures({ line: { up: 0, utilisation: 10 }, other: {} });
	assert.equal(plant.buses.get("line").description.up, false);
	assert.equal(plant.buses.get("line").figures.utilisation, 10);
});
