/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Giving a drive another address, or the speed of another bus, as src/ctl/address.c does it: looked
 * at before, asked, told, saved, and looked for where it should be then. Whatever goes wrong in
 * between, what is said tells where the drive may be found. No I/O of its own.
 */
import { nameSpeedKey } from "./configuration_text.js";
import { cleanText } from "./plain.js";

/* How long a drive's power may take to be switched off and on. */
const POWER_TIME_MS = 180000;
const LOOK_EVERY_MS = 500;

/*
 * move: { bus (as Describe has it), what ("address" or "speed"), from (its address), to (the new
 * address, or bit/s), speed (bit/s at which it is spoken to, the bus set aside for it; 0: the bus's
 * own, in service) }.
 *
 * io: look(address, speed) promises the finds there; setUp(address, what, value, speed) a promise
 * of SetUp; say(text, configuration) tells a step; ask(words, yes) promises whether to go on;
 * pause(ms); now() in ms.
 *
 * Promises that it is done; rejects with what is to be said, and then nothing more is done.
 */
export async function setUpDrive(
	{ bus, what, from, to, speed },
	{ look, setUp, say, ask, pause, now }
) {
	const isAddress = what === "address";
	const effect = isAddress ? bus.address_effect : bus.speed_effect;
	let saved = false;
	let at = from;

	function fail(text) {
		throw new Error(text);
	}

	/* Where it may be, when it is not known. */
	function doubt(why) {
		fail(
			isAddress
				? `${why}: the drive may be found at address ${from} or ${to} ` +
						`of ${bus.name}; a scan shows where`
				: `${why}: the drive at address ${from} may be found at its ` +
						`former speed or at ${to} bit/s; a scan of ` +
						`${bus.name} at all speeds shows where`
		);
	}

	async function verdictAt(address, atSpeed) {
		return (await look(address, atSpeed))[0]?.verdict ?? "";
	}

	async function findDrive() {
		const [find] = await look(from, speed);

		if (find?.verdict !== "one")
			fail(
				find
					? `more than one drive answers at address ${from} of ` +
							`${bus.name}: both would take what is ` +
							"said. Take one of them off the line first"
					: `no drive answers at address ${from} of ${bus.name}; ` +
							"a scan finds those that do"
			);
		if (isAddress && (await verdictAt(to, speed)))
			fail(
				`address ${to} of ${bus.name} is taken: somebody answers there; ` +
					"choose another one. Nothing was changed"
			);
		return { identity: cleanText(find.identity), drive: find.drives[0] ?? "" };
	}

	function announce({ identity, drive }) {
		const words = [
			`The drive at address ${from} of ` +
				`${bus.name}${identity ? ` (${identity})` : ""} gets ` +
				`${what} ${to}.`,
			`It must stand, and takes it ${
				effect === "power_up"
					? "when it is saved and its power was off and on"
					: "at once"
			}.`
		];

		if (isAddress)
			words.push(
				`The way back: give address ${to} of ${bus.name} the address ` +
					`${from}.`
			);
		else
			words.push(
				"All drives of a bus must have the same speed, and the bus in " +
					"the configuration too: as long as " +
					`they differ, those at ${to} bit/s are offline. The way ` +
					`back: the speed ${speed || bus.speed} for ` +
					`address ${from}, spoken to at ${to} bit/s.`
			);
		if (drive && isAddress)
			words.push(
				`It is configured as ${drive}: afterwards its section must say ` +
					`address = ${to}.`
			);
		if (speed !== 0 || !isAddress)
			words.push(
				`To look for it at another speed, bus ${bus.name} is set aside: ` +
					"its drives, which must stand, are " +
					"left as on-exit says, and are offline for every PLC " +
					"meanwhile."
			);
		return words;
	}

	async function tell() {
		try {
			await setUp(from, what, to, speed);
		} catch (error) {
			/* Who goes by it at once may not have answered any more. */
			if (error.parameters?.why !== "silent")
				throw error;
		}
	}

	/* Still at its old address, or at the new one already. */
	async function findAgain() {
		at = 0;
		for (const place of isAddress ? [from, to] : [from]) {
			if (at === 0 && (await verdictAt(place, speed)) === "one")
				at = place;
		}
	}

	async function save() {
		/* One that went to its new speed at once is saved by who finds it there. */
		if (at === 0)
			doubt("it was told and does not answer to be saved");
		if (
			!(await ask(
				[
					"save_parameters writes all that it holds into its " +
						"memory. Without it, the change is lost with " +
						"its power."
				],
				"Save"
			))
		)
			doubt("it was not saved");
		try {
			await setUp(at, "save", undefined, speed);
		} catch (error) {
			doubt(`it was not saved: ${error.message}`);
		}
		saved = true;
	}

	async function isThere() {
		return (await verdictAt(isAddress ? to : from, isAddress ? speed : to)) === "one";
	}

	/*
	 * Somebody switches its power. In service its new address is looked at again and again; a
	 * bus that has to be set aside for that is, once, when somebody says that it was done.
	 */
	async function waitForPower() {
		const aside = !isAddress || speed !== 0;
		const until = now() + POWER_TIME_MS;

		say("Now switch its power off and on.");
		if (
			aside &&
			!(await ask(
				["Now switch its power off and on, and go on when that is done."],
				"It was off and on"
			))
		)
			doubt("nobody looked where it is");
		while (!(await isThere())) {
			if (aside || now() > until)
				doubt("it does not answer where it should");
			await pause(LOOK_EVERY_MS);
		}
	}

	/* The service says why. */
	if (effect === "never")
		await setUp(from, what, to, speed);
	say(
		"Looking who answers at address " +
			`${from}${isAddress ? `, and that nobody does at ${to}` : ""}.`
	);
	const found = await findDrive();

	if (!(await ask(announce(found), "Go on")))
		fail("Nothing was changed");
	await tell();
	say(`It was told its new ${what}.`);
	await findAgain();
	if (effect === "power_up")
		await save();
	if (saved)
		say("It was saved.");
	if (effect === "power_up" && at !== to)
		await waitForPower();
	else if (!(await isThere()))
		doubt("it does not answer where it should");
	/* A drive that answers at both would be two. */
	if (isAddress && (await verdictAt(from, speed)))
		doubt("somebody still answers at its former address");
	if (!isAddress)
		say(
			`Done: it answers at ${to} bit/s. When all drives of the bus do, in the ` +
				"configuration:",
			`bus ${bus.name} {\n    ${nameSpeedKey(bus)} = ${to}\n    ...\n`
		);
	else if (found.drive)
		say(
			`Done: it answers at address ${to}. In the configuration:`,
			`drive ${found.drive} {\n    address = ${to}\n    ...\n`
		);
	else
		say(
			`Done: it answers at address ${to}. A scan of ${bus.name} shows a ` +
				"section for the configuration."
		);
}
