/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The page's picture of all buses and drives, from the overview's stream: what each drive said
 * last, when that came, and how much it needs somebody.
 *
 * Pure; times are milliseconds of one clock.
 */
import { bitNames, codeName, inWords } from "./format.js";

/* In this order. */
export const NEED = {
	nothing: 0,
	hint: 1,
	look: 2,
	act: 3
};

/* Events that say why a drive needs somebody; those of others, such as a refused write, are no
 * faults of it. */
const FAULTS = new Set([
	"drive-lost", "drive-fault", "drive-warning", "drive-runs-on", "drive-restarted",
	"drive-may-have-restarted",
	"drive-unconfirmed", "watchdog-tripped", "bus-lost", "bus-off"
]);
/* A drive that must stand for longer is said to. */
const MUST_STAND_SHOWN_MS = 500;
/* The overview tells a drive that says the same as before once in so long. */
const TOLD_EVERY_MS = 1000;

/*
 * How a drive is, from values of one moment and the registers of its family: need, why (in the
 * service's names), state (of axis_state), shape (of the drawing), mustStand (why it must, and for how long; "" when it
 * need not).
 */
export function judgeDrive(registers, values) {
	const state = codeName(registers?.get("axis_state"), values?.axis_state);
	const error = codeName(registers?.get("error"), values?.error);
	const status = bitNames(registers?.get("status"), values?.status);
	const judgement = { need: NEED.nothing, why: "", state, shape: shapeOf(state, values),
		mustStand: status.includes("must_stand") ? sayMustStand(registers, values) : "" };

	if (state === "Offline" || state === "ErrorStop" || state === "") {
		judgement.need = NEED.act;
		judgement.why = error && error !== "none" ? error : state || "not known";
	} else if (status.includes("latched")) {
		judgement.need = NEED.act;
		judgement.why = "latched";
		judgement.shape = "error";
	} else if (status.includes("warning")) {
		judgement.need = NEED.look;
		judgement.why = "warning";
	} else if (status.includes("origin_lost")) {
		judgement.need = NEED.look;
		judgement.why = "origin_lost";
	} else if (status.includes("params_unsaved")) {
		judgement.need = NEED.hint;
		judgement.why = "params_unsaved";
	}
	judgement.why = inWords(judgement.why);
	return judgement;
}

/* "must stand: watchdog, for 3.2 s" */
function sayMustStand(registers, values) {
	const cause = codeName(registers.get("must_stand_cause"), values.must_stand_cause);
	const ms = values.must_stand_ms;

	/* A stop of every day takes less, and what comes and goes moves buttons from under the pointer. */
	if (typeof ms === "number" && ms < MUST_STAND_SHOWN_MS)
		return "";
	return `must stand${cause ? `: ${inWords(cause)}` : ""}` +
		(typeof ms === "number" ? `, for ${(ms / 1000).toFixed(1)} s` : "");
}

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
 * drives: Map of name to { name, bus, description, values, heardAt, place, judgement, fault },
 * fault being the latest event of the log that is one; buses: Map of name to { description, figures
 * }.
 */
export function createPlant() {
	const plant = {
		description: null,
		drives: new Map(),
		buses: new Map(),
		/* By family: protocol of a bus to a Map of registers. */
		families: new Map(),
		/* The latest of a bus itself, by its name. */
		busFaults: new Map(),
	};
	const faults = new Map();

	/* What runs, as Describe says; what is known of drives that stay is kept. */
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
				fault: faults.get(drive.name) ?? null,
				judgement: judgeDrive(null, null)
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
			drive.judgement = judgeDrive(plant.registersOf(drive), drive.values);
	};

	/* Samples of the stream; drives without one say the same as before. */
	plant.take = (samples, now) => {
		for (const sample of samples) {
			const drive = plant.drives.get(sample.drive);

			if (!drive)
				continue;
			drive.values = { ...drive.values, ...sample.values };
			drive.heardAt = now;
			drive.judgement = judgeDrive(plant.registersOf(drive), drive.values);
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

	/* Events of the log, oldest first: what there was to check. */
	plant.takeEvents = (events) => {
		for (const event of events) {
			if (!FAULTS.has(event.name))
				continue;
			if (event.drive)
				faults.set(event.drive, event);
			else if (event.bus)
				plant.busFaults.set(event.bus, event);
		}
		for (const drive of plant.drives.values())
			drive.fault = faults.get(drive.name) ?? null;
	};

	/* What changes when there may be something new in the log. */
	plant.summarise = () => [
		...[...plant.drives.values()].map(({ name, judgement }) =>
			`${name} ${judgement.need} ${judgement.why}`),
		...[...plant.buses.values()].map(({ description }) => String(description.up)),
	].join("\n");

	/* The worst first, else as configured. */
	plant.worstFirst = () => [...plant.drives.values()].sort(
		(one, other) =>
			other.judgement.need - one.judgement.need || one.place - other.place);

	return plant;
}

/* How old a drive's values are now, in milliseconds: as it was told, and longer when nothing
 * comes any more. */
export function ageOf(drive, now) {
	const age = drive.values?.age_ms;

	return typeof age === "number" && age < 0xffffffff ?
		age + Math.max(0, now - drive.heardAt - TOLD_EVERY_MS) :
		null;
}
