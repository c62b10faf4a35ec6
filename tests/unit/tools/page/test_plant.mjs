/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { indexByName } from "../../../../src/tools/web/page/format.js";
import { ageOf, createPlant, judgeDrive, NEED } from "../../../../src/tools/web/page/plant.js";
import { isWanted } from "../../../../src/tools/web/page/drive_rows.js";
import { listTroubles } from "../../../../src/tools/web/page/trouble_strip.js";

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

const record = (cause, need, more = {}) =>
	({ cause, need, detail: "", advice: "do this", event: null, since_us: 1, ...more });

test("a drive's need is what the service says, whatever its values are", () => {
	const judge = (axis_state, told) => judgeDrive(REGISTERS, { axis_state, status: 1 << 10, error: 20 }, told);
	const event = { time_us: 1e15, text: "no answer" };

	for (const [judgement, need, why, advice] of [
		[judge(0, undefined), NEED.nothing, "", ""],
		[judgeDrive(undefined, null, null), NEED.nothing, "", ""],
		[judge(2, record("no_answer", "act")), NEED.act, "no answer", "do this"],
		[judge(2, record("fault", "act", { detail: "over_current" })), NEED.act, "over current", "do this"],
		[judge(2, record("port", "act", { detail: "Permission denied" })), NEED.act, "port (Permission denied)",
			"do this"],
		[judge(2, record("params_unsaved", "hint", { event })), NEED.hint, "params unsaved", "do this"],
		[judge(2, record("of_tomorrow", "unheard_of")), NEED.act, "of tomorrow", "do this"],
	])
		assert.deepEqual([judgement.need, judgement.why, judgement.advice], [need, why, advice]);
	assert.match(judge(2, record("no_answer", "act", { event })).advice, /^do this · .*no answer$/);
	assert.equal(judgeDrive(REGISTERS, { axis_state: 4, velocity: -1 }).shape, "backward");
	assert.equal(judge(2).shape, "error");
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

test("what needs somebody comes from the service, the worst first", () => {
	const plant = makePlant();
	const tell = (drives, others = {}) =>
		plant.takeTroubles({ drives, buses: {}, configuration: record("none", "nothing"), well: false, ...others });

	tell({ lift: record("params_unsaved", "hint"), arm: record("no_answer", "act"), gone: record("late", "act") });
	assert.deepEqual(listTroubles(plant.troubles).map(({ key }) => key), ["drive arm", "drive gone"]);
	plant.take([{ drive: "arm", values: { axis_state: 2, error: 0 } }], 0);
	assert.equal(plant.drives.get("arm").judgement.need, NEED.act);
	tell({ lift: record("params_unsaved", "hint") });
	assert.deepEqual(listTroubles(plant.troubles), []);
	tell({ lift: record("aside", "look") }, { buses: { line: record("aside", "look") },
		configuration: record("refused", "act") });
	assert.deepEqual(listTroubles(plant.troubles).map(({ key, href }) => [key, href]),
		[["bus line", "#/trace/line"], ["drive lift", "#/drive/lift"]]);
	assert.deepEqual(plant.countNeeds(), { drives: [2, 0, 1, 0], buses: [0, 0, 1, 0], configuration: [0, 0, 0, 1] });
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

test("an age includes the time that the network took", () => {
	const plant = makePlant();
	const drive = plant.drives.get("feeder");

	plant.take([{ drive: "feeder", values: { age_ms: 20 } }], 5000, 4000);
	assert.equal(ageOf(drive, 5000), 4020);
	assert.equal(ageOf(drive, 5900), 4020);
	assert.equal(ageOf(drive, 7000), 5020);
});

test("drives are filtered by words, bus and state", () => {
	const plant = makePlant();
	const names = (wanted) => [...plant.drives.values()].filter((drive) => isWanted(drive, wanted))
		.map(({ name }) => name);

	plant.take([{ drive: "feeder", values: { axis_state: 2 } }, { drive: "lift", values: { axis_state: 4 } }], 1);
	plant.takeTroubles({ drives: { arm: record("no_answer", "act") }, buses: {}, well: false });
	assert.deepEqual(names({}), ["feeder", "lift", "arm"]);
	assert.deepEqual(names({ words: " LIFT " }), ["lift"]);
	assert.deepEqual(names({ words: "runs" }), ["lift"]);
	assert.deepEqual(names({ state: "needs" }), ["arm"]);
	assert.deepEqual(names({ state: "moving" }), ["lift"]);
	assert.deepEqual(names({ state: "standing" }), ["feeder"]);
	assert.deepEqual(names({ bus: "other" }), []);
});

test("a new description keeps what is known of those that stay, and what is wrong with them", () => {
	const plant = makePlant();

	plant.take([{ drive: "feeder", values: { axis_state: 2, error: 0 } }], 1);
	plant.takeTroubles({ drives: { feeder: record("late", "act") }, buses: {}, well: false });
	plant.describe({ buses: [bus("line", ["feeder", "new"])], drives: [{ name: "new", bus: "line" },
		{ name: "feeder", bus: "line" }] });
	assert.deepEqual([...plant.drives.keys()], ["new", "feeder"]);
	assert.equal(plant.drives.get("feeder").values.axis_state, 2);
	assert.equal(plant.drives.get("feeder").judgement.why, "late");
	assert.equal(plant.drives.get("new").values, null);
	assert.equal(plant.drives.get("new").judgement.need, NEED.nothing);
});

test("figures say whether a bus is up", () => {
	const plant = makePlant();

	plant.takeFigures({ line: { up: 0, utilisation: 10 }, other: {} });
	assert.equal(plant.buses.get("line").description.up, false);
	assert.equal(plant.buses.get("line").figures.utilisation, 10);
});
