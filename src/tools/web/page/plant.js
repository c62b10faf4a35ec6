/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The page's state of all buses and drives, from the overview's stream: each drive's latest values,
 * when they arrived, and how urgently it needs somebody.
 *
 * Pure; times are milliseconds of one clock.
 */
import { bitNames, codeName, formatFixed, formatTime, inWords } from "./format.js";
import { inLanguage, t } from "./words.js";

/* In this order. */
export const NEED = {
	nothing: 0,
	hint: 1,
	look: 2,
	act: 3
};

/* A drive that must stand is shown as such after this time. */
const MUST_STAND_SHOWN_MS = 500;
/* The overview repeats an unchanged drive at this interval. */
const TOLD_EVERY_MS = 1000;

/*
 * The state of a drive. From values of one moment and the registers of its family: state (of
 * axis_state), shape (of the drawing), mustStand (the reason, and for how long; "" if it may move).
 * Only from the service's trouble record (null: nothing is wrong): need, why, advice, cause ("":
 * nothing is wrong).
 */
export function judgeDrive(registers, values, record) {
	const state = codeName(registers?.get("axis_state"), values?.axis_state);
	const status = bitNames(registers?.get("status"), values?.status);

	return {
		...readRecord(record),
		state,
		shape: status.includes("latched") ? "error" : shapeOf(state, values),
		mustStand: status.includes("must_stand") ? sayMustStand(registers, values) : ""
	};
}

/* The content of a record: need, why (in few words), advice (what to do, and the latest event about
 * it, which is also in `event` alone, as is what to do in `todo`). */
export function readRecord(record) {
	const { cause = "none", detail = "", advice = "", event = null } = record ?? {};
	const need = record ? NEED[record.need] ?? NEED.act : NEED.nothing;
	const todo = inLanguage(advice);
	const said = need >= NEED.look && event ? `${formatTime(event.time_us)} ${inLanguage(event.text)}` : "";

	return {
		need,
		cause: need === NEED.nothing ? "" : cause,
		why: need === NEED.nothing ? "" :
			inLanguage(inWords(cause === "fault" && detail ? detail : cause)) +
				(cause !== "fault" && detail ? ` (${inLanguage(detail)})` : ""),
		advice: [todo, said].filter(Boolean).join(" · "),
		todo,
		event: said
	};
}

/* "must stand: watchdog, for 3.2 s" */
function sayMustStand(registers, values) {
	const cause = codeName(registers.get("must_stand_cause"), values.must_stand_cause);
	const ms = values.must_stand_ms;

	/* An ordinary stop takes less, and a text that appears and disappears moves buttons away
	 * from the pointer. */
	if (typeof ms === "number" && ms < MUST_STAND_SHOWN_MS)
		return "";
	return (cause ? t("must stand: {cause}", { cause: inWords(cause) }) : t("must stand")) +
		(typeof ms === "number" ? t(", for {seconds} s", { seconds: formatFixed(ms / 1000, 1) }) : "");
}

/* The states of PLCopen in the words of those who wire and repair. */
const STATE_WORDS = {
	Disabled: t("switched off"),
	Standstill: t("stands"),
	DiscreteMotion: t("moves to target"),
	ContinuousMotion: t("runs"),
	SynchronizedMotion: t("follows another"),
	Homing: t("looks for its origin"),
	Stopping: t("brakes"),
	ErrorStop: t("fault"),
	Offline: t("no answer"),
};

export function stateWord(state) { return STATE_WORDS[state] ?? (state || t("not known")); }

/* Drawings differ in their form, not only in colour. */
function shapeOf(state, values) {
	switch (state) {
	case "Disabled":
		return "disabled";
	case "Standstill":
		return "standstill";
	case "DiscreteMotion":
		return "motion";
	case "ContinuousMotion":
		return values.velocity < 0 ? "backward" : "forward";
	case "Homing":
		return "homing";
	case "Stopping":
		return "stopping";
	case "ErrorStop":
		return "error";
	default:
		return "offline";
	}
}

export function isMoving(state) {
	return ["DiscreteMotion", "ContinuousMotion", "Homing", "Stopping"].includes(state);
}

/*
 * drives: Map of name to { name, bus, description, values, heardAt (less the time
 * that the values were under way, late), place, judgement }; buses: Map
 * of name to { description, figures }; troubles: what is wrong, from the service: { drives, buses,
 * configuration, well }, with records by name of those that need somebody; null until the first
 * message.
 */
export function createPlant() {
	const plant = {
		description: null,
		drives: new Map(),
		buses: new Map(),
		/* By family: from the protocol of a bus to a Map of registers. */
		families: new Map(),
		troubles: null,
	};
	const judge = (drive) =>
		judgeDrive(plant.registersOf(drive), drive.values, plant.troubles?.drives[drive.name]);

	/* The configuration from Describe; data of unchanged drives are kept. */
	plant.describe = (description) => {
		const drives = new Map();
		const buses = new Map();

		description.drives.forEach((drive, place) => {
			const before = plant.drives.get(drive.name);

			drives.set(drive.name, {
				name: drive.name,
				bus: drive.bus,
				description: drive,
				place,
				values: before?.values ?? null,
				heardAt: before?.heardAt ?? 0,
				late: before?.late ?? 0,
				judgement: null
			});
		});
		for (const bus of description.buses)
			buses.set(bus.name, {
				description: bus,
				figures: plant.buses.get(bus.name)?.figures ?? null
			});
		plant.description = description;
		plant.drives = drives;
		plant.buses = buses;
		plant.judge();
	};

	plant.registersOf = (drive) =>
		plant.families.get(plant.buses.get(drive.bus)?.description.protocol);

	plant.judge = () => {
		for (const drive of plant.drives.values())
			drive.judgement = judge(drive);
	};

	plant.takeTroubles = (troubles) => {
		plant.troubles = troubles;
		plant.judge();
	};

	/* Samples of the stream, which were under way for `late` ms at most; drives without one are
	 * unchanged. */
	plant.take = (samples, now, late = 0) => {
		for (const sample of samples) {
			const drive = plant.drives.get(sample.drive);

			if (!drive)
				continue;
			drive.values = { ...drive.values, ...sample.values };
			drive.heardAt = now - late;
			drive.late = late;
			drive.judgement = judge(drive);
		}
	};

	plant.takeFigures = (figures) => {
		for (const [name, bus] of plant.buses) {
			if (figures[name]) {
				bus.figures = figures[name];
				bus.description.up = figures[name].up !== 0;
			}
		}
	};

	/* The number of drives, buses and configurations for each need. */
	plant.countNeeds = () => {
		const { buses = {}, configuration = null } = plant.troubles ?? {};
		const count = (needs) => Object.values(NEED).map((need) =>
			needs.filter((one) => one === need).length);

		return {
			drives: count([...plant.drives.values()].map(({ judgement }) => judgement.need)),
			buses: count(Object.values(buses).map((record) => readRecord(record).need)),
			configuration: count([readRecord(configuration).need])
		};
	};

	return plant;
}

/* The present age of a drive's values at most, in milliseconds: the reported age, the time that they
 * were under way, and the time since then without data. */
export function ageOf(drive, now) {
	const age = drive.values?.age_ms;

	return typeof age === "number" && age < 0xffffffff ?
		age + Math.max(drive.late ?? 0, now - drive.heardAt - TOLD_EVERY_MS) :
		null;
}
