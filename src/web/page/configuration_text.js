/* SPDX-License-Identifier: Apache-2.0 */
/* What a scan found as sections for the configuration, as src/ctl/scan.c writes them. Pure. */
import { cleanText } from "./plain.js";

const UNIT_MAX = 247;

/* baud of a serial line, bitrate on CAN: a bus's key for its speed. */
export function nameSpeedKey(bus) {
	return bus.can ? "bitrate" : "baud";
}

export function isNew(find) {
	return find.verdict === "one" && find.drives.length === 0;
}

/* The number itself where it is free, else the next free one. */
function chooseUnit(taken, wanted) {
	for (let tried = 0; tried < UNIT_MAX; tried++) {
		const unit = ((wanted + tried + UNIT_MAX - 1) % UNIT_MAX) + 1;

		if (!taken.has(unit)) {
			taken.add(unit);
			return unit;
		}
	}
	return UNIT_MAX;
}

function writeDrive(bus, find, names, units) {
	let name = `${bus.name}-${find.address}`;

	while (names.has(name))
		name += "-b";
	names.add(name);
	return (
		`drive ${name} {${find.identity ? `    # ${cleanText(find.identity)}` : ""}\n   ` +
		` bus = ${bus.name}\n` +
		(find.address > 0 ? `    address = ${find.address}\n` : "") +
		(bus.protocol === "xyza"
			? "    axis = x    # and a drive each for y, z and a, as far as it has " +
				"them\n"
			: "") +
		`    unit = ${chooseUnit(units, find.address)}\n}\n`
	);
}

/*
 * For the drives that are new; "" when there are none. Those at another speed than the bus's, each
 * behind a line that says what has to be changed first. `drives` are those of the configuration.
 */
export function writeSections(bus, finds, drives) {
	const names = new Set(drives.map((drive) => drive.name));
	const units = new Set(drives.map((drive) => drive.unit));
	let told = bus.speed;
	let text = "";

	for (const find of finds.filter(isNew)) {
		if (find.speed !== told && find.speed !== bus.speed)
			text +=
				`# at ${find.speed} bit/s, while bus ${bus.name} is set to ` +
				`${bus.speed}: all drives of a bus ` +
				`and its ${nameSpeedKey(bus)} must be the same\n`;
		told = find.speed;
		text += writeDrive(bus, find, names, units);
	}
	return text;
}
